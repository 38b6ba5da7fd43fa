import dataclasses

import numpy as np
import pytest
from support.method_inputs import angle_deg
from support.tracking_inputs import LOOP, PERIOD_NS, VIEWS, pair, seed

from lasso_motion_ros.brost2009.tracker import Brost2009Tracker
from lasso_motion_ros.config.brost2009 import FeatureConfig, ModelConfig, RegistrationConfig
from lasso_motion_ros.config.tracker import TrackerConfig
from lasso_motion_ros.core.errors import ReconstructionError, SeedError, TrackingError
from lasso_motion_ros.geometry.curves import distance_to_curve
from lasso_motion_ros.geometry.frames import Frame, FramePair, Seed
from lasso_motion_ros.geometry.transforms import apply
from lasso_motion_ros.tracking.tracker import TrackerState

PUBLISHED = TrackerConfig(method="brost2009")
# What the tracker does with its pairs shows more sharply with what the paper does not have.
CONFIG = dataclasses.replace(
    PUBLISHED,
    features=FeatureConfig(clipped_share=0.001, distance="chamfer"),
    registration=RegistrationConfig(tie_break=0.05),
)
# Up to 4 mm from pair to pair.
PATH = np.array([[0, 0, 0], [0.5, -1, 2.5], [1, -2, 6], [0.5, -1, 3], [0, 0.5, 0.5]]) * 1e-3


@pytest.fixture
def tracker():
    return Brost2009Tracker(CONFIG)


@pytest.fixture
def seeded(tracker):
    tracker.initialise(pair(0), seed())
    return tracker


def centre_error_mm(result, translation):
    return 1e3 * np.linalg.norm(apply(result.motion, LOOP.centre) - (LOOP.centre + translation))


def test_first_pair_is_the_identity_and_the_reference(tracker):
    result = tracker.initialise(pair(3), seed())
    assert result.state is TrackerState.TRACKING
    assert result.reason == ""
    assert result.stamp_ns == result.reference_stamp_ns == 3 * PERIOD_NS
    np.testing.assert_allclose(result.motion, np.eye(4), atol=1e-12)
    assert set(result.residual_px) == {"a", "b"}
    assert max(result.residual_px.values()) < 1.0


def test_model_is_the_ring(tracker):
    result = tracker.initialise(pair(0), seed())
    assert result.loop.shape == (CONFIG.model.points + 1, 3)
    np.testing.assert_array_equal(result.loop[0], result.loop[-1])
    truth = LOOP.points(400)
    assert 1e3 * distance_to_curve(result.loop, np.vstack([truth, truth[:1]])).mean() < 0.3
    assert 1e3 * np.linalg.norm(result.loop[:-1].mean(axis=0) - LOOP.centre) < 0.3


@pytest.mark.parametrize("bright", [False, True])
def test_follows_the_ring_within_three_tenths_of_a_millimetre(tracker, bright):
    tracker.initialise(pair(0, PATH[0], bright=bright), seed())
    errors_mm = []
    for index, translation in enumerate(PATH[1:], start=1):
        result = tracker.track(pair(index, translation, bright=bright))
        assert result.state is TrackerState.TRACKING
        assert result.stamp_ns == index * PERIOD_NS
        assert result.reference_stamp_ns == 0
        errors_mm.append(centre_error_mm(result, translation))
        for name in "ab":
            seen = VIEWS[name].project(result.loop)
            truth = VIEWS[name].project(LOOP.points(400) + translation)
            assert distance_to_curve(seen, np.vstack([truth, truth[:1]])).mean() < 1.0  # 0.26 mm at the loop
            assert result.residual_px[name] < 1.0
    assert np.mean(errors_mm) < 0.3
    assert np.max(errors_mm) < 0.45


def test_as_published_it_stops_at_the_rim_of_equal_costs():
    tracker = Brost2009Tracker(PUBLISHED)
    tracker.initialise(pair(0, PATH[0]), seed())
    results = [tracker.track(pair(index, translation)) for index, translation in enumerate(PATH[1:], start=1)]
    errors_mm = [centre_error_mm(result, translation) for result, translation in zip(results, PATH[1:], strict=True)]
    assert max(max(result.residual_px.values()) for result in results) < 0.1
    assert 0.45 < np.mean(errors_mm) < 1.2
    assert np.max(errors_mm) < 1.5


def test_every_pair_starts_where_the_last_one_ended(seeded):
    # Six steps of 4 mm: the last is 24 mm from the first, more than the ring's diameter.
    for index in range(1, 7):
        result = seeded.track(pair(index, (0.0, 0.0, -0.004 * index)))
    assert centre_error_mm(result, np.array([0.0, 0.0, -0.024])) < 0.45


def test_deep_images_are_tracked_alike(tracker):
    def deep(shallow):
        frames = (Frame(f.stamp_ns, f.pixels.astype(np.uint16) * 16, f.projection) for f in (shallow.a, shallow.b))
        return FramePair(shallow.stamp_ns, *frames)

    tracker.initialise(deep(pair(0)), seed())
    assert centre_error_mm(tracker.track(deep(pair(1, PATH[1]))), PATH[1]) < 0.45


def test_the_same_pairs_give_the_same_poses():
    first, second = Brost2009Tracker(CONFIG), Brost2009Tracker(CONFIG)
    for one in (first, second):
        one.initialise(pair(0), seed())
    np.testing.assert_array_equal(first.track(pair(1, PATH[1])).motion, second.track(pair(1, PATH[1])).motion)


def test_set_reference_counts_from_the_present_phase(seeded):
    reference_loop = seeded.track(pair(1, PATH[1])).loop
    seeded.set_reference()
    here = seeded.track(pair(2, PATH[1]))
    assert here.reference_stamp_ns == PERIOD_NS
    # p_now = T · p_reference: nothing has moved since.
    assert 1e3 * np.linalg.norm(here.motion[:3, 3]) < 0.3
    there = seeded.track(pair(3, PATH[2]))
    moved = apply(there.motion, LOOP.centre + PATH[1])
    assert 1e3 * np.linalg.norm(moved - (LOOP.centre + PATH[2])) < 0.4
    # Point by point, turns included: the order of the two motions matters.
    np.testing.assert_allclose(apply(there.motion, reference_loop), there.loop, atol=1e-12)
    # The loop is where it is, whatever the reference.
    assert 1e3 * np.linalg.norm(there.loop[:-1].mean(axis=0) - (LOOP.centre + PATH[2])) < 0.4


@pytest.mark.parametrize(("present", "missing"), [("b", "A"), ("a", "B")])
def test_missing_plane_gives_no_pose_and_the_next_pair_one(seeded, present, missing):
    result = seeded.track(pair(1, PATH[1], planes=present))
    assert result.state is TrackerState.LOST
    assert result.reason == f"plane {missing} is missing and the method needs both"
    assert result.motion is None
    assert result.loop is None
    assert result.stamp_ns == PERIOD_NS
    assert centre_error_mm(seeded.track(pair(2, PATH[1])), PATH[1]) < 0.45


def test_as_published_it_never_says_that_it_has_lost_the_ring(seeded):
    empty = pair(1, (10.0, 0.0, 0.0))  # ten metres away: the images are blank
    result = seeded.track(empty)
    assert result.state is TrackerState.TRACKING
    assert result.motion is not None


def test_nothing_to_do_before_a_seed(tracker):
    with pytest.raises(TrackingError, match="seed the tracker first"):
        tracker.track(pair(0))
    with pytest.raises(TrackingError, match="seed the tracker first"):
        tracker.set_reference()
    tracker.reset()


def test_reset_forgets_the_model(seeded):
    seeded.track(pair(1, PATH[1]))
    seeded.reset()
    with pytest.raises(TrackingError, match="seed the tracker first"):
        seeded.track(pair(2))
    again = seeded.initialise(pair(3), seed())
    np.testing.assert_allclose(again.motion, np.eye(4), atol=1e-12)
    assert again.reference_stamp_ns == 3 * PERIOD_NS


def test_a_refused_seed_leaves_the_model_as_it_was(seeded):
    few = Seed(seed().points_a[:4], seed().points_b)
    with pytest.raises(SeedError, match="plane A: 4 clicks"):
        seeded.initialise(pair(1, PATH[1]), few)
    with pytest.raises(SeedError, match="lacks plane B"):
        seeded.initialise(pair(1, planes="a"), seed())
    shifted = Seed(seed().points_a, seed().points_b - [0.0, 150.0])
    with pytest.raises(ReconstructionError):
        seeded.initialise(pair(1, PATH[1]), shifted)
    assert centre_error_mm(seeded.track(pair(2, PATH[1])), PATH[1]) < 0.45


def test_number_of_model_points_is_configured():
    config = dataclasses.replace(CONFIG, model=ModelConfig(points=40))
    assert Brost2009Tracker(config).initialise(pair(0), seed()).loop.shape == (41, 3)


def test_ring_seen_in_its_plane_keeps_its_tilt(seeded):
    result = seeded.track(pair(1, PATH[1]))
    centred = result.loop[:-1] - result.loop[:-1].mean(axis=0)
    normal = np.linalg.svd(centred)[2][2]
    assert angle_deg(normal, LOOP.normal) < 5.0
