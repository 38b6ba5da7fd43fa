"""The working tip: as far from the ring as it is to be, from place to place, at its speed."""

import numpy as np
import pytest

from lasso_motion_ros.geometry.curves import distance_to_curve
from lasso_motion_ros.phantom.catheters import SEPTUM, build_loop
from lasso_motion_ros.phantom.lab_settings import WorkSettings
from lasso_motion_ros.phantom.settings import LassoSettings
from lasso_motion_ros.phantom.working_ablation import WorkingTip

LOOP = build_loop(LassoSettings(centre_mm=(5.0, 0.0, 3.0), normal=(0.3, -0.5, 0.8), turns=0.97, helix_mm=1.0), SEPTUM)
CALM = {"works": True, "bounce_mm": 0.0, "tremor_mm": 0.0}
TIMES = np.arange(0.0, 60.0, 0.05)


def tip(seed: int = 1, **settings: object) -> WorkingTip:
    return WorkingTip(WorkSettings(**(CALM | settings)), LOOP, np.random.default_rng(seed), 60.0)


def path(working: WorkingTip) -> np.ndarray:
    return np.array([working.at(float(time), 0.0)[0] for time in TIMES])


@pytest.mark.parametrize(("nearest", "farthest"), [(0.0, 3.0), (3.0, 12.0), (8.0, 20.0)])
def test_the_tip_is_as_far_from_the_ring_as_asked(nearest: float, farthest: float) -> None:
    working = tip(nearest_mm=nearest, farthest_mm=farthest)
    distances = 1e3 * distance_to_curve(path(working), LOOP.points)
    asked = 1e3 * np.array([working.distance_m(float(time)) for time in TIMES])
    # Over the gap of an open loop it is a little farther from the wire's ends than from where it would close.
    assert distances == pytest.approx(asked, abs=0.35)
    assert asked.min() >= nearest
    assert asked.max() <= farthest
    assert np.ptp(asked) > 0.5 * (farthest - nearest)


def test_it_walks_round_the_ring_and_dwells() -> None:
    working = tip(nearest_mm=1.0, farthest_mm=1.0, speed_mm_s=8.0, dwell_s=3.0, drag_mm_s=0.0)
    places = path(working)
    assert np.ptp(places, axis=0).max() > 8e-3
    speed = 1e3 * np.linalg.norm(np.diff(places, axis=0), axis=1) / 0.05
    # A smooth step is half as fast again in its middle; being 1 mm outside the ring adds a tenth, turning aside more.
    assert speed.max() < 2.5 * 8.0
    still = np.mean(speed < 1e-6)
    assert 0.4 < still < 0.95


def test_it_creeps_while_it_dwells() -> None:
    working = tip(nearest_mm=0.0, farthest_mm=0.0, dwell_s=3.0, speed_mm_s=20.0, drag_mm_s=0.5)
    speed = 1e3 * np.linalg.norm(np.diff(path(working), axis=0), axis=1) / 0.05
    # It dwells most of the time.
    assert np.median(speed) == pytest.approx(0.5, rel=0.05)


def test_tissue_lifts_it_off_in_systole() -> None:
    working = tip(nearest_mm=2.0, farthest_mm=2.0, bounce_mm=1.5)
    for time_s in (0.0, 7.3, 20.0):
        lifted = working.at(time_s, 1.0)[0] - working.at(time_s, 0.0)[0]
        assert np.linalg.norm(lifted) == pytest.approx(1.5e-3)
        far = distance_to_curve(working.at(time_s, 1.0)[0][None], LOOP.points)[0]
        assert far == pytest.approx(3.5e-3, abs=3e-4)


def test_a_hand_is_never_still() -> None:
    calm = tip(nearest_mm=2.0, farthest_mm=2.0, dwell_s=60.0, drag_mm_s=0.0)
    shaky = tip(nearest_mm=2.0, farthest_mm=2.0, dwell_s=60.0, drag_mm_s=0.0, tremor_mm=0.5)
    unrest = 1e3 * (path(shaky) - path(calm))
    # 0.5 mm of two waves, 1 and 0.6 high, shared by three axes.
    assert 0.4 < np.abs(unrest).max() < 0.5 * 1.6 / np.sqrt(3.0) + 1e-9
    assert np.ptp(unrest, axis=0).min() > 0.5


def test_the_same_random_numbers_give_the_same_path() -> None:
    assert np.array_equal(path(tip(4)), path(tip(4)))
    assert not np.array_equal(path(tip(4)), path(tip(5)))
