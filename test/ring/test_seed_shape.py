"""The ring from the clicks: refused where no lasso has its size and shape, in doubt where few have."""

import dataclasses

import numpy as np
import pytest
from support.breathing_lasso import CONFIG, DEGRADED, TRACKING, moved
from support.lasso_inputs import LOOP, VIEWS, curve_pair, lasso_pair, lasso_seed

from lasso_motion_ros.config.catheters import catalogue
from lasso_motion_ros.core.errors import SeedError
from lasso_motion_ros.geometry.frames import Seed
from lasso_motion_ros.ring.loop_model import LoopModel
from lasso_motion_ros.ring.seed_shape import require_loop_of_clicks, shape_doubt
from lasso_motion_ros.ring.tracker import RingTracker


def model(aspect=1.0, turns=1.0, diameter_mm=20.0):
    """A ring of a diameter and an aspect, about its middle."""
    angle = 2.0 * np.pi * np.linspace(0.0, turns, 120)
    arms = 0.5e-3 * diameter_mm * np.column_stack([np.cos(angle), aspect * np.sin(angle), 0.05 * angle / 6.0])
    nothing = np.zeros(3)
    return LoopModel(arms + LOOP.centre, LOOP.centre, False, {}, None, (nothing, nothing), nothing)


@pytest.mark.parametrize("turns", [0.7, 0.85, 1.0, 1.25])
@pytest.mark.parametrize("aspect", [1.0, 0.7])
def test_open_overlapping_and_squeezed_loops_are_lassos(aspect, turns):
    assert shape_doubt(model(aspect, turns), None) == ""


def test_a_ring_far_from_round_is_in_doubt_and_then_refused():
    assert "far from round: nearest by farthest point from its middle 0.48" in shape_doubt(model(0.48), None)
    with pytest.raises(SeedError, match=r"middle 0\.30, expected at least 0\.4"):
        shape_doubt(model(0.30), None)


def test_the_named_catheters_size_is_asked_for():
    entry = catalogue()["achieve_20"]
    assert shape_doubt(model(diameter_mm=18.0), entry) == ""
    assert shape_doubt(model(diameter_mm=26.0), entry).startswith(
        "the clicks' ring is 26.0 mm across, achieve_20 20 mm"
    )
    for off_mm in (12.0, 30.0):
        with pytest.raises(SeedError, match=rf"{off_mm:.1f} mm across, achieve_20 20 mm: another catheter"):
            shape_doubt(model(diameter_mm=off_mm), entry)
    variable = dataclasses.replace(entry, name="variable", diameter_mm=(15.0, 25.0))
    assert shape_doubt(model(diameter_mm=26.0), variable) == ""
    with pytest.raises(SeedError, match="variable 15 to 25 mm"):
        shape_doubt(model(diameter_mm=36.0), variable)


def test_six_clicks_along_a_straight_catheter_are_refused_in_both_planes():
    line = LOOP.centre + np.linspace(-0.011, 0.011, 400)[:, None] * np.array([0.3, 0.2, 0.93])
    noise = np.random.default_rng(0).normal(scale=0.7, size=(2, 6, 2))
    at = np.linspace(0, 399, 6).astype(int)
    clicks = [VIEWS[plane].project(line[at]) + noise[k] for k, plane in enumerate("ab")]
    with pytest.raises(SeedError, match="straight line in both planes"):
        RingTracker(CONFIG).initialise(curve_pair(0, line), Seed(*clicks))


def test_a_loop_seen_edge_on_is_clicked_there_and_back():
    there = np.column_stack([np.linspace(0.0, 80.0, 6), np.zeros(6)])
    edge_on = np.concatenate([there, there[::-1] + np.array([0.0, 2.0])])
    require_loop_of_clicks(Seed(edge_on, edge_on))
    with pytest.raises(SeedError):
        require_loop_of_clicks(Seed(there, there))
    # In one plane alone a part of the loop may do.
    ring = 40.0 * np.column_stack([np.cos(np.arange(8.0)), np.sin(np.arange(8.0))])
    require_loop_of_clicks(Seed(there, ring))


@pytest.mark.slow
def test_a_doubt_about_the_size_stays_with_every_pose():
    plain, named = RingTracker(CONFIG), RingTracker(dataclasses.replace(CONFIG, catheter="pulseselect"))
    assert plain.initialise(lasso_pair(0, moved(0)), lasso_seed()).state is TRACKING
    for result in (named.initialise(lasso_pair(0, moved(0)), lasso_seed()), named.track(lasso_pair(1, moved(1)))):
        assert result.state is DEGRADED
        assert "mm across, pulseselect 25 mm" in result.reason
