"""Pairs on their grid, and planes that have too little in common for one."""

from __future__ import annotations

import numpy as np
import pytest
from support.lasso_inputs import CURVE, lasso_pair
from support.tracking_inputs import VIEWS

from lasso_motion_ros.core.errors import GeometryError
from lasso_motion_ros.geometry.frames import Frame, FramePair
from lasso_motion_ros.initialisation.laid_pair import LaidPair


def test_planes_with_little_in_common_are_said_to_have() -> None:
    strips = {
        "a": VIEWS["a"].read_out(0, 0, 512, 40, 1, 1),
        "b": VIEWS["b"].read_out(0, 460, 512, 40, 1, 1),
    }
    frames = {plane: Frame(0, np.zeros((40, 512), np.uint8), view) for plane, view in strips.items()}
    with pytest.raises(GeometryError, match="mm of height in common"):
        LaidPair.of(FramePair(0, frames["a"], frames["b"]), bright=False)


def test_a_pair_s_points_lie_on_its_ring() -> None:
    points = LaidPair.of(lasso_pair(0), bright=False).points
    strong = points.places[points.strengths > 2.5]
    assert np.linalg.norm(strong[:, None] - CURVE, axis=2).min(axis=1).min() < 0.5e-3
