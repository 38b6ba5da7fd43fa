"""Directions in space: axes across a direction."""

from __future__ import annotations

import numpy as np

from lasso_motion_ros.geometry.directions import reflected_axes


def test_reflected_axes_are_those_of_an_svd() -> None:
    units = np.random.default_rng(0).normal(size=(200, 3))
    units /= np.linalg.norm(units, axis=1, keepdims=True)
    units[:6] = [[1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1]]
    axes = reflected_axes(units)
    frames = np.concatenate([units[:, None], axes], axis=1)
    np.testing.assert_allclose(frames @ frames.swapaxes(1, 2), np.broadcast_to(np.eye(3), (200, 3, 3)), atol=1e-15)
    np.testing.assert_allclose(axes, np.linalg.svd(units[:, None])[2][:, 1:], atol=1e-14)
