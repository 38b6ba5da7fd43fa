"""What is published does not depend on the clicks: few or many, two pixels beside the loop, the poses are the same."""

import numpy as np
from support.breathing_lasso import CONFIG, centre_error_mm, moved, pair
from support.lasso_inputs import CURVE, VIEWS

from lasso_motion_ros.geometry.frames import Seed
from lasso_motion_ros.ring.tracker import RingTracker

PAIRS, SETS = 6, 4
SAME_MM = 0.1


def clicks(random):
    """6 to 14 clicks a plane, each plane's own, two pixels beside the loop."""
    planes = []
    for plane in "ab":
        count = int(random.integers(6, 15))
        at = np.linspace(0, len(CURVE) - 1, count).astype(int)
        planes.append(VIEWS[plane].project(CURVE[at]) + random.normal(scale=2.0, size=(count, 2)))
    return Seed(*planes)


def test_any_set_of_clicks_gives_the_same_poses():
    random, ends = np.random.default_rng(7), []
    for _ in range(SETS):
        tracker = RingTracker(CONFIG)
        tracker.initialise(pair(0), clicks(random))
        results = [tracker.track(pair(index)) for index in range(1, PAIRS)]
        assert all(result.motion is not None for result in results), [result.reason for result in results]
        assert max(centre_error_mm(result, moved(index)) for index, result in enumerate(results, 1)) < 0.3
        ends.append([(result.motion @ [*CURVE.mean(axis=0), 1.0])[:3] for result in results])
    places = np.array(ends)  # (SETS, PAIRS - 1, 3) metres
    apart_mm = 1e3 * np.linalg.norm(places - np.median(places, axis=0), axis=2)
    assert apart_mm.max() < SAME_MM, apart_mm.max()
