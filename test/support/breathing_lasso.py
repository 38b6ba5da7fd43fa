"""A drawn lasso that breathes, a tracker that has followed it for a breath and a half, and how far off an answer is."""

from functools import cache

import numpy as np
from support.lasso_inputs import LOOP, PERIOD_NS, lasso_pair, lasso_seed

from lasso_motion_ros.config.tracker import TrackerConfig
from lasso_motion_ros.geometry.transforms import apply
from lasso_motion_ros.ring.tracker import RingTracker
from lasso_motion_ros.tracking.tracker import TrackerState

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
    tracker = RingTracker(CONFIG)
    results = [tracker.initialise(pair(0), lasso_seed())]
    results += [tracker.track(pair(index)) for index in range(1, WARM)]
    return tracker, tuple(results)


def centre_error_mm(result, translation, reference=(0.0, 0.0, 0.0)):
    found = apply(result.motion, LOOP.centre + reference)
    return 1e3 * np.linalg.norm(found - (LOOP.centre + translation))


def assert_no_pose(result, state):
    assert result.state is state
    assert result.motion is None
    assert result.covariance is None
    assert result.reason != ""
