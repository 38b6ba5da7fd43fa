"""What noise hides: the loop is told from it by what this dose allows, and by where breathing can have taken it."""

import copy

import numpy as np
import pytest
from support.lasso_inputs import CURVE, LOOP, PERIOD_NS, VIEWS, lasso_image, lasso_pair, lasso_seed, noisy, pair_of

from lasso_motion_ros.config.tracker import TrackerConfig
from lasso_motion_ros.geometry.frames import Frame, FramePair
from lasso_motion_ros.geometry.transforms import apply
from lasso_motion_ros.ring.tracker import RingTracker
from lasso_motion_ros.tracking.tracker import TrackerState

TRACKING, LOST, DISPLACED = TrackerState.TRACKING, TrackerState.LOST, TrackerState.DISPLACED
ASIDE = np.array([0.020, 0.012, 0.009])  # 25 mm, away from the breathing's axis
HARD_NOISE = 110.0  # three times the wire's depth
WARM = 14


def moved(index):
    """(3,) metres, 12 mm of breathing in twelve pairs."""
    return np.round(6e-3 * (1.0 - np.cos(np.pi * index / 6.0)) * np.array([0.08, -0.25, -0.965]), 6)


def tracked(sigma, start=0, pairs=WARM):
    """A tracker after some pairs, and what it answered; another `start` is other noise."""
    tracker = RingTracker(TrackerConfig())
    results = [tracker.initialise(lasso_pair(start, moved(0), sigma=sigma), lasso_seed())]
    results += [tracker.track(lasso_pair(start + i, moved(i), sigma=sigma)) for i in range(1, pairs)]
    return tracker, results


def drawn(index, curves, sigma=5.0):
    """A pair that shows each of the curves."""
    images = {}
    for name in "ab":
        empty = lasso_image(CURVE + 10.0, VIEWS[name]).astype(float)
        images[name] = empty + sum(lasso_image(curve, VIEWS[name]) - empty for curve in curves)
    return pair_of(index, images, sigma=sigma)


@pytest.mark.parametrize("start", [0, 100])
def test_a_loop_that_noise_nearly_hides_is_followed_from_the_first_pair_on(start):
    tracker, results = tracked(HARD_NOISE, start, pairs=9)
    # A pair or two may show too little; what is published is right.
    posed = [(index, result) for index, result in enumerate(results[1:], start=1) if result.motion is not None]
    assert len(posed) >= 4
    for index, result in posed:
        assert 1e3 * np.linalg.norm(apply(result.motion, LOOP.centre) - LOOP.centre - moved(index)) < 1.5
    # Noise itself is not taken for it.
    for index in range(9, 15):
        assert tracker.track(lasso_pair(start + index, None, sigma=HARD_NOISE)).state is LOST


def test_in_noise_that_hides_most_of_it_a_moved_lasso_is_displaced_and_its_return_is_seen():
    tracker, _ = tracked(5.0)
    tracker.track(lasso_pair(WARM, None))
    for index, states in ((WARM + 1, (LOST, DISPLACED)), (WARM + 2, (DISPLACED,))):
        result = tracker.track(drawn(index, [CURVE + moved(index) + ASIDE], sigma=60.0))
        assert result.state in states
        assert result.motion is None
    tracker.track(lasso_pair(WARM + 3, None))
    states = [tracker.track(lasso_pair(i, moved(i))).state for i in range(WARM + 4, WARM + 7)]
    assert states[-1] is TRACKING
    clear = drawn(WARM + 7, [CURVE + moved(WARM + 7) + ASIDE])
    assert tracker.track(clear).state is DISPLACED


@pytest.mark.slow
def test_of_two_that_look_alike_none_is_published_unless_it_is_the_one_that_breathes():
    for start in range(4):
        tracker, _ = tracked(5.0)
        index = WARM + start
        for gone in range(WARM, index + 1):
            tracker.track(lasso_pair(gone, None))  # now it is looked for everywhere
        here = CURVE + moved(index + 1)
        result = tracker.track(drawn(index + 1, [here, here + ASIDE]))
        if result.motion is None:
            assert "other places" in result.reason or "its place is known to" in result.reason
        else:
            assert 1e3 * np.linalg.norm(apply(result.motion, LOOP.centre) - LOOP.centre - moved(index + 1)) < 0.5


def test_of_two_in_one_plane_the_one_that_agrees_with_the_other_plane_is_the_lasso():
    # Along plane B's ray, so that B cannot tell them apart, and 1.2 mm off plane A's epipolar plane.
    ray = LOOP.centre - VIEWS["b"].source
    ray /= np.linalg.norm(ray)
    off = np.cross(ray, LOOP.centre - VIEWS["a"].source)
    twin = 9e-3 * ray + 1.2e-3 * off / np.linalg.norm(off)
    before, _ = tracked(5.0)
    here = CURVE + moved(WARM)
    for seed in range(6):
        tracker = copy.deepcopy(before)
        stamp_ns = WARM * PERIOD_NS
        a = two_curves("a", here, here + twin, seed)
        result = tracker.track(FramePair(stamp_ns, a, drawn(WARM, [here]).b))
        assert result.motion is not None, result.reason
        assert 1e3 * np.linalg.norm(apply(result.motion, LOOP.centre) - LOOP.centre - moved(WARM)) < 0.5


def two_curves(name, first, second, seed):
    """A frame with two loops, of which the second stands out a little more."""
    empty = lasso_image(CURVE + 10.0, VIEWS[name]).astype(float)
    image = empty + lasso_image(first, VIEWS[name]) - empty + 1.1 * (lasso_image(second, VIEWS[name]) - empty)
    return Frame(WARM * PERIOD_NS, noisy(image, [seed, 5], 12.0), VIEWS[name])
