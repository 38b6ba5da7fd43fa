"""Each reason for which a detection is not believed, or only with a doubt, and its words."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from support.ring_fits import detection_of, plane_fit

from lasso_motion_ros.config.ring import JudgementConfig
from lasso_motion_ros.geometry.covariance import probability_beyond
from lasso_motion_ros.geometry.frames import Frame, FramePair
from lasso_motion_ros.geometry.projection import Projection
from lasso_motion_ros.motion.motion_model import Estimate
from lasso_motion_ros.ring.association import Association, Hypothesis
from lasso_motion_ros.ring.companion_slide import CompanionSlide, CompanionSlideTuning, SlideSight
from lasso_motion_ros.ring.own_turn import OwnTurn
from lasso_motion_ros.ring.seed_agreement import SeedAgreement
from lasso_motion_ros.ring.slide import Slide
from lasso_motion_ros.ring.track_state import StateTuning, TrackBelief
from lasso_motion_ros.ring.validation import (
    ValidationTuning,
    contradiction,
    drawn_in,
    fading,
    left_behind,
    misleading,
    out_of_place,
    quality,
    refusal,
    shows_looks,
    unforeseen,
)
from lasso_motion_ros.tracking.tracker import TrackerState

LIMITS = JudgementConfig(degraded_gap_mm=0.8, lost_gap_mm=1.6, degraded_turn_deg=6.0, lost_turn_deg=8.0)
TUNING, STATES = ValidationTuning(), StateTuning()
VIEW = Projection(np.array([[900.0, 0.0, 64.0, 50.0], [0.0, 900.0, 64.0, 50.0], [0.0, 0.0, 1.0, 0.8]]), 8, 8)
FRAME = Frame(0, np.zeros((8, 8), np.uint8), VIEW)
BOTH, ONLY_A, ONLY_B = FramePair(0, FRAME, FRAME), FramePair(0, FRAME, None), FramePair(0, None, FRAME)
HERE = np.array([0.010, -0.020, 0.015])
# Of a motion that is known exactly: whatever is not known of a pose is given beside it.
KNOWN = SimpleNamespace(
    at_a=Estimate(np.zeros(3), np.zeros((3, 3))), beyond=lambda limit, more, across: probability_beyond(limit, more)
)
MOVED_C_ARM = "moved C-arm without a new calibration?"


def track(
    *,
    contrast=0.2,
    home_turn_deg=0.0,
    own_turn=OwnTurn(0.02, 0.01**2),  # noqa: B008
    belief=TrackBelief(0.999, 0.0, 0.001),  # noqa: B008
    doubt="",
    usual=2.2,
    contradicts=0.0,
    size_mm=4.0,
    withdrawn=0.0,
    slide=Slide(),  # noqa: B008
    joined_slide=CompanionSlide.first(CompanionSlideTuning()),  # noqa: B008
    denied=False,
):
    home_turn = np.radians([home_turn_deg, 0.0, 0.0])
    return SimpleNamespace(
        contrast={"a": contrast, "b": contrast},
        turn_of=lambda found: found.detection.alignment.turn - home_turn,
        own_turn=own_turn,
        belief=belief,
        agreement=SeedAgreement(0.0, doubt),
        contradiction=SimpleNamespace(probability=contradicts, text="they contradict each other", size_mm=size_mm),
        withdrawal=SimpleNamespace(probability=withdrawn, text="a part of it is gone"),
        usual_support=usual,
        slide=slide,
        joined_slide=joined_slide,
        companions=SimpleNamespace(deny=denied),
        motion=KNOWN,
    )


def best(a=1.8, b=1.8, *, probability=0.999, turn_deg=0.0, contrast=0.2, **of_hypothesis):
    """A hypothesis by the evidence of each plane; None: a plane that was not exposed."""
    shown = {"a": a, "b": b}
    fits = {p: plane_fit(p, HERE, evidence=e, contrast=contrast) for p, e in shown.items() if e is not None}
    detection = detection_of(fits, turn=np.radians([turn_deg, 0.0, 0.0]))
    values = {"log_odds": 9.0, "gap_mm": 0.1, "slack_mm": 0.05} | of_hypothesis
    return Hypothesis(detection, None, probability=probability, believed=probability, **values)


def refused(hypothesis, *others, pair=BOTH, of_track=None):
    hypotheses = () if hypothesis is None else (hypothesis, *others)
    absent = max(0.0, 1.0 - sum(one.probability for one in hypotheses))
    return refusal(of_track or track(), Association(hypotheses, absent), pair, LIMITS, TUNING, STATES)


def judged(hypothesis, *, pair=BOTH, of_track=None):
    return quality(of_track or track(), hypothesis, pair, LIMITS, TUNING, STATES)


def test_what_is_plain_is_believed():
    assert refused(best()) == ""
    assert judged(best()) == (TrackerState.TRACKING, "")


def test_nothing_detected_is_not_seen():
    assert refused(None) == "the lasso is not seen"
    assert refused(best(0.9, 0.8, probability=0.2)) == "the lasso is not seen"
    assert refused(best(1.8, None, probability=0.2), pair=ONLY_A) == "the lasso is not seen"


@pytest.mark.parametrize(("a", "b", "plane"), [(1.8, 0.2, "B"), (0.2, 1.8, "A"), (1.8, None, "B")])
def test_a_plane_that_shows_nothing_contradicts(a, b, plane):
    said = refused(best(a, b, probability=0.3))
    other = {"A": "B", "B": "A"}[plane]
    assert said == f"plane {plane} does not show the lasso where plane {other} has it"


def test_the_probability_that_a_pose_asks_for():
    assert refused(best(probability=STATES.pose)) == ""
    assert refused(best(probability=STATES.pose - 0.01)) != ""


def test_other_places_that_look_alike_are_said():
    twin = best(probability=0.45)
    assert refused(best(probability=0.5), twin) == "other places look nearly as much like the lasso"
    # Where absence is the likelier rival, it is that.
    assert "other places" not in refused(best(0.9, 0.8, probability=0.3), best(probability=0.1))


@pytest.mark.parametrize(
    ("gap_mm", "slack_mm", "said"),
    [
        (1.6, 0.05, ""),
        (1.7, 0.05, f"the planes disagree by 1.7 mm: {MOVED_C_ARM}"),
        # What moved between the exposures may be 4 standard deviations.
        (3.9, 1.0, ""),
        (4.1, 1.0, f"the planes disagree by 4.1 mm: {MOVED_C_ARM}"),
    ],
)
def test_planes_that_disagree_much_are_refused(gap_mm, slack_mm, said):
    assert refused(best(gap_mm=gap_mm, slack_mm=slack_mm)) == said


def test_planes_that_disagree_as_the_breath_goes_are_a_doubt():
    assert judged(best(), of_track=track(contradicts=0.02)) == (TrackerState.TRACKING, "")
    assert judged(best(), of_track=track(contradicts=0.05)) == (TrackerState.DEGRADED, "they contradict each other")


def test_planes_that_likely_disagree_by_so_much_that_it_misleads_leave_no_pose():
    assert contradiction(track(contradicts=0.2), STATES) == "they contradict each other"
    assert contradiction(track(contradicts=0.05), STATES) == ""
    assert contradiction(track(contradicts=0.2, size_mm=1.9), STATES) == ""


def test_a_ring_of_which_a_part_may_be_gone_is_a_doubt_and_carries_no_pose_where_that_is_likely():
    assert judged(best(), of_track=track(withdrawn=0.02)) == (TrackerState.TRACKING, "")
    assert judged(best(), of_track=track(withdrawn=0.05)) == (TrackerState.DEGRADED, "a part of it is gone")
    assert drawn_in(track(withdrawn=0.05), STATES) == ""
    assert drawn_in(track(withdrawn=0.2), STATES) == "a part of it is gone"
    # Doubt must not feed on itself: what is learned goes on as without it.
    assert shows_looks(track(withdrawn=0.9), best(), LIMITS, TUNING, STATES)


def misled(of_track, sigma_mm):
    return misleading(of_track, 1e-6 * sigma_mm**2 * np.eye(3), Association((), 0.0), best(probability=1.0), STATES)


def test_a_pose_misleads_by_what_is_not_known_of_it_or_by_a_slide():
    # Chi squared of three degrees of freedom is more than 4 in 0.2615, more than 6.25 in 0.1001. Half of what shows: of
    # 1 mm of a slide that is sure 0.134 is more than 2 mm.
    vague, said = misled(track(), 1.0)
    assert (vague, said) == (pytest.approx(0.2615, abs=1e-4), "its place is known to 1.0 mm only")
    vague, said = misled(track(), 0.8)
    assert (vague, said) == (pytest.approx(0.1001, abs=1e-4), "its place is known to 0.8 mm only")
    slid, said = misled(track(slide=Slide((1e-3, 0.0, 0.0), 50.0)), 0.1)
    assert slid == pytest.approx(1.0 - np.sqrt(0.75))
    assert said == "it seems to slide: 1.0 mm across its breathing, and perhaps more along it"
    both, said = misled(track(slide=Slide((1e-3, 0.0, 0.0), 50.0)), 0.8)
    assert both == pytest.approx(1.0 - (1.0 - vague) * (1.0 - slid))
    assert said.startswith("it seems to slide")


def test_companions_that_one_plane_alone_shows_have_no_say_along_its_ray():
    stands = CompanionSlide.first(CompanionSlideTuning())
    sight = SlideSight(np.array([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]), np.zeros(2), 1e-7, 0.0)
    for _ in range(10):
        stands = stands.after(0.5, [sight])
    for away, expected in (([0.0, 0.0, 1.5e-3], 1.0 - np.sqrt(1.0 - 0.75**2)), ([0.0, 1.5e-3, 0.0], 0.0)):
        own = Slide(tuple(away), 50.0)
        slid, _ = misled(track(slide=own, joined_slide=stands.joined(own)), 0.1)
        assert slid == pytest.approx(expected, abs=5e-3)


def test_each_heart_that_the_motion_considers_counts_by_itself_but_along_the_ray_of_a_plane_that_is_alone():
    of_track, asked = track(), []

    def beyond(limit_m, more, across):
        asked.append((more, across))
        return 0.4

    of_track.motion = SimpleNamespace(at_a=Estimate(np.zeros(3), 1e-8 * np.eye(3)), beyond=beyond)
    share, said = misled(of_track, 0.1)
    assert share == pytest.approx(0.4, abs=2e-3)
    assert "its place is known to 0.1 mm only" in said
    np.testing.assert_array_equal(asked[-1][1], np.eye(3))
    np.testing.assert_allclose(asked[-1][0], 0.0, atol=1e-20)
    alone = best(b=None, probability=1.0)
    misleading(of_track, 1e-8 * np.eye(3), Association((), 0.0), alone, STATES)
    ray = alone.detection.planes["a"].ray
    more, across = asked[-1]
    np.testing.assert_allclose(across, np.eye(3) - np.outer(ray, ray), atol=1e-12)
    # The depth is not the filters': all of what is known of it is given beside them.
    np.testing.assert_allclose(more, 1e-8 * np.outer(ray, ray), atol=1e-20)


def test_what_is_not_the_ring_misleads_as_often_as_it_is_not_however_far_off_the_ring_is():
    def at(x_m, probability, believed):
        outcome = SimpleNamespace(at_a=SimpleNamespace(displacement=np.array([x_m, 0.0, 0.0])))
        return replace(best(1.8, 1.2, probability=probability), outcome=outcome, believed=believed)

    for far_m in (0.012, 0.050):
        places = Association((at(0.0, 0.97, 0.97), at(far_m, 0.03, 0.0)), 0.0)
        position = 1e-8 * np.eye(3) + places.spread
        # As a normal deviate this would be 2 to 9 mm wide, and off by more than 2 mm in a third of all cases or more.
        share, said = misleading(track(), position, places, places.hypotheses[0], STATES)
        assert (share, said) == (pytest.approx(0.03), "other places look nearly as much like the lasso")
    nowhere = Association((at(0.0, 0.94, 0.94),), 0.06)
    share, said = misleading(track(), 1e-8 * np.eye(3), nowhere, nowhere.hypotheses[0], STATES)
    assert (share, said) == (pytest.approx(0.06), "plane B shows the lasso only faintly")
    # One that is beside it widens what is known of its place: by 0.2 · 1.5² mm².
    places = Association((at(0.0, 0.8, 1.0), at(0.0015, 0.2, 0.0)), 0.0)
    share, said = misleading(track(), 1e-6 * np.eye(3) + places.spread, places, places.hypotheses[0], STATES)
    assert (share, said) == (pytest.approx(0.3230, abs=1e-3), "its place is known to 1.2 mm only")


def test_what_moves_with_the_heart_beside_it_has_the_last_word_on_a_slide():
    def companions(size_mm, sigma_mm=0.5, since_s=0.0):
        offset, covariance = 1e-3 * np.array([size_mm, 0.0, 0.0]), 1e-6 * sigma_mm**2 * np.eye(3)
        return CompanionSlide.at(CompanionSlideTuning(), offset, covariance, since_s)

    seems = Slide((1e-3, 0.0, 0.0), 50.0)
    # It has not, whatever its own past makes of it: two standard deviations from where it would mislead, in a million
    # such places 49,700 times.
    slid, said = misled(track(slide=seems, joined_slide=companions(1.0)), 0.1)
    assert slid == pytest.approx(0.0497, abs=2e-3)
    assert said == "it seems to slide: 1.0 mm from what moves with the heart beside it"
    # It has, along the way of its breathing, where its past shows nothing.
    slid, said = misled(track(joined_slide=companions(3.0)), 0.1)
    assert slid == pytest.approx(0.986, abs=6e-3)
    # What is not seen any more tells of no innocence, but of what it told before.
    slid, said = misled(track(slide=seems, joined_slide=companions(0.5, since_s=5.0)), 0.1)
    assert said.endswith("across its breathing, and perhaps more along it")
    slid, said = misled(track(slide=seems, joined_slide=companions(3.0, since_s=5.0)), 0.1)
    assert slid == pytest.approx(0.986, abs=6e-3)
    # But a doubt, once they are gone, is one that nobody could take back.
    assert misled(track(joined_slide=companions(1.5, since_s=1.0)), 0.1)[0] > 0.15
    assert misled(track(joined_slide=companions(1.5, since_s=5.0)), 0.1)[0] < 1e-6


def test_it_says_why_a_ring_that_is_seen_is_not_surely_in_its_place():
    aside = TrackBelief(0.5, 0.45, 0.05, 0.0)
    assert out_of_place(track(belief=aside), 3.1, STATES) == "3.1 times as far from breathing as breaths are apart"
    assert "left what moves with the heart" in out_of_place(track(belief=aside, denied=True), 1.0, STATES)
    back = TrackBelief(0.6, 0.1, 0.3, 0.0)
    assert "come into view again" in out_of_place(track(belief=back), 0.3, STATES)


AWAY = TrackBelief(0.1, 0.9, 0.0)


@pytest.mark.parametrize(
    ("found", "of_track", "learns"),
    [
        (best(), {}, True),
        (best(probability=STATES.learned), {}, True),
        (best(probability=STATES.learned - 0.01), {}, False),
        (best(probability=0.9, alike=0.3), {}, False),  # or its like
        (best(1.8, None), {}, False),
        (best(0.7, 0.7), {}, False),  # less than half of what is usual
        (best(turn_deg=9.0), {}, False),
        (best(gap_mm=1.7), {}, False),
        (best(contrast=0.1), {}, False),  # left over in a filter over time
        (best(), {"belief": AWAY}, False),
        (best(), {"contradicts": 0.4}, False),
    ],
)
def test_what_is_probably_the_ring_is_learned_from_whether_a_pose_rests_on_it_or_not(found, of_track, learns):
    assert shows_looks(track(**of_track), found, LIMITS, TUNING, STATES) is learns


def test_it_says_what_the_ring_has_left():
    slid = CompanionSlide.at(CompanionSlideTuning(), np.array([8e-3, 0.0, 0.0]), 1e-7 * np.eye(3), 0.0)
    left = "it has left what moves with the heart beside it, or that was moved"
    assert left_behind(track(denied=True), 1.0, STATES) == left
    assert left_behind(track(joined_slide=slid), 1.0, STATES) == left
    assert left_behind(track(), 1.0, STATES) == ""
    assert left_behind(track(denied=True), 4.0, STATES) == ""  # it has left its breathing, whatever the others do


def test_what_is_far_from_where_it_was_foretold_may_be_something_else():
    asked = LIMITS, TUNING, STATES
    assert unforeseen(best(alike=0.09), *asked) == ""
    assert unforeseen(best(alike=0.2), *asked).startswith("it is far from where it was foretold")
    # Where the planes disagree that is what is off.
    assert unforeseen(best(alike=0.2, gap_mm=-1.2), *asked) == f"the planes disagree by 1.2 mm: {MOVED_C_ARM}"


@pytest.mark.parametrize(
    ("gap_mm", "slack_mm", "state"),
    [
        (0.8, 0.05, TrackerState.TRACKING),
        (0.9, 0.05, TrackerState.DEGRADED),
        (2.4, 1.0, TrackerState.TRACKING),
        (2.6, 1.0, TrackerState.DEGRADED),
    ],
)
def test_planes_that_disagree_a_little_are_a_doubt(gap_mm, slack_mm, state):
    found, said = judged(best(gap_mm=gap_mm, slack_mm=slack_mm))
    assert found is state
    assert said == ("" if state is TrackerState.TRACKING else f"the planes disagree by {gap_mm:.1f} mm")


def test_a_ring_that_is_turned_since_it_belonged_so():
    assert refused(best(turn_deg=8.1)) == f"the lasso is turned by 8 degrees: {MOVED_C_ARM}"
    assert refused(best(turn_deg=7.9)) == ""
    by_heart = (TrackerState.DEGRADED, "the lasso is turned by 6 degrees, by the heartbeat or a moved C-arm")
    assert judged(best(turn_deg=6.1)) == by_heart
    assert judged(best(turn_deg=5.9))[0] is TrackerState.TRACKING
    # Counted from how it belongs; one plane alone tells no turn.
    assert refused(best(turn_deg=8.1), of_track=track(home_turn_deg=3.0)) == ""
    assert refused(best(None, 1.8, turn_deg=12.0), pair=ONLY_B) == ""


def test_a_ring_that_turns_with_every_beat_is_no_moved_c_arm():
    used_to_it = track(own_turn=OwnTurn(0.02, 0.032**2))  # by 1.6 times as far as was expected
    assert refused(best(turn_deg=12.7), of_track=used_to_it) == ""
    assert refused(best(turn_deg=12.9), of_track=used_to_it) == f"the lasso is turned by 13 degrees: {MOVED_C_ARM}"
    assert judged(best(turn_deg=9.5), of_track=used_to_it)[0] is TrackerState.TRACKING
    assert judged(best(turn_deg=9.7), of_track=used_to_it)[0] is TrackerState.DEGRADED


@pytest.mark.parametrize(("share", "said"), [(1.0, ""), (0.6, ""), (0.5, "only 50 % of its contrast is left")])
def test_what_a_filter_over_time_leaves_of_it_is_not_the_lasso(share, said):
    found = fading(track(), best(contrast=0.2 * share), ValidationTuning())
    assert found == (said and f"{said}: gone, and still in the images' filter over time?")
    alone = fading(track(), best(1.8, None, contrast=0.2 * share), ValidationTuning())
    assert alone == found


def test_what_shows_less_than_half_of_what_is_usual_is_not_believed_to_be_all_there():
    # The weaker plane's evidence and 0.3 of the stronger one's.
    assert refused(best(0.55 * 2.2 / 1.3, 0.55 * 2.2 / 1.3)) == ""
    assert refused(best(0.6, 1.3)) == "plane A hardly shows the lasso: 45 % of what is usual is left"
    assert refused(best(1.3, 0.6)) == "plane B hardly shows the lasso: 45 % of what is usual is left"
    # Of one plane less is expected, and how much less, nobody knows.
    assert refused(best(0.6, None), pair=ONLY_A) == ""


def test_one_plane_alone_is_a_doubt_that_says_which_is_missing_and_why():
    assert judged(best(1.8, None), pair=ONLY_A) == (
        TrackerState.DEGRADED,
        "plane B missing: depth from the breathing so far",
    )
    assert judged(best(None, 1.8), pair=ONLY_B) == (
        TrackerState.DEGRADED,
        "plane A missing: depth from the breathing so far",
    )
    assert judged(best(None, 1.8), pair=BOTH) == (
        TrackerState.DEGRADED,
        "plane A does not reach as far as the lasso: depth from the breathing so far",
    )


def test_a_plane_that_shows_it_faintly_is_a_doubt_and_said_to():
    faint = best(1.8, 1.1, probability=0.9)
    assert judged(faint) == (TrackerState.DEGRADED, "plane B shows the lasso only faintly")


def test_a_plane_that_shows_less_than_it_did_is_a_doubt():
    # 1.1 and 1.5: 1.55 together, 70 % of 2.21.
    assert judged(best(1.5, 1.1), of_track=track(usual=2.22)) == (
        TrackerState.DEGRADED,
        "plane B shows less of the lasso than it did",
    )
    assert judged(best(1.5, 1.1), of_track=track(usual=2.2)) == (TrackerState.TRACKING, "")


def test_a_doubt_about_its_place_is_not_laid_to_a_plane():
    # Both planes show it plainly; that it was displaced a moment ago is what is in doubt.
    state, said = judged(best(), of_track=track(belief=TrackBelief(0.8, 0.2, 0.0)))
    assert state is TrackerState.DEGRADED
    assert "faintly" not in said
