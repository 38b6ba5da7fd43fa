"""Model of the published method: which of the candidate ellipses is the loop."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from lasso_motion_ros.config.brost2009 import ModelConfig
from lasso_motion_ros.core.errors import ReconstructionError
from lasso_motion_ros.geometry.frames import PLANES, Plane
from lasso_motion_ros.geometry.projection import Projection
from lasso_motion_ros.seeding.reconstruction import Candidate, Reconstruction, reconstruct_ellipse

Array = npt.NDArray[np.float64]


def reconstruct_model(
    projections: dict[Plane, Projection], outlines: dict[Plane, Array], config: ModelConfig
) -> Candidate:
    """The loop's 3-D ellipse from its two outlines.

    Args:
        projections: world metres to pixels, per plane.
        outlines: (N, 2) pixels along the loop, per plane, N ≥ 6.
        config: which candidate is taken.

    Raises:
        ReconstructionError: no 3-D ellipse explains the outlines, or none of the kind that the paper takes.
    """
    reconstruction = reconstruct_ellipse(projections, outlines)
    if config.candidate == "likely":
        return reconstruction.chosen
    edge_on = tuple(plane for plane in PLANES if spread_ratio(outlines[plane]) < config.edge_on_ratio)
    return most_circular(reconstruction, edge_on)


def most_circular(reconstruction: Reconstruction, edge_on: tuple[Plane, ...]) -> Candidate:
    """The most circular candidate that takes the loop as a line in just the planes in which it is edge-on.

    Raises:
        ReconstructionError: there is none.
    """
    fitting = [candidate for candidate in reconstruction.candidates if candidate.edge_on == edge_on]
    if not fitting:
        seen = (
            f"edge-on in plane {' and '.join(plane.upper() for plane in edge_on)}"
            if edge_on
            else "edge-on in neither plane"
        )
        raise ReconstructionError(f"no 3-D ellipse explains the two outlines of a loop {seen}")
    return max(fitting, key=lambda candidate: candidate.ellipse.circularity)


def spread_ratio(outline: Array) -> float:
    """Spread of points (N, 2) across their principal axis by that along it: 0 on a line, 1 round a circle.

    The matrix of the points' first- and second-order moments, which the paper tests for being ill-conditioned, has
    about the inverse square of it as condition number, in coordinates centred and scaled to the points.
    """
    along, across = np.linalg.svd(outline - outline.mean(axis=0), compute_uv=False)
    return float(across / along)
