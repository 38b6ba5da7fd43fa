"""Which detection is the ring: the images' support and the motion so far, weighed against its being out of view."""

import dataclasses
import math
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from support.ring_fits import detection_at, detection_of, plane_fit

from lasso_motion_ros.motion.respiration import RespiratoryMotion
from lasso_motion_ros.ring.association import NO_TWINS, Association, AssociationTuning, Hypothesis, Pending, associate
from lasso_motion_ros.ring.twins import Twin, Twins, TwinTuning

CENTRE = np.array([0.005, -0.010, 0.020])
MODEL = SimpleNamespace(centre=CENTRE)
TUNING = AssociationTuning()
PERIOD_S = 1.0 / 3.0
PLAIN = 1.8  # evidence of each plane: support 2.34
# As all else looks: what little is shown is not where the template has it.
NOTHING = {"evidence": 0.6, "likeness": 0.4, "visible": 0.5, "wire": 0.1, "sigma_m": 2e-4}
HARDLY = {"evidence": 0.9, "likeness": 0.5, "visible": 0.6, "wire": 0.1, "sigma_m": 1.5e-4}
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


def weighed(
    *detections,
    motion=MOTION,
    time_s=TIME_S,
    planes="ab",
    usual=1.3 * PLAIN,
    sightings=10**6,
    tuning=TUNING,
    pending=None,
    late_s=0.0,
    twins=NO_TWINS,
):
    times = {plane: time_s + late_s * (plane == "b") for plane in planes}
    return associate(detections, motion, time_s, times, MODEL, usual, sightings, tuning, pending, twins)


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


def look_odds(evidence, likeness=1.0, visible=1.0, wire=0.4, sigma_m=5e-5):
    # A place known to sigma in either direction, in units of 0.1 mm. One in a thousand looks just as plain.
    blur = math.log(math.sqrt(2.0) * sigma_m / 1e-4)
    odds = -5.2 + 3.17 * evidence + 6.41 * min(wire, 0.35) + 2.22 * likeness + 1.45 * visible - 1.64 * blur
    return -math.log(math.exp(-odds) + 1e-3)


def test_the_odds_of_a_foretold_detection_are_those_of_two_planes_by_hand():
    # The planes' rays meet to a quarter of a millimetre, and by what is not known of the motion; or, three times in a
    # hundred, to six. What is not the ring has them meet to two.
    for a, b in ((1.0, 1.0), (1.0, 1.4), (1.4, 1.0)):
        fits = {plane: plane_fit(plane, FORETOLD, evidence=shown) for plane, shown in (("a", a), ("b", b))}
        best = weighed(detection_of(fits)).best
        away = best.displacement - MOTION.predict(TIME_S).displacement
        meets = 0.97 * normal(best.gap_mm, 0.0, math.hypot(best.slack_mm, 0.25)) + 0.03 / 12.0
        meets = math.log(meets * 2.0 * (2.0 + 1.2 * best.slack_mm))
        distance = away @ np.linalg.solve(MOTION.predict(TIME_S).covariance + 16e-6 * np.eye(3), away)
        # All of it is known to 4 mm and what the motion adds, of which only the widest direction counts.
        spread = math.sqrt(np.linalg.eigvalsh(MOTION.predict(TIME_S).covariance + 16e-6 * np.eye(3))[-1])
        place = math.log((1.0 + distance) ** -2 + 1e-3) - 1.7 * math.log(spread / 4e-3)
        expected = look_odds(a) + look_odds(b) + meets + place
        assert best.log_odds == pytest.approx(expected, abs=0.01)
        assert best.probability == pytest.approx(1.0 / (1.0 + math.exp(-expected)), abs=1e-3)


def test_each_thing_that_is_not_as_the_ring_looks_speaks_against_it():
    def odds(likeness=1.0, **shown):
        fits = {plane: plane_fit(plane, FORETOLD, **({"evidence": 1.2} | shown)) for plane in "ab"}
        return weighed(detection_of(fits, likeness=likeness)).best.log_odds

    by_hand = 2.0 * look_odds(1.2)
    assert odds() - odds(likeness=0.6) == pytest.approx(by_hand - 2.0 * look_odds(1.2, likeness=0.6), abs=1e-6)
    assert odds() - odds(visible=0.5) == pytest.approx(by_hand - 2.0 * look_odds(1.2, visible=0.5), abs=1e-6)
    # Darker than most rings' wire proves no more: a bare wire has no electrodes.
    assert odds(wire=1.2) == odds(wire=0.4)
    # Dots like its electrodes, and no wire between them; a blur that may lie anywhere about.
    assert odds() - odds(wire=0.0) == pytest.approx(by_hand - 2.0 * look_odds(1.2, wire=0.0), abs=1e-6)
    # (How well the rays meet counts by the filter's covariance, and hardly changes.)
    blurred = by_hand - 2.0 * look_odds(1.2, sigma_m=1e-4)
    assert odds() - odds(sigma_m=1e-4) == pytest.approx(blurred, abs=0.1)
    # Without noise nothing is sharper than a sharp one.
    assert odds(sigma_m=1e-9) - odds(sigma_m=2e-5) == pytest.approx(0.0, abs=0.1)


def test_what_is_plain_already_gains_nothing_by_being_plainer():
    def odds(**shown):
        fits = {"a": plane_fit("a", FORETOLD, **shown), "b": plane_fit("b", FORETOLD, evidence=1.5, wire=0.1)}
        return weighed(detection_of(fits)).best.log_odds

    # So it cannot make up for what the other plane lacks.
    assert odds(evidence=2.0, wire=0.6) - odds(evidence=1.2, wire=0.4) > 0.2
    # (But for how well the rays meet, which the filter's covariance tells. Without a limit it would be 6.3.)
    assert odds(evidence=4.0, wire=1.8) - odds(evidence=2.0, wire=0.6) < 0.5


def test_the_wider_the_ring_is_foretold_the_more_else_lies_there():
    for later_s in (0.0, 20.0):
        foretold = MOTION.predict(TIME_S + later_s)
        there = detection_at(CENTRE + foretold.displacement)
        plain = dataclasses.replace(TUNING, by_spread=0.0)
        with_it, without = (
            weighed(there, time_s=TIME_S + later_s, tuning=one).best.log_odds for one in (TUNING, plain)
        )
        sigma = math.sqrt(np.linalg.eigvalsh(foretold.covariance + 16e-6 * np.eye(3))[-1])
        assert without - with_it == pytest.approx(1.7 * math.log(sigma / 4e-3), abs=1e-6)
    assert without - with_it > 0.5


def test_far_off_is_unlikely_and_never_impossible():
    here, aside, far = (weighed(detection_at(FORETOLD + off * ASIDE)).best.log_odds for off in (0.0, 0.2, 20.0))
    assert here - aside > 1.0
    # What a C-arm that was moved unsaid shows, however far off.
    assert here - far == pytest.approx(math.log(1e3), abs=0.3)


def test_planes_whose_rays_pass_each_other_are_two_things_unless_something_moves_in_between():
    lift = np.array([0.0, 0.0, 3e-3])
    fits = {"a": plane_fit("a", FORETOLD), "b": plane_fit("b", FORETOLD + lift)}
    together = weighed(detection_of(fits)).best
    later = {"a": TIME_S, "b": TIME_S + 0.5 * PERIOD_S}
    apart = associate([detection_of(fits)], MOTION, TIME_S, later, MODEL, 1.3 * PLAIN, 10**6, TUNING).best
    assert together.slack_mm < 0.3 < apart.slack_mm
    assert together.log_odds < weighed(detection_at(FORETOLD)).best.log_odds - 3.0
    assert apart.log_odds > together.log_odds


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
    association = weighed(detection_at(FORETOLD, **NOTHING))
    assert association.absent > 0.7
    assert association.best.probability == pytest.approx(1.0 - association.absent)


def test_absence_wins_on_weak_support():
    for place in (FORETOLD, FORETOLD + 0.5 * ASIDE):
        association = weighed(detection_at(place, **HARDLY))
        assert association.absent > association.best.probability
    assert weighed(detection_at(FORETOLD, evidence=PLAIN)).absent < 1e-4


def test_two_that_look_alike_and_lie_alike_share():
    side = np.array([0.4e-3, 0.0, 0.0])
    association = weighed(detection_at(FORETOLD + side, sigma_m=3e-4), detection_at(FORETOLD - side, sigma_m=3e-4))
    assert [one.probability for one in association.hypotheses] == pytest.approx([0.5, 0.5], abs=0.2)
    assert association.absent < 1e-4


def test_what_is_right_beside_the_best_may_be_the_ring_seen_a_little_off():
    side, away = np.array([0.5e-3, 0.0, 0.0]), 0.15 * ASIDE
    alone = weighed(detection_at(FORETOLD)).best
    assert alone.believed == alone.probability
    near = weighed(detection_at(FORETOLD + side), detection_at(FORETOLD - side))
    assert near.best.probability < 0.7
    assert near.best.believed == pytest.approx(alone.believed, abs=0.01)
    assert near.hypotheses[1].believed == 0.0  # only of the best one
    far = weighed(detection_at(FORETOLD), detection_at(FORETOLD + away))
    assert far.best.believed == far.best.probability


def test_a_plain_one_far_off_loses_to_a_plain_one_that_was_foretold():
    for order in (1, -1):
        detections = (detection_at(FORETOLD), detection_at(FORETOLD + ASIDE))[::order]
        association = weighed(*detections)
        np.testing.assert_allclose(association.best.displacement, breathing(NEXT), atol=2e-4)
        assert association.best.probability > 0.75


def test_a_twin_that_shows_a_little_more_does_not_win_against_what_was_foretold():
    # A ring's own evidence varies by as much from pair to pair.
    best = weighed(detection_at(FORETOLD, evidence=1.55), detection_at(FORETOLD + 0.6 * ASIDE, evidence=1.75)).best
    np.testing.assert_allclose(best.displacement, breathing(NEXT), atol=3e-4)
    assert best.believed > 0.9


def test_a_known_twin_tells_which_of_two_is_the_ring():
    # The twin comes to where the ring was foretold, and the ring has gone on.
    away = 0.8 * ASIDE
    ring, twin = detection_at(FORETOLD - away), detection_at(FORETOLD)
    assert weighed(ring, twin).best.detection is twin
    told = weighed(ring, twin, twins=Twins(TwinTuning(), (Twin(away, away, CENTRE, 8, moves=True),)))
    assert told.best.detection is ring
    # What hardly shows a ring is nobody's twin.
    faint = detection_at(FORETOLD - away, **HARDLY)
    assert (
        weighed(faint, twin, twins=Twins(TwinTuning(), (Twin(away, away, CENTRE, 8, moves=True),))).best.detection
        is twin
    )
    assert told.rings == (ring, twin)
    assert weighed(faint, twin).rings == (twin,)


def test_of_the_ring_and_itself_slipped_by_more_than_misleads_neither_is_believed():
    best = weighed(detection_at(FORETOLD, evidence=1.55), detection_at(FORETOLD + 0.1 * ASIDE, evidence=1.75)).best
    assert 0.5 < best.believed < 0.9


def test_what_was_foretold_does_not_make_a_ring_of_what_hardly_shows_one():
    alone = weighed(detection_at(FORETOLD, **HARDLY))
    assert alone.best.probability < 0.9
    # With a plain one elsewhere it has even less to say.
    with_other = weighed(detection_at(FORETOLD, **HARDLY), detection_at(FORETOLD + ASIDE))
    assert sum(one.probability for one in with_other.hypotheses[1:]) < 0.1 * alone.best.probability


def test_of_two_in_unlikely_places_none_is_believed_that_looks_other_than_it_did():
    # The ring has always shown twice this much, where it was foretold.
    half = {"likeness": 0.4, "wire": 0.15, "sigma_m": 1e-4}
    association = weighed(
        detection_at(FORETOLD + ASIDE, evidence=1.3, **half),
        detection_at(FORETOLD + 0.15 * ASIDE, evidence=1.0, **half),
    )
    assert association.best.probability < 0.9


def test_a_plain_one_far_off_wins_against_what_is_hardly_the_ring():
    # Where it was foretold hardly anything shows: the ring was moved, and is followed there.
    association = weighed(detection_at(FORETOLD, **HARDLY), detection_at(FORETOLD + ASIDE))
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
def test_each_way_of_getting_there_makes_it_less_likely_to_be_its_like(way, off):
    usual, without = (
        weighed(detection_at(FORETOLD + off), tuning=replace(TUNING, **changed)).best.alike
        for changed in ({}, {way: 1e-300})
    )
    assert usual < 0.6 * without


def test_the_filter_before_is_not_changed():
    before = MOTION.predict(TIME_S)
    weighed(detection_at(FORETOLD + ASIDE), detection_at(FORETOLD))
    after = MOTION.predict(TIME_S)
    np.testing.assert_array_equal(before.displacement, after.displacement)
    np.testing.assert_array_equal(before.covariance, after.covariance)


def test_the_spread_of_the_mixture_by_hand():
    def at(place, probability):
        outcome = SimpleNamespace(at_a=SimpleNamespace(displacement=np.array(place)))
        return Hypothesis(detection_at(FORETOLD), outcome, 0.0, 0.0, 0.0, probability=probability)

    one, other = at([0.0, 0.0, 0.0], 0.72), at([0.0, 0.003, 0.004], 0.18)
    # A fifth of what is believed to be the ring lies 5 mm off: E[x xᵀ] = 0.2 · (3, 4)(3, 4)ᵀ mm².
    expected = 0.2e-6 * np.array([[0.0, 0.0, 0.0], [0.0, 9.0, 12.0], [0.0, 12.0, 16.0]])
    np.testing.assert_allclose(Association((one, other), 0.1).spread, expected, atol=1e-15)
    np.testing.assert_array_equal(Association((one,), 0.1).spread, 0.0)
    for limit_m, beyond in ((0.004, expected), (0.006, 0.0)):
        np.testing.assert_allclose(Association((one, other), 0.1).spread_beyond(limit_m), beyond, atol=1e-15)


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


LATE_S, LIFT = 0.1, np.array([0.0, 0.0, 2.4e-3])


def lifted(evidence=1.0):
    """What hardly shows the ring, plane B always higher: the heart moved it between the seed pair's exposures."""
    looks = {"evidence": evidence, "visible": 0.9, "wire": 0.1, "sigma_m": 1e-4}
    fits = {plane: plane_fit(plane, CENTRE + LIFT * (plane == "b"), **looks) for plane in "ab"}
    return detection_of(fits, likeness=0.75)


def test_what_was_not_believed_is_borne_out_by_the_next_pairs():
    motion, pending, gaps_mm = RespiratoryMotion(0.0, LATE_S), None, []
    for index in range(1, 5):
        asked = {"motion": motion, "time_s": index * PERIOD_S, "late_s": LATE_S}
        alone, found = weighed(lifted(), **asked), weighed(lifted(), pending=pending, **asked)
        if index > 1:
            assert found.best.believed > alone.best.believed + 0.05
        gaps_mm.append(abs(found.best.gap_mm))
        pending = found.pending(0.9, TUNING)
    # That plane B has it higher is foretold the better the more often it was seen.
    assert gaps_mm == sorted(gaps_mm, reverse=True)
    assert gaps_mm[-1] < 0.4 * gaps_mm[0]


def test_what_is_elsewhere_is_not_borne_out():
    motion = RespiratoryMotion(0.0, LATE_S)
    first = weighed(lifted(), motion=motion, time_s=PERIOD_S, late_s=LATE_S)
    asked = {"motion": motion, "time_s": 2.0 * PERIOD_S, "late_s": LATE_S}
    aside = detection_at(CENTRE + 0.3 * ASIDE, evidence=1.3)
    believed = [weighed(aside, pending=one, **asked).best.believed for one in (None, first.pending(0.9, TUNING))]
    assert believed[1] == pytest.approx(believed[0], abs=0.05)


def test_of_what_is_known_and_what_is_pending_that_counts_which_foretold_it_better():
    aside = MOTION.copy()
    aside.move(MOTION.at_a.displacement + np.array([1e-3, 0.0, 0.0]))
    for place, other in ((FORETOLD, MOTION), (FORETOLD + np.array([1e-3, 0.0, 0.0]), aside)):
        found = weighed(detection_at(place), pending=Pending(aside, 0.45))
        np.testing.assert_array_equal(found.best.motion.mean, other.mean)


def test_only_what_both_planes_show_and_is_in_doubt_is_pending():
    plain = weighed(detection_at(FORETOLD))
    assert plain.pending(0.9, TUNING) is None
    doubtful = weighed(detection_at(FORETOLD, **HARDLY))
    one = doubtful.pending(0.9, TUNING)
    assert one.motion is doubtful.best.motion
    assert one.probability == pytest.approx(TUNING.lives_on * doubtful.best.probability)
    assert weighed().pending(0.9, TUNING) is None
    assert weighed(detection_at(FORETOLD, planes="a"), planes="a").pending(0.999, TUNING) is None
