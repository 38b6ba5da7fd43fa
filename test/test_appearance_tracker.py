import copy
import dataclasses
from functools import cache

import numpy as np
import pytest
from lasso_inputs import CURVE, LOOP, PERIOD_NS, VIEWS, lasso_image, lasso_pair, lasso_seed, noisy
from method_inputs import biplane, flip_pixels, flipped, plane

from lasso_motion_ros.appearance_tracker import AppearanceTracker
from lasso_motion_ros.configuration import JudgementConfig, TrackerConfig
from lasso_motion_ros.curves import distance_to_curve
from lasso_motion_ros.errors import LassoMotionError, ReconstructionError, SeedError, TrackingError
from lasso_motion_ros.evaluation.measures import centre_covariance
from lasso_motion_ros.frames import Frame, FramePair, Seed
from lasso_motion_ros.geometry import Projection
from lasso_motion_ros.tracker import TrackerState
from lasso_motion_ros.transforms import apply, rotation_from_vector

CONFIG = TrackerConfig()
TRACKING, DEGRADED, LOST, DISPLACED = (
    TrackerState.TRACKING,
    TrackerState.DEGRADED,
    TrackerState.LOST,
    TrackerState.DISPLACED,
)
PAIR_S = PERIOD_NS * 1e-9
WARM = 18  # pairs, six seconds: a breath and a half
ASIDE = np.array([0.020, 0.012, 0.009])  # 25 mm, away from the breathing's axis


def breathing(time_s):
    """(3,) metres since the first pair, four seconds a breath, 12 mm deep; the same at every twelfth pair."""
    return 6e-3 * (1.0 - np.cos(2.0 * np.pi * time_s / (12.0 * PAIR_S))) * np.array([0.08, -0.25, -0.965])


def moved(index):
    # Rounded, so that the same place is drawn once only.
    return np.round(breathing(index % 12 * PAIR_S), 6)


def pair(index, aside=(0.0, 0.0, 0.0), planes="ab"):
    return lasso_pair(index, moved(index) + aside, planes)


@cache
def warm_up():
    """A tracker after a breath and a half, and what it answered."""
    tracker = AppearanceTracker(CONFIG)
    results = [tracker.initialise(pair(0), lasso_seed())]
    results += [tracker.track(pair(index)) for index in range(1, WARM)]
    return tracker, tuple(results)


@pytest.fixture
def tracker():
    return copy.deepcopy(warm_up()[0])


def centre_error_mm(result, translation, reference=(0.0, 0.0, 0.0)):
    found = apply(result.motion, LOOP.centre + reference)
    return 1e3 * np.linalg.norm(found - (LOOP.centre + translation))


def assert_no_pose(result, state):
    assert result.state is state
    assert result.motion is None
    assert result.covariance is None
    assert result.reason != ""


def test_the_first_pair_is_the_identity_and_the_reference():
    first = warm_up()[1][0]
    assert first.state is TRACKING
    assert first.reason == ""
    assert first.stamp_ns == first.reference_stamp_ns == 0
    np.testing.assert_array_equal(first.motion, np.eye(4))
    assert len(first.loop) >= 64
    assert 1e3 * distance_to_curve(CURVE, first.loop).mean() < 0.25


def test_breathing_is_followed_to_a_tenth_of_a_millimetre():
    errors = []
    for index, result in enumerate(warm_up()[1][1:], start=1):
        assert result.state is TRACKING
        assert result.reason == ""
        assert result.stamp_ns == index * PERIOD_NS
        assert result.reference_stamp_ns == 0
        np.testing.assert_array_equal(result.motion[:3, :3], np.eye(3))
        np.testing.assert_array_equal(result.motion[3], [0.0, 0.0, 0.0, 1.0])
        errors.append(centre_error_mm(result, moved(index)))
        assert 1e3 * distance_to_curve(CURVE + moved(index), result.loop).mean() < 0.25
    assert np.mean(errors) < 0.1
    assert np.max(errors) < 0.2


def test_the_covariance_is_of_the_pose_at_the_world_origin():
    for result in warm_up()[1]:
        np.testing.assert_allclose(result.covariance, result.covariance.T, atol=1e-15)
        assert np.linalg.eigvalsh(result.covariance).min() > -1e-15
        # The rotation is held at zero: its prior, a degree in 14 mm, does not move the ring's own centre.
        rotation = np.radians(70.0) ** 2 * np.sum(result.motion[:3, 3] ** 2) + np.radians(0.25) ** 2
        np.testing.assert_allclose(result.covariance[3:, 3:], rotation * np.eye(3), rtol=1e-9, atol=1e-15)
        centre = LOOP.centre + result.motion[:3, 3]
        at_ring = centre_covariance(result.covariance, centre)
        at_origin = result.covariance[:3, :3]
        assert np.trace(at_ring) < np.trace(at_origin)
        assert 1e3 * np.sqrt(np.trace(at_ring)) < 0.3
        # By hand: that rotation at the ring's distance from the origin.
        lever = rotation * 2.0 * centre @ centre
        assert np.trace(at_origin) == pytest.approx(lever + np.trace(at_ring), rel=0.1)


def test_errors_lie_within_the_covariance():
    normalised = []
    for index, result in enumerate(warm_up()[1][1:], start=1):
        error = result.motion[:3, 3] - moved(index)
        spread = centre_covariance(result.covariance, LOOP.centre + moved(index))
        normalised.append(error @ np.linalg.solve(spread, error))
    assert np.mean(np.array(normalised) < 7.8) > 0.8  # 95 % of three
    assert np.mean(normalised) > 0.05


def test_hidden_it_is_lost_from_that_very_pair_and_found_again(tracker):
    for index in range(WARM, WARM + 4):
        result = tracker.track(lasso_pair(index, None))
        assert_no_pose(result, LOST)
        assert result.loop is None
        assert result.reason == "the lasso is not seen"
        assert result.stamp_ns == index * PERIOD_NS
    back = [tracker.track(pair(index)) for index in range(WARM + 4, WARM + 7)]
    assert back[-1].state is TRACKING
    for index, result in enumerate(back, start=WARM + 4):
        if result.motion is not None:
            assert centre_error_mm(result, moved(index)) < 0.3


def test_taken_out_it_stays_lost(tracker):
    for index in range(WARM, WARM + 8):
        assert_no_pose(tracker.track(lasso_pair(index, None)), LOST)


def test_something_else_is_not_the_lasso(tracker):
    # A ring of half the size without electrodes, where the lasso was.
    small = LOOP.centre + 0.5 * (CURVE - LOOP.centre)
    for index in range(WARM, WARM + 3):
        frames = {
            p: Frame(
                index * PERIOD_NS, noisy(lasso_image(small + moved(index), VIEWS[p], electrodes=0), index), VIEWS[p]
            )
            for p in "ab"
        }
        assert_no_pose(tracker.track(FramePair(index * PERIOD_NS, frames["a"], frames["b"])), LOST)


@pytest.mark.parametrize("pairs", [1, 4])
def test_moved_to_another_vein_it_is_displaced(tracker, pairs):
    # At once, or over four pairs, which is slower than breathing.
    states = []
    for index in range(WARM, WARM + 8):
        share = min(1.0, (index - WARM + 1) / pairs)
        result = tracker.track(pair(index, share * ASIDE))
        states.append(result.state)
        if share == 1.0:
            assert_no_pose(result, DISPLACED)
            # It is still followed, to be seen in the picture.
            assert 1e3 * distance_to_curve(CURVE + moved(index) + ASIDE, result.loop).mean() < 0.5
        elif result.motion is not None:
            assert centre_error_mm(result, moved(index) + share * ASIDE) < 0.5
    # Even where it comes back, as fast as a hand can move it, someone has to say that this is its place.
    assert_no_pose(tracker.track(pair(WARM + 8, 0.5 * ASIDE)), DISPLACED)
    assert_no_pose(tracker.track(pair(WARM + 9)), DISPLACED)


def test_a_displaced_lasso_can_be_made_the_reference(tracker):
    tracker.track(pair(WARM, ASIDE))
    assert tracker.track(pair(WARM + 1, ASIDE)).state is DISPLACED
    tracker.set_reference()
    reference = moved(WARM + 1) + ASIDE
    for index in range(WARM + 2, WARM + 8):
        result = tracker.track(pair(index, ASIDE))
        assert result.state is TRACKING
        assert result.reference_stamp_ns == (WARM + 1) * PERIOD_NS
        assert centre_error_mm(result, moved(index) + ASIDE, reference) < 0.3


def test_a_lasso_that_lies_otherwise_in_its_new_place_can_be_made_the_reference(tracker):
    tilt = np.array([np.radians(5.5), 0.0, 0.0])
    lying = (CURVE - LOOP.centre) @ rotation_from_vector(tilt).T + LOOP.centre + ASIDE

    def shown(index):
        frames = {p: Frame(index * PERIOD_NS, seen(index, p), VIEWS[p]) for p in "ab"}
        return FramePair(index * PERIOD_NS, frames["a"], frames["b"])

    def seen(index, name):
        return noisy(lasso_image(lying + moved(index), VIEWS[name]), [index, ord(name)])

    for index in (WARM, WARM + 1):
        assert tracker.track(shown(index)).state is DISPLACED
    tracker.set_reference()
    reference = moved(WARM + 1) + ASIDE
    for index in range(WARM + 2, WARM + 14):
        result = tracker.track(shown(index))
        assert result.state is TRACKING, result.reason
        assert centre_error_mm(result, moved(index) + ASIDE, reference) < 0.5
        # That it was tilted in the move is no rotation of the atrium.
        np.testing.assert_array_equal(result.motion[:3, :3], np.eye(3))


def test_a_seed_ends_being_displaced(tracker):
    assert tracker.track(pair(WARM, ASIDE)).state is DISPLACED
    here = moved(WARM + 1) + ASIDE
    clicks = lasso_seed(curve=CURVE + here)
    result = tracker.initialise(pair(WARM + 1, ASIDE), clicks)
    assert result.state is TRACKING
    assert result.reference_stamp_ns == (WARM + 1) * PERIOD_NS
    np.testing.assert_array_equal(result.motion, np.eye(4))
    after = tracker.track(pair(WARM + 2, ASIDE))
    assert after.state is TRACKING
    assert centre_error_mm(after, moved(WARM + 2) + ASIDE, here) < 0.2


def test_set_reference_counts_from_the_present_phase(tracker):
    before = tracker.track(pair(WARM))
    tracker.set_reference()
    after = tracker.track(pair(WARM + 1))
    assert after.state is TRACKING
    assert before.reference_stamp_ns == 0
    assert after.reference_stamp_ns == WARM * PERIOD_NS
    assert centre_error_mm(after, moved(WARM + 1), moved(WARM)) < 0.2
    # The loop is where it is, whatever the reference.
    assert 1e3 * distance_to_curve(CURVE + moved(WARM + 1), after.loop).mean() < 0.25


def test_set_reference_is_refused_where_there_is_no_phase_to_refer_to(tracker):
    with pytest.raises(TrackingError, match="seed the tracker first"):
        AppearanceTracker(CONFIG).set_reference()
    tracker.track(lasso_pair(WARM, None))
    with pytest.raises(TrackingError, match="not being tracked"):
        tracker.set_reference()
    assert tracker.track(pair(WARM + 1)).reference_stamp_ns == 0


def test_reset_forgets_the_model(tracker):
    tracker.reset()
    with pytest.raises(TrackingError, match="seed the tracker first"):
        tracker.track(pair(WARM))
    with pytest.raises(TrackingError, match="seed the tracker first"):
        tracker.set_reference()
    assert tracker.initialise(pair(WARM + 6), lasso_seed()).reference_stamp_ns == (WARM + 6) * PERIOD_NS


@pytest.mark.parametrize(("present", "missing"), [("a", "B"), ("b", "A")])
def test_a_missing_plane_is_borne_for_three_seconds(tracker, present, missing):
    errors, spreads = [], []
    both = tracker.track(pair(WARM))
    for index in range(WARM + 1, WARM + 13):
        result = tracker.track(pair(index, planes=present))
        assert result.stamp_ns == index * PERIOD_NS
        if (index - WARM) * PAIR_S > CONFIG.judgement.one_plane_s:
            assert_no_pose(result, LOST)
            assert result.reason.startswith(f"plane {missing} ")
            continue
        assert result.state is DEGRADED
        assert result.reason.startswith(f"plane {missing} missing")
        errors.append(centre_error_mm(result, moved(index)))
        spreads.append(np.trace(centre_covariance(result.covariance, LOOP.centre + moved(index))))
    assert len(errors) == 9
    assert np.mean(errors) < 1.6
    # Depth is what was learned, not what is seen: the covariance says so.
    assert min(spreads) > 2.0 * np.trace(centre_covariance(both.covariance, LOOP.centre + moved(WARM)))
    after = tracker.track(pair(WARM + 13))
    assert after.state is TRACKING
    assert centre_error_mm(after, moved(WARM + 13)) < 0.2


@pytest.mark.parametrize(("present", "empty"), [("a", "B"), ("b", "A")])
def test_a_plane_that_does_not_show_the_lasso_is_never_passed_over(tracker, present, empty):
    frames = {p: (pair(WARM) if p == present else lasso_pair(WARM, None)).frame(p) for p in "ab"}
    result = tracker.track(FramePair(WARM * PERIOD_NS, frames["a"], frames["b"]))
    assert result.state in (DEGRADED, LOST)
    assert f"plane {empty}" in result.reason
    assert result.motion is None or centre_error_mm(result, moved(WARM)) < 1.6


def test_no_plane_at_all_is_lost(tracker):
    assert_no_pose(tracker.track(pair(WARM, planes="")), LOST)
    assert tracker.track(pair(WARM + 1)).state is TRACKING


def turned_pair(index, turn_a, turn_b, *, published=True):
    """Planes turned by (LAO, cranial) degrees, with the matrices that belong to that, or the old ones."""
    frames = {}
    for name, angle, (lao, cranial) in (("a", -30.0, turn_a), ("b", 60.0, turn_b)):
        view = plane(angle + lao, cranial, side=512)
        pixels = noisy(lasso_image(CURVE + moved(index), view), [index, ord(name)])
        frames[name] = Frame(index * PERIOD_NS, pixels, view if published else VIEWS[name])
    return FramePair(index * PERIOD_NS, frames["a"], frames["b"])


def test_a_gantry_that_turns_with_its_matrices_makes_no_jump(tracker):
    for step in range(1, 5):
        index, turn = WARM + step - 1, (2.5 * step, 1.0 * step)
        result = tracker.track(turned_pair(index, turn, turn))
        assert result.state is TRACKING
        assert centre_error_mm(result, moved(index)) < 0.3


@pytest.mark.parametrize(
    ("turn_a", "turn_b"),
    [((20, 0), (20, 0)), ((0, 10), (0, 10)), ((0, 0), (20, 0)), ((0, 0), (0, 10)), ((15, 10), (0, 0))],
)
def test_a_gantry_that_turns_without_its_matrices_is_noticed_within_two_pairs(tracker, turn_a, turn_b):
    # (10° about the patient's axis alone look much like a lasso that has turned and moved: see the limits.)
    for index in (WARM, WARM + 1):
        result = tracker.track(turned_pair(index, turn_a, turn_b, published=False))
        if result.motion is not None:
            assert centre_error_mm(result, moved(index)) < 2.0
    assert result.state in (DEGRADED, LOST)
    assert result.reason != ""


def lifted_pair(index, lift_mm):
    """A pair in which plane B's matrix is that of a detector higher by so much, at the loop."""
    lift = np.eye(3)
    lift[1, 2] = -lift_mm / VIEWS["b"].millimetres_per_pixel(LOOP.centre)
    seen = pair(index)
    off = Projection(lift @ VIEWS["b"].matrix, 512, 512)
    return FramePair(seen.stamp_ns, seen.a, dataclasses.replace(seen.b, projection=off))


def test_planes_that_disagree_are_noticed(tracker):
    result = tracker.track(lifted_pair(WARM, 1.2))
    assert result.state is DEGRADED
    assert result.reason == "the planes disagree by 1.2 mm"
    tracker.reconfigure(dataclasses.replace(CONFIG, judgement=JudgementConfig(lost_gap_mm=1.0)))
    assert tracker.track(lifted_pair(WARM + 1, 1.2)).state in (DEGRADED, LOST)
    # Whatever the limits: back with the right matrix, all is well.
    after = tracker.track(pair(WARM + 2))
    assert after.state is TRACKING
    assert centre_error_mm(after, moved(WARM + 2)) < 0.2


def test_a_disagreement_at_the_seed_is_the_calibrations_and_absorbed():
    other = AppearanceTracker(CONFIG)
    other.initialise(lifted_pair(0, 1.2), lasso_seed())
    for index in range(1, 5):
        result = other.track(lifted_pair(index, 1.2))
        assert result.state is TRACKING
        # As motion is counted from there, nothing of it remains.
        assert 1e3 * np.linalg.norm(result.motion[:3, 3] - moved(index)) < 0.2


def test_planes_that_have_nothing_in_common_are_not_joined(tracker):
    # Of 5 mm no pair of places is made; what one plane shows by itself may carry the pose for a while.
    result = tracker.track(lifted_pair(WARM, 5.0))
    assert result.state in (DEGRADED, LOST)
    assert result.motion is None or centre_error_mm(result, moved(WARM)) < 1.6


def test_a_refused_seed_leaves_the_model_as_it_was(tracker):
    other = copy.deepcopy(tracker)
    away = np.array([0.020, 0.015, -0.030])  # a ring, but where there is none
    with pytest.raises(SeedError, match="no catheter is seen along the clicks"):
        tracker.initialise(pair(WARM), lasso_seed(curve=CURVE + away))
    good = lasso_seed()
    line = np.full((8, 2), 100.0) + 5.0 * np.arange(8)[:, None]
    with pytest.raises(LassoMotionError):
        tracker.initialise(pair(WARM), Seed(line, np.full((8, 2), 300.0)))
    with pytest.raises(SeedError, match="at least 6"):
        tracker.initialise(pair(WARM), Seed(good.points_a[:4], good.points_b))
    with pytest.raises(SeedError, match="lacks plane A"):
        tracker.initialise(pair(WARM, planes="b"), good)
    elsewhere = Seed(good.points_a, VIEWS["b"].project(LOOP.centre + 0.02 + 0.3 * (CURVE[::40] - LOOP.centre)))
    with pytest.raises(ReconstructionError):
        tracker.initialise(pair(WARM), elsewhere)
    here, there = tracker.track(pair(WARM)), other.track(pair(WARM))
    assert here.state is TRACKING
    assert here.reference_stamp_ns == 0
    np.testing.assert_array_equal(here.motion, there.motion)


def test_the_same_pairs_give_the_same_answers(tracker):
    other = copy.deepcopy(tracker)
    for index in range(WARM, WARM + 3):
        here, there = tracker.track(pair(index)), other.track(pair(index))
        np.testing.assert_array_equal(here.motion, there.motion)
        np.testing.assert_array_equal(here.covariance, there.covariance)
        np.testing.assert_array_equal(here.loop, there.loop)
    fresh = AppearanceTracker(CONFIG)
    fresh.initialise(pair(0), lasso_seed())
    for index in range(1, 4):
        np.testing.assert_array_equal(fresh.track(pair(index)).motion, warm_up()[1][index].motion)


def variant(kind):
    """The first pairs and the clicks in another description of the same."""
    seed, pairs = lasso_seed(), [pair(index) for index in range(5)]

    def changed(frame, projection, pixels=None):
        return Frame(frame.stamp_ns, frame.pixels if pixels is None else pixels, projection)

    if kind == "scaled":
        views = {p: Projection(f * VIEWS[p].matrix, 512, 512) for p, f in (("a", -1.0), ("b", 1e-3))}
        pairs = [FramePair(p.stamp_ns, changed(p.a, views["a"]), changed(p.b, views["b"])) for p in pairs]
    elif kind == "mirrored":
        views = {p: flipped(VIEWS[p]) for p in "ab"}
        pairs = [
            FramePair(
                p.stamp_ns,
                *(changed(p.frame(n), views[n], np.ascontiguousarray(p.frame(n).pixels[:, ::-1])) for n in "ab"),
            )
            for p in pairs
        ]
        seed = Seed(*(flip_pixels(seed.points(n), VIEWS[n]) for n in "ab"))
    elif kind == "swapped":
        pairs = [FramePair(p.stamp_ns, p.b, p.a) for p in pairs]
        seed = Seed(seed.points_b, seed.points_a)
    elif kind == "bright":
        pairs = [
            FramePair(p.stamp_ns, *(changed(p.frame(n), VIEWS[n], 255 - p.frame(n).pixels) for n in "ab"))
            for p in pairs
        ]
    elif kind == "deep":
        pairs = [
            FramePair(
                p.stamp_ns, *(changed(p.frame(n), VIEWS[n], p.frame(n).pixels.astype(np.uint16) * 16) for n in "ab")
            )
            for p in pairs
        ]
    return pairs, seed


@pytest.mark.parametrize(
    ("kind", "tolerance_mm"),
    [("scaled", 1e-6), ("mirrored", 0.05), ("swapped", 0.05), ("bright", 0.01), ("deep", 0.01)],
)
def test_the_description_of_the_input_means_nothing(kind, tolerance_mm):
    pairs, seed = variant(kind)
    other = AppearanceTracker(CONFIG)
    results = [other.initialise(pairs[0], seed), *(other.track(p) for p in pairs[1:])]
    for here, there in zip(warm_up()[1][:5], results, strict=True):
        assert there.state is here.state
        np.testing.assert_allclose(there.motion, here.motion, atol=1e-3 * tolerance_mm)


def test_plane_b_may_be_exposed_half_a_period_later():
    late_ns = PERIOD_NS // 2

    def late_pair(index):
        shift = np.round(breathing(index * PAIR_S + late_ns * 1e-9), 6)
        stamp_ns = index * PERIOD_NS + late_ns
        b = Frame(stamp_ns, noisy(lasso_image(CURVE + shift, VIEWS["b"]), [index, 2]), VIEWS["b"])
        return FramePair(index * PERIOD_NS, pair(index).a, b), shift

    other = AppearanceTracker(CONFIG)
    first, b_shift = late_pair(0)
    clicks_b = lasso_seed(curve=CURVE + b_shift).points_b
    other.initialise(first, Seed(lasso_seed().points_a, clicks_b))
    errors, naive = [], []
    for index in range(1, 19):
        now, shift = late_pair(index)
        result = other.track(now)
        assert result.state.has_pose, (index, result.reason)
        assert result.stamp_ns == index * PERIOD_NS
        if index >= 12:
            errors.append(centre_error_mm(result, moved(index)))
            naive.append(1e3 * np.linalg.norm(shift - b_shift - moved(index)))
    assert np.mean(errors) < 0.2
    assert np.mean(errors) < 0.3 * np.mean(naive)


def test_a_pause_or_a_large_breath_is_no_jump(tracker):
    # Two seconds without a pair; the loop is elsewhere on its way.
    result = tracker.track(pair(WARM + 6))
    assert result.state is TRACKING
    assert centre_error_mm(result, moved(WARM + 6)) < 0.2


def test_other_limits_can_be_set_while_it_runs(tracker):
    strict = dataclasses.replace(CONFIG, judgement=JudgementConfig(smallest_correlation=1.0, faint_correlation=1.0))
    tracker.reconfigure(strict)
    assert_no_pose(tracker.track(pair(WARM)), LOST)
    tracker.reconfigure(CONFIG)
    result = tracker.track(pair(WARM + 1))
    assert result.state is TRACKING
    assert centre_error_mm(result, moved(WARM + 1)) < 0.2


def test_pairs_are_not_changed(tracker):
    seen = pair(WARM)
    before = seen.a.pixels.copy(), seen.b.pixels.copy()
    tracker.track(seen)
    np.testing.assert_array_equal(seen.a.pixels, before[0])
    np.testing.assert_array_equal(seen.b.pixels, before[1])


def test_full_size_images_are_tracked_alike():
    views = biplane(side=1024)

    def large(index):
        frames = {
            p: Frame(index * PERIOD_NS, noisy(lasso_image(CURVE + moved(index), views[p]), [index, 7]), views[p])
            for p in "ab"
        }
        return FramePair(index * PERIOD_NS, frames["a"], frames["b"])

    clicks = lasso_seed()
    other = AppearanceTracker(CONFIG)
    other.initialise(large(0), Seed(2.0 * clicks.points_a + 0.5, 2.0 * clicks.points_b + 0.5))
    result = other.track(large(1))
    assert result.state is TRACKING
    assert centre_error_mm(result, moved(1)) < 0.15
