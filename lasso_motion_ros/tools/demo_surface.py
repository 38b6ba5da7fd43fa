"""The surface of the demonstrations: a left atrium made up to fit a recording's truth."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from lasso_motion_ros.core.errors import RecordingError
from lasso_motion_ros.evaluation.measures import Truth
from lasso_motion_ros.evaluation.recorded_input import read_truth
from lasso_motion_ros.overlay.atrium import atrium_at_ostium, left_atrium_surface
from lasso_motion_ros.overlay.surface_files import write_stl
from lasso_motion_ros.overlay.triangle_mesh import TriangleMesh


def truth_if_any(recording: Path) -> Truth | None:
    """A recording's truth; None where it has none."""
    try:
        return read_truth(recording).truth
    except RecordingError:
        return None


def demo_surface(truth: Truth | None) -> TriangleMesh:
    """A left atrium with the lasso in the ostium of a vein; at the world's origin where there is no truth."""
    if truth is None or truth.loop is None:
        return left_atrium_surface()
    centre = truth.loop.mean(axis=0)
    _, _, axes = np.linalg.svd(truth.loop - centre)
    radius = float(np.linalg.norm(truth.loop - centre, axis=1).mean())
    return atrium_at_ostium(centre, axes[2], 2.0 * radius)


def write_demo_surface(recording: Path, path: Path) -> None:
    """Write the surface that fits a recording (see `demo_surface`) as STL, millimetres.

    Raises:
        SurfaceError: the file cannot be written.
    """
    write_stl(path, demo_surface(truth_if_any(recording)), "mm")
