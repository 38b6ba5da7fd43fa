"""Residual and static error axis by axis, with the constant part and the jitter apart."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from lasso_motion_ros.evaluation.measures import PairScore

Array = npt.NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class AxisErrors:
    """Errors of the loop's centre along the world's axes, over the pairs with a pose, the reference left out.

    Attributes:
        static_mm: (3,) root mean square of the true displacement since the reference: the error without compensation.
        residual_mm: (3,) root mean square of the remaining error.
        constant_mm: (3,) mean of the remaining error.
        jitter_mm: (3,) its standard deviation.
    """

    static_mm: Array
    residual_mm: Array
    constant_mm: Array
    jitter_mm: Array


def displacements_mm(scores: Sequence[PairScore]) -> tuple[Array, Array]:
    """True and published displacement of the loop's centre since the reference, (N, 3) each, mm; NaN if unknown.

    Both are from the true centre in the reference pair.
    """
    true, found = np.full((len(scores), 3), np.nan), np.full((len(scores), 3), np.nan)
    origin = next((s.true_centre_m for s in scores if s.is_reference and s.true_centre_m is not None), None)
    if origin is None:
        return true, found
    for number, score in enumerate(scores):
        if score.true_centre_m is not None:
            true[number] = 1e3 * (score.true_centre_m - origin)
        if score.centre_m is not None:
            found[number] = 1e3 * (score.centre_m - origin)
    return true, found


def residuals_mm(scores: Sequence[PairScore]) -> Array:
    """(N, 3) error of the centre, mm; NaN where there is no pose or no lasso in its place, and in the reference."""
    residual = np.full((len(scores), 3), np.nan)
    for number, score in enumerate(scores):
        if score.centre_error_m is not None and not score.is_reference:
            residual[number] = 1e3 * score.centre_error_m
    return residual


def axis_errors(scores: Sequence[PairScore]) -> AxisErrors | None:
    """The errors of one recording, or None where no pair has any."""
    static, _ = displacements_mm(scores)
    residual = residuals_mm(scores)
    known = np.isfinite(residual).all(axis=1) & np.isfinite(static).all(axis=1)
    if not known.any():
        return None
    static, residual = static[known], residual[known]
    return AxisErrors(
        static_mm=np.sqrt((static**2).mean(axis=0)),
        residual_mm=np.sqrt((residual**2).mean(axis=0)),
        constant_mm=residual.mean(axis=0),
        jitter_mm=residual.std(axis=0),
    )
