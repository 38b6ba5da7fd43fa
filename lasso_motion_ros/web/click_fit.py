"""The ellipse through the clicks of one plane, and how far they lie off it: shown before the clicks are sent."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from lasso_motion_ros.core.errors import EllipseError
from lasso_motion_ros.geometry.curves import distance_to_curve
from lasso_motion_ros.geometry.ellipse import fit_ellipse

Array = npt.NDArray[np.float64]


@dataclass(frozen=True)
class _Tuning:
    """How the ellipse is drawn and judged.

    Attributes:
        points: of the polygon that is drawn.
        doubtful: a mean distance of the clicks above this share of the semi-major axis is called out. Careless clicks
            on an ellipse stay below 0.03; one of eight to twenty that is off by half the ring lies above 0.048.
    """

    points: int = 96
    doubtful: float = 0.04


TUNING = _Tuning()


def fit_clicks(points: Array, mm_per_px: float | None) -> dict[str, Any]:
    """The ellipse through clicks (N, 2), pixels, ready for JSON.

    Args:
        points: the clicks.
        mm_per_px: scale at the loop, as far as it is known.

    Returns:
        `clicks`: how many; `ellipse`: the polygon to draw, or None where no ellipse is determined; `off`: the clicks'
        mean distance from it, in words; `doubtful`: whether that is much.
    """
    answer: dict[str, Any] = {"clicks": len(points), "ellipse": None, "off": "", "doubtful": False}
    try:
        ellipse = fit_ellipse(points)
    except EllipseError:
        return answer  # too few as yet, or a loop that is seen edge-on
    polygon = ellipse.points(TUNING.points)
    closed = np.vstack([polygon, polygon[:1]])
    if not np.all(np.isfinite(closed)):
        return answer
    off_px = float(distance_to_curve(points, closed).mean())
    size = f"{off_px:.1f} px" if mm_per_px is None else f"{off_px * mm_per_px:.1f} mm"
    doubtful = off_px > TUNING.doubtful * float(np.linalg.norm(ellipse.semi_major))
    return {**answer, "ellipse": np.round(closed, 1).tolist(), "off": size, "doubtful": doubtful}
