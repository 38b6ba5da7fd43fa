"""Bystanders: their sizes, their places, and that they move with what carries them."""

import numpy as np
import pytest

from lasso_motion_ros.geometry.transforms import rigid
from lasso_motion_ros.phantom.anatomy import build_thorax
from lasso_motion_ros.phantom.catheters import MATERIAL
from lasso_motion_ros.phantom.gantry import true_projection
from lasso_motion_ros.phantom.lab_devices import (
    DEVICE,
    TwinLasso,
    echo_probe,
    pacing_catheter,
    skin_discs,
    star_catheter,
)
from lasso_motion_ros.phantom.lab_settings import BystanderSettings
from lasso_motion_ros.phantom.settings import LassoSettings, Scenario
from lasso_motion_ros.phantom.tubes import Segments, optical_depth

STILL = np.eye(4)
LIFTED = rigid(np.zeros(3), np.array([0.0, 0.0, -0.02]))


def middles(segments: Segments, attenuation: float) -> np.ndarray:
    chosen = np.isclose(segments.attenuation, attenuation)
    return 0.5 * (segments.start[chosen] + segments.end[chosen])


@pytest.mark.parametrize("diameter", [10.0, 14.0])
def test_an_echo_probe_is_wide_and_its_tip_dense(diameter: float) -> None:
    projection = true_projection(Scenario(), "a", 0)
    depth = optical_depth(projection, echo_probe(1e-3 * diameter, STILL, np.zeros(3)), 1)
    row = int(projection.project(np.array([0.009, 0.0365, 0.008]))[1])
    pixel_mm = projection.millimetres_per_pixel(np.array([0.009, 0.0365, 0.008]))
    assert np.count_nonzero(depth[row] > 0.05) * pixel_mm == pytest.approx(diameter, rel=0.12)
    assert depth[row].max() > 1.5
    body = depth[int(projection.project(np.array([0.004, 0.033, 0.05]))[1])]
    assert 0.1 < body.max() < 0.6 * depth[row].max()
    assert np.count_nonzero(body > 0.02) * pixel_mm == pytest.approx(0.8 * diameter, rel=0.12)


def test_an_echo_probe_takes_half_of_the_hearts_motion() -> None:
    still, moved = (echo_probe(12e-3, motion, np.zeros(3)) for motion in (STILL, LIFTED))
    assert moved.end[-1, 2] - still.end[-1, 2] == pytest.approx(-0.01, abs=1.5e-3)


def test_a_star_has_twenty_electrodes_in_pairs() -> None:
    towards = np.array([0.0, 0.6, 0.8])
    star = star_catheter(np.array([0.01, 0.0, 0.01]), towards, STILL)
    poles = middles(star, MATERIAL.ring)
    assert poles.shape == (20, 3)
    gaps = 1e3 * np.linalg.norm(np.diff(poles.reshape(5, 4, 3), axis=1), axis=2)
    assert gaps == pytest.approx(np.tile([2.0, 6.0, 2.0], (5, 1)), abs=0.2)
    reach = 1e3 * np.linalg.norm(poles - [0.01, 0.0, 0.01], axis=1)
    assert 12.0 < reach.max() < 22.0


def test_a_twin_is_of_the_same_kind_elsewhere() -> None:
    lasso = LassoSettings(electrodes=14, diameter_mm=22.0, turns=1.0)
    bystanders = BystanderSettings(twin=True, twin_offset_mm=(0.0, 10.0, -20.0), twin_tilt_deg=30.0)
    twin = TwinLasso(lasso, bystanders, np.random.default_rng(2))
    assert twin.loop.centre == pytest.approx(1e-3 * np.add(lasso.centre_mm, [0.0, 10.0, -20.0]))
    axis = np.array(lasso.normal) / np.linalg.norm(lasso.normal)
    assert np.degrees(np.arccos(abs(axis @ twin.loop.normal))) <= 30.001
    assert len(middles(twin.segments(STILL, STILL), MATERIAL.ring)) == 14
    moved = middles(twin.segments(LIFTED, LIFTED), MATERIAL.ring) - middles(twin.segments(STILL, STILL), MATERIAL.ring)
    assert moved == pytest.approx(np.tile([0.0, 0.0, -0.02], (14, 1)))


def test_a_pacing_catheter_has_four_electrodes_that_the_ventricle_pulls() -> None:
    poles = middles(pacing_catheter(STILL, 0.0), MATERIAL.large_ring)
    pulled = middles(pacing_catheter(STILL, 1.0), MATERIAL.large_ring)
    assert poles.shape == (4, 3)
    assert 1e-3 < np.linalg.norm(pulled[0] - poles[0]) < 6e-3


def test_skin_electrodes_are_seen_near_the_ring_and_lie_on_the_skin() -> None:
    scenario = Scenario()
    projections = [true_projection(scenario, "a", 0), true_projection(scenario, "b", 0)]
    trunk, centre = build_thorax(np.random.default_rng(1)).trunk, np.array([0.012, 0.002, 0.008])
    discs = skin_discs(projections, trunk, centre, 6, np.random.default_rng(5))
    places = middles(discs, DEVICE.snap)
    assert places.shape == (6, 3)
    for place in places:
        seen_mm = [
            np.linalg.norm(p.project(place) - p.project(centre)) * p.millimetres_per_pixel(centre) for p in projections
        ]
        assert min(seen_mm) < 80.0
        local = np.linalg.inv(trunk.axes) @ (place - trunk.centre)
        assert np.hypot(local[0], local[1]) == pytest.approx(1.0, abs=0.06)
    assert np.any(np.isclose(discs.attenuation, DEVICE.lead))
