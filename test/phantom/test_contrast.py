"""Contrast agent: how it comes and goes, where, and that it moves with the heart."""

import numpy as np
import pytest

from lasso_motion_ros.geometry.transforms import rigid
from lasso_motion_ros.phantom.catheters import SEPTUM, build_loop
from lasso_motion_ros.phantom.contrast import (
    FLOW,
    concentration,
    contrast_depth,
    coronary_tree,
    vein_tree,
)
from lasso_motion_ros.phantom.gantry import true_projection
from lasso_motion_ros.phantom.lab_settings import Incident
from lasso_motion_ros.phantom.settings import GeometrySettings, LassoSettings, Scenario

LOOP = build_loop(LassoSettings(), SEPTUM)
PROJECTION = true_projection(Scenario(geometry=GeometrySettings(size_px=256)), "a", 0)
TREES = {"vein": vein_tree(LOOP, np.random.default_rng(1)), "coronary": coronary_tree(np.eye(4))}


def depth(
    time_s: float, vessel: str = "vein", motion: np.ndarray | None = None, contraction: float = 0.0
) -> np.ndarray:
    injection = Incident("contrast", 2.0, 1.5, amount=60.0, vessel=vessel)
    motion = np.eye(4) if motion is None else motion
    return contrast_depth(PROJECTION, TREES, [injection], time_s, motion, contraction)


def test_it_rises_stays_and_is_washed_out() -> None:
    injection = Incident("contrast", 2.0, 3.0, amount=60.0)
    seconds = np.array([-1.0, 0.0, FLOW.rise_s, 3.0, 3.0 + FLOW.washout_s])
    risen = 1.0 - np.exp(-np.array([3.0, 3.0 + FLOW.washout_s]) / FLOW.rise_s)
    expected = [0.0, 0.0, 1.0 - np.exp(-1.0), risen[0], risen[1] * np.exp(-1.0)]
    assert concentration(injection, seconds) == pytest.approx(expected)


def test_the_picture_shows_it_in_between_only() -> None:
    assert depth(1.9).max() == 0.0
    assert depth(3.4).max() > 0.25
    assert depth(14.0).max() < 0.01


def test_its_front_takes_time() -> None:
    tree = TREES["vein"]
    assert tree.distance.max() > 0.06
    filled = [np.count_nonzero(depth(2.0 + seconds) > 0.05) for seconds in (0.15, 0.4, 1.2)]
    assert filled[0] < filled[1] < filled[2]
    assert tree.distance.max() > 0.4 * FLOW.front_m_s


def test_the_vein_goes_on_from_the_ring_away_from_the_septum() -> None:
    trunk = TREES["vein"].distance < 0.02
    along = (TREES["vein"].end[trunk] - LOOP.centre) @ LOOP.normal
    assert along.min() < -0.015
    across = np.linalg.norm(
        TREES["vein"].start[0] - LOOP.centre - ((TREES["vein"].start[0] - LOOP.centre) @ LOOP.normal) * LOOP.normal
    )
    assert across < 1e-6
    assert 2 * TREES["vein"].radius[0] < 1e-3 * LassoSettings().diameter_mm


def test_it_moves_with_the_heart_and_the_coronary_with_the_beat() -> None:
    def centroid(image: np.ndarray) -> np.ndarray:
        rows, columns = np.indices(image.shape)
        return np.array([(image * columns).sum(), (image * rows).sum()]) / image.sum()

    lowered = rigid(np.zeros(3), np.array([0.0, 0.0, -0.01]))
    fallen = centroid(depth(3.0, motion=lowered)) - centroid(depth(3.0))
    pixel_mm = PROJECTION.millimetres_per_pixel(LOOP.centre)
    assert 5.0 < fallen[1] * pixel_mm < 10.5  # distal branches take less of it
    beaten = centroid(depth(3.0, "coronary", contraction=1.0)) - centroid(depth(3.0, "coronary"))
    assert np.linalg.norm(beaten) * pixel_mm > 1.0
