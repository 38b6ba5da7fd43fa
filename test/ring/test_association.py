"""Which detection is the ring: the images' support and the motion so far, weighed against its being out of view."""

import math
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from support.ring_fits import detection_at, detection_of

from lasso_motion_ros.motion.respiration import RespiratoryMotion
from lasso_motion_ros.ring.association import Association, AssociationTuning, Hypothesis, associate

CENTRE = np.array([0.005, -0.010, 0.020])
MODEL = SimpleNamespace(centre=CENTRE)
TUNING = AssociationTuning()
PERIOD_S = 1.0 / 3.0
PLAIN, NOTHING = 1.8, 0.6  # evidence of each plane: support 2.34, and 0.78
ASIDE = np.array([0.020, 0.012, 0.009])  # 25 mm


def breathing(index):
    return 6e-3 * (1.0 - np.cos(2.0 * np.pi * index / 12.0)) * np.array([0.08, -0.25, -0.965])


def followed(pairs=24):
    """A motion that has followed two breaths, and the number of the next pair."""
    motion = RespiratoryMotion(0.0, 0.0)
    for index in range(1, pairs):
        detection = detection_at(CENTRE + breathing(index))
        for plane in "ab":
            motion.observe(index * PERIOD_S, **{plane: detection.observation(plane, CENTRE)})
            motion.mark_a(index * PERIOD_S)
        motion.learn(motion.at_a.displacement)
    return motion, pairs


MOTION, NEXT = followed()
TIME_S = NEXT * PERIOD_S
FORETOLD = CENTRE + breathing(NEXT)


def weighed(*detections, motion=MOTION, time_s=TIME_S, planes="ab", usual=1.3 * PLAIN, sightings=10**6, tuning=TUNING):
    return associate(detections, motion, time_s, dict.fromkeys(planes, time_s), MODEL, usual, sightings, tuning)


def total(association):
    return association.absent + sum(one.probability for one in association.hypotheses)


def test_the_probabilities_are_of_everything_there_is():
    plain, weak = detection_at(FORETOLD), detection_at(FORETOLD + 0.5 * ASIDE, evidence=1.1)
    for detections in ((plain,), (plain, weak), (weak,), (plain, detection_at(FORETOLD + 2e-3), weak)):
        association = weighed(*detections)
        # What is negligible is dropped.
        assert total(association) == pytest.approx(1.0, abs=len(detections) * TUNING.weight_kept)
        assert [one.probability for one in association.hypotheses] == sorted(
            (one.probability for one in association.hypotheses), reverse=True
        )


def test_nothing_detected_is_absence():
    association = weighed()
    assert association.best is None
    assert association.absent == 1.0
    np.testing.assert_array_equal(association.spread, 0.0)


def normal(value, mean, sigma):
    return math.exp(-0.5 * ((value - mean) / sigma) ** 2) / (math.sqrt(2.0 * math.pi) * sigma)


def test_the_odds_of_a_foretold_detection_are_the_images_and_seven_by_hand():
    # e² to one for the place, times how often the ring shows so much (mostly as usual, once in ten times anything) by
    # how often all else that is seen does.
    for evidence in (1.0, 1.1, 1.2):
        support = 1.3 * evidence
        ring = 0.9 * normal(support, 1.3 * PLAIN, 0.25) + 0.1 / 1.6
        association = weighed(detection_at(FORETOLD, evidence=evidence))
        assert association.best.detection.support == pytest.approx(support)
        expected = math.exp(2.0) * ring / normal(support, 1.0, 0.15)
        assert association.best.probability / association.absent == pytest.approx(expected, rel=1e-6)


def test_a_faint_ring_that_always_shows_as_little_is_likelier_than_a_plain_one_that_fades():
    faint = detection_at(FORETOLD, evidence=1.0)
    assert weighed(faint, usual=1.4).best.probability > 0.95
    assert weighed(faint, usual=2.35).best.probability < 0.8
    # As long as only the seed pair tells, that says little: a template is like the pair that it is of.
    assert weighed(faint, usual=1.9, sightings=0).best.probability > weighed(faint, usual=1.9).best.probability


def test_far_less_than_usual_may_be_its_like_though_nothing_else_shows_as_much():
    # Two thirds of the ring, 8 mm from where it was foretold: of a lasso that is drawn into its sheath, say.
    left = detection_at(FORETOLD + 0.3 * ASIDE, evidence=1.2)
    assert weighed(left, usual=2.35).best.alike > 0.2
    assert weighed(left, usual=1.6).best.alike < 0.05


def test_its_like_is_thought_of_far_off_and_hardly_where_the_ring_was_foretold():
    # Three in a hundred of all else; motion odds of e⁻² there and of e⁵ and more here.
    far, near = (weighed(detection_at(FORETOLD + off)).best for off in (ASIDE, 0.0 * ASIDE))
    assert far.probability > 0.99
    assert 0.1 < far.alike < 0.3
    assert near.alike < 1e-3


def test_being_where_it_was_foretold_proves_nothing():
    # As much as nothing shows anywhere, just where the ring should be.
    association = weighed(detection_at(FORETOLD, evidence=NOTHING))
    assert association.absent > 0.7
    assert association.best.probability == pytest.approx(1.0 - association.absent)


def test_absence_wins_on_weak_support():
    for place in (FORETOLD, FORETOLD + 0.5 * ASIDE):
        association = weighed(detection_at(place, evidence=0.9))
        assert association.absent > association.best.probability
    assert weighed(detection_at(FORETOLD, evidence=PLAIN)).absent < 1e-4


def test_two_that_look_alike_and_lie_alike_share():
    side = np.array([0.4e-3, 0.0, 0.0])
    association = weighed(detection_at(FORETOLD + side, sigma_m=3e-4), detection_at(FORETOLD - side, sigma_m=3e-4))
    assert [one.probability for one in association.hypotheses] == pytest.approx([0.5, 0.5], abs=0.2)
    assert association.absent < 1e-4


def test_a_plain_one_far_off_loses_to_a_plain_one_that_was_foretold():
    for order in (1, -1):
        detections = (detection_at(FORETOLD), detection_at(FORETOLD + ASIDE))[::order]
        association = weighed(*detections)
        np.testing.assert_allclose(association.best.displacement, breathing(NEXT), atol=2e-4)
        assert association.best.probability > 0.75


@pytest.mark.parametrize("off", [0.1 * ASIDE, 0.6 * ASIDE], ids=["slipped along itself", "a twin beside it"])
def test_a_look_alike_that_shows_a_little_more_does_not_win_against_what_was_foretold(off):
    # Its evidence alone would be worth fourteen log odds more: a ring's own varies by more than that from pair to pair.
    detections = detection_at(FORETOLD, evidence=1.55), detection_at(FORETOLD + off, evidence=1.75)
    association = weighed(*detections)
    np.testing.assert_allclose(association.best.displacement, breathing(NEXT), atol=3e-4)
    assert association.best.probability > 0.9


def test_what_was_foretold_does_not_make_a_ring_of_what_hardly_shows_one():
    alone = weighed(detection_at(FORETOLD, evidence=0.95))
    assert alone.best.probability < 0.9
    # With a plain one elsewhere it has even less to say.
    with_other = weighed(detection_at(FORETOLD, evidence=0.95), detection_at(FORETOLD + ASIDE))
    assert with_other.hypotheses[-1].probability < 0.1 * alone.best.probability


def test_of_two_in_unlikely_places_none_is_believed_that_looks_other_than_it_did():
    # The ring has always shown twice this much, where it was foretold.
    association = weighed(
        detection_at(FORETOLD + ASIDE, evidence=1.3), detection_at(FORETOLD + 0.15 * ASIDE, evidence=1.0)
    )
    assert association.best.probability < 0.9


def test_a_plain_one_far_off_wins_against_what_is_hardly_the_ring():
    # Where it was foretold hardly anything shows: the ring was moved, and is followed there.
    association = weighed(detection_at(FORETOLD, evidence=0.9), detection_at(FORETOLD + ASIDE, evidence=PLAIN))
    np.testing.assert_allclose(association.best.displacement, breathing(NEXT) + ASIDE, atol=5e-4)
    assert association.best.probability > 0.9


def test_moved_by_hand_the_motion_speaks_against_it():
    near, far = (weighed(detection_at(FORETOLD + off)).best for off in (np.zeros(3), ASIDE))
    assert far.log_odds < near.log_odds - 1.0
    assert far.probability > 0.9  # but what is so plain is the ring all the same


def test_a_breath_that_sets_in_unforeseen_is_taken_in():
    # 5 mm on along the breathing's axis: beyond what was foretold, within what a surge explains.
    deeper = FORETOLD + 5e-3 * np.array([0.08, -0.25, -0.965])
    best = weighed(detection_at(deeper)).best
    np.testing.assert_allclose(best.displacement, deeper - CENTRE, atol=3e-4)
    assert best.probability > 0.99


@pytest.mark.parametrize(
    ("way", "off"), [("surge_probability", 0.3 * ASIDE), ("jump_probability", 2.0 * ASIDE)], ids=["surge", "jump"]
)
def test_each_way_of_getting_there_makes_it_more_likely(way, off):
    usual, without = (
        weighed(detection_at(FORETOLD + off), tuning=replace(TUNING, **changed)).best.log_odds
        for changed in ({}, {way: 1e-300})
    )
    assert usual > without + 1.0


def test_the_filter_before_is_not_changed():
    before = MOTION.predict(TIME_S)
    weighed(detection_at(FORETOLD + ASIDE), detection_at(FORETOLD))
    after = MOTION.predict(TIME_S)
    np.testing.assert_array_equal(before.displacement, after.displacement)
    np.testing.assert_array_equal(before.covariance, after.covariance)


def test_the_spread_of_the_mixture_by_hand():
    def at(place, probability):
        motion = SimpleNamespace(at_a=SimpleNamespace(displacement=np.array(place)))
        return Hypothesis(detection_at(FORETOLD), motion, 0.0, 0.0, 0.0, probability=probability)

    one, other = at([0.0, 0.0, 0.0], 0.72), at([0.0, 0.003, 0.004], 0.18)
    # A fifth of what is believed to be the ring lies 5 mm off: E[x xᵀ] = 0.2 · (3, 4)(3, 4)ᵀ mm².
    expected = 0.2e-6 * np.array([[0.0, 0.0, 0.0], [0.0, 9.0, 12.0], [0.0, 12.0, 16.0]])
    np.testing.assert_allclose(Association((one, other), 0.1).spread, expected, atol=1e-15)
    np.testing.assert_array_equal(Association((one,), 0.1).spread, 0.0)


def test_planes_that_disagree_are_told_by_how_much():
    lift = np.array([0.0, 0.0, 1.5e-3])
    fits = detection_at(FORETOLD).planes["a"], detection_at(FORETOLD + lift).planes["b"]
    best = weighed(detection_of({"a": fits[0], "b": fits[1]})).best
    assert best.gap_mm == pytest.approx(1.5, abs=0.02)
    assert best.slack_mm < 0.3  # exposed together, nothing can have moved in between
    alone = weighed(detection_at(FORETOLD, planes="a"), planes="a").best
    assert (alone.gap_mm, alone.slack_mm) == (0.0, 0.0)


def test_one_plane_alone_is_weighed_too_and_worth_less():
    both, alone = (
        weighed(detection_at(FORETOLD, planes=planes, evidence=1.1), planes=planes) for planes in ("ab", "a")
    )
    assert 0.0 < alone.best.probability < both.best.probability
    # Its depth comes from the motion so far.
    np.testing.assert_allclose(alone.best.displacement, breathing(NEXT), atol=1e-3)
