"""Sweeps: one property varies, all else stays."""

import dataclasses

import numpy as np
import pytest
from support.suite_inputs import score

from lasso_motion_ros.bench.suite.suite_measures import Measures, measures
from lasso_motion_ros.bench.suite.sweeps import SWEEPS, TUNING, capture_range, sweep_scenarios
from lasso_motion_ros.phantom import Simulator


def test_a_sweep_varies_one_property_of_the_same_sequences() -> None:
    for sweep in SWEEPS.values():
        scenarios = sweep_scenarios(sweep, 5, 2)
        assert tuple(scenarios) == sweep.values
        first, last = scenarios[sweep.values[0]], scenarios[sweep.values[-1]]
        assert len(first) == len(last) == 2 * sweep.trials
        still = [[dataclasses.replace(one.lasso, tilt_deg=0.0) for one in some] for some in (first, last)]
        assert still[0] == still[1]
        assert [one.seed for one in first] == [one.seed for one in last]
        assert first != last
    assert [one.imaging.quanta for one in sweep_scenarios(SWEEPS["quanta"], 5, 2)[5.0]] == [5.0, 5.0]
    assert [one.lasso.tilt_deg for one in sweep_scenarios(SWEEPS["tilt"], 5, 2)[8.0]] == [8.0, 8.0]
    assert [one.ablation_work.nearest_mm for one in sweep_scenarios(SWEEPS["tip"], 5, 2)[3.0]] == [3.0, 3.0]
    late = sweep_scenarios(SWEEPS["heart_late"], 5, 1)[5.0][0]
    assert (late.heart.amplitude_mm, late.plane_b_offset) == (5.0, 0.5)
    ways = {one.heart.direction for one in sweep_scenarios(SWEEPS["heart_late"], 5, 4)[2.0]}
    assert len(ways) == 4  # of which plane A's depth hangs
    wide = sweep_scenarios(SWEEPS["separation"], 5, 1)[40.0][0].geometry
    assert wide.plane_b.lao_deg - wide.plane_a.lao_deg == pytest.approx(40.0)
    assert sweep_scenarios(SWEEPS["rate"], 5, 1)[15.0][0].pairs == 60


def test_an_offset_start_is_a_breath_in_a_pause() -> None:
    scenarios = sweep_scenarios(SWEEPS["start"], 5, 1)
    assert len(scenarios[25.0]) == TUNING.start_trials
    directions = []
    for value in (0.0, 10.0, 25.0):
        simulator = Simulator(scenarios[value][2])
        assert simulator.time_s(1, "a") == TUNING.start_pause_s
        offset = simulator.motion.atrium(TUNING.start_pause_s)[:3, 3]
        assert 1e3 * np.linalg.norm(offset) == pytest.approx(value, abs=1e-6)
        directions.append(offset)
    np.testing.assert_allclose(directions[2], 2.5 * directions[1], atol=1e-9)


def test_the_capture_range_ends_before_the_first_failure() -> None:
    def trials(captured: int) -> Measures:
        off = np.array([0.005, 0.0, 0.0])
        return measures(
            [score(0), *(score(n + 1) for n in range(captured))]
            + [score(n + 1, centre_error_m=off) for n in range(captured, 20)]
        )

    assert capture_range({0.0: trials(20), 5.0: trials(19), 10.0: trials(18), 20.0: trials(20)}) == 5.0
    assert capture_range({0.0: trials(10), 5.0: trials(20)}) is None
