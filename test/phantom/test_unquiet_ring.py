"""The simulated ring on its seat, and its electrodes on its wire."""

import dataclasses

import numpy as np
import pytest

from lasso_motion_ros.bench.suite.clinic_scenarios import UNQUIET, clinic_scenario
from lasso_motion_ros.core.errors import ScenarioError
from lasso_motion_ros.geometry.curves import arc_length
from lasso_motion_ros.phantom import Simulator
from lasso_motion_ros.phantom.catheters import deformed_loop
from lasso_motion_ros.phantom.motion_incidents import seat_motion
from lasso_motion_ros.phantom.scenario import scenario_from_values
from lasso_motion_ros.phantom.settings import LassoSettings, Scenario

UNQUIET_RING = LassoSettings(seat_mm=0.5, seat_period_s=8.0, seat_direction=(0.0, 3.0, 4.0))


def test_it_goes_to_and_fro_from_where_it_was_in_the_first_pair():
    np.testing.assert_array_equal(seat_motion(UNQUIET_RING, 0.0), 0.0)
    np.testing.assert_allclose(seat_motion(UNQUIET_RING, 2.0), [0.0, 0.3e-3, 0.4e-3])
    np.testing.assert_allclose(seat_motion(UNQUIET_RING, 6.0), [0.0, -0.3e-3, -0.4e-3])
    np.testing.assert_array_equal(seat_motion(LassoSettings(), 2.0), 0.0)


def test_that_is_in_the_truth_of_the_ring_and_not_of_the_atrium():
    still = Scenario(pairs=2, rate_hz=0.5)  # the second pair after 2 s
    quiet, unquiet = (Simulator(dataclasses.replace(still, lasso=one)) for one in (LassoSettings(), UNQUIET_RING))
    np.testing.assert_array_equal(unquiet.motion.atrium(2.0), quiet.motion.atrium(2.0))
    moved = unquiet._loop_in_patient(2.0, 1) - quiet._loop_in_patient(2.0, 1)
    np.testing.assert_allclose(np.linalg.norm(moved, axis=1), 0.5e-3, rtol=1e-6)


@pytest.mark.parametrize("stretch", [-0.03, 0.05])
def test_electrodes_keep_their_distances_where_the_loop_is_widened(stretch):
    simulator = Simulator(Scenario(pairs=1))
    rest = simulator.loop
    loop = deformed_loop(rest, 0.0, stretch)
    poles, at_rest = simulator.lab.poles(loop, 0.0), simulator.lab.poles(rest.points, 0.0)

    def places(points, curve):
        nearest = np.linalg.norm(points[:, None] - curve, axis=2).argmin(axis=1)
        return arc_length(curve)[nearest]

    common = min(len(poles), len(at_rest))
    assert common >= 9  # the one at the shaft may be drawn into it
    spacing_m = 1.1e-3 * (1.0 + abs(stretch))  # between two points of the loop, at most
    np.testing.assert_allclose(places(poles, loop)[:common], places(at_rest, rest.points)[:common], atol=spacing_m)


def test_a_direction_of_no_length_is_refused_by_name():
    with pytest.raises(ScenarioError, match=r"lasso\.seat_direction: expected a vector that is not zero"):
        scenario_from_values({"lasso": {"seat_direction": [0.0, 0.0, 0.0]}})


def test_some_rings_of_the_clinic_suite_are_unquiet():
    sizes = np.array([clinic_scenario(7, index).scenario.lasso.seat_mm for index in range(100)])
    assert abs(np.mean(sizes > 0.0) - UNQUIET) < 0.15
    assert 0.2 <= sizes[sizes > 0.0].min() <= sizes.max() <= 0.8
