"""Traps of the lab: each holds the fault that it is named after."""

import numpy as np
import pytest

from lasso_motion_ros.bench.suite.place_truth import seed_gap_mm
from lasso_motion_ros.bench.suite.random_scenarios import edge_on_deg
from lasso_motion_ros.bench.suite.traps import TRAPS, trap_scenarios
from lasso_motion_ros.phantom import Simulator, scenario_motion
from lasso_motion_ros.phantom.settings import Scenario

LAB = list(TRAPS)[list(TRAPS).index("tip_at_ring") :]


def scenarios(name: str) -> tuple[Scenario, ...]:
    return trap_scenarios(TRAPS[name], 5)


def test_all_are_judged_by_the_rings_own_displacement() -> None:
    assert len(LAB) == 16
    for name in LAB:
        assert all(scenario.exact_place for scenario in scenarios(name))
    assert not any(scenario.exact_place for scenario in scenarios("slip"))


def test_a_tip_is_at_the_ring_in_the_seed_pair() -> None:
    for name in ("tip_at_ring", "tip_on_line", "narrow"):
        for scenario in scenarios(name):
            assert scenario.ablation_work.works
            assert scenario.distractors.ablation
            assert scenario.ablation_work.nearest_mm <= 1.0
    assert all(min(edge_on_deg(one, plane) for plane in range(2)) < 7.0 for one in scenarios("tip_on_line"))
    for one in scenarios("narrow"):
        assert 3.0 < min(edge_on_deg(one, plane) for plane in range(2)) < 22.0


def test_cough_apnoea_and_sigh_are_in_this_order() -> None:
    for scenario in scenarios("cough_apnoea_sigh"):
        breathing = scenario_motion(scenario).breathing
        times = np.arange(0.0, scenario.pairs / scenario.rate_hz, 0.05)
        path = np.array([breathing.displacement(float(time)) for time in times])
        along = 1e3 * path @ np.array(scenario.breathing.direction) / np.linalg.norm(scenario.breathing.direction)
        assert times[np.argmin(along)] == pytest.approx(3.65, abs=0.15)
        assert along.min() < -9.0
        assert along.max() == pytest.approx(29.0, abs=0.5)
        still = np.linalg.norm(np.diff(path, axis=0), axis=1) < 1e-5
        assert np.count_nonzero(still) * 0.05 > 9.5
        assert times[np.argmax(along)] > 19.0


def test_rates_and_sizes() -> None:
    assert [one.incidents[0].amount for one in scenarios("slide")] == [0.55, 0.3, 1.0]
    for one in scenarios("slide"):
        slid = Simulator(one).lab.off_place((one.pairs - 1) / one.rate_hz)
        assert np.linalg.norm(slid) > 5e-3
    for one in scenarios("far_jump"):
        assert np.linalg.norm(one.events[0].shift_mm) == pytest.approx(24.0)
        assert one.pairs - one.events[0].end > 12
    assert [one.imaging.lag for one in scenarios("filtered")] == [0.5, 0.4, 0.33]
    assert [one.incidents[0].duration_s for one in scenarios("plane_off")] == [4.0, 10.0, 20.0]
    assert {one.incidents[0].plane for one in scenarios("plane_off")} == {"a", "b"}
    for one in scenarios("plane_off"):
        assert one.pairs / one.rate_hz > one.incidents[0].start_s + one.incidents[0].duration_s + 2.0
    for one in scenarios("fibrillation"):
        assert one.plane_b_offset == 0.5
        assert one.heart.strength_spread > 0.3
    for one in scenarios("drops"):
        assert len(one.events) == 5


def test_a_twin_comes_to_lie_where_the_ring_was() -> None:
    for one in scenarios("twin"):
        way = np.array(one.breathing.direction) / np.linalg.norm(one.breathing.direction)
        at_depth = np.array(one.bystanders.twin_offset_mm) + 22.0 * way
        assert np.linalg.norm(at_depth) == pytest.approx(6.0)
        assert one.breathing.amplitude_mm > 22.0


def test_calibrations_are_gross() -> None:
    gaps = [seed_gap_mm(one) for one in scenarios("calibration")]
    assert max(gaps) > 2.0
    assert [one.calibration_error.swapped for one in scenarios("calibration")] == [False, False, False, True]
