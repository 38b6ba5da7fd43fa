"""Whether the same ring was clicked in both planes: one of them must not show it elsewhere more plainly.

Clicks on two different things, or far beside the ring in one plane, make a ring that lies somewhere in space. That
plane shows it better in its true place: in the next pair it would be found there, and the way from here to there
published as motion. (A second lasso shows elsewhere in both planes: whoever clicks may choose between the two.)
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from lasso_motion_ros.core.errors import SeedError
from lasso_motion_ros.geometry.frames import PLANES
from lasso_motion_ros.ring.detection import Detection
from lasso_motion_ros.ring.loop_model import LoopModel

_ELSEWHERE_MM = 2.0  # a pose may be off by so much; of 34 seeds along the ring none was off by more than 0.1
_SAME_MM = 1.0  # half of it: the other plane agrees on where the ring is


def require_clicked_place(detections: Sequence[Detection], model: LoopModel) -> None:
    """Refuse a seed of which one plane shows the ring elsewhere at least as plainly as where it was clicked.

    Args:
        detections: of the seed pair, looked at everywhere, best supported first.
        model: the ring from the clicks.

    Raises:
        SeedError: something else was clicked in one plane.
    """
    if not detections:
        return
    away_mm = {
        plane: 1e3 * float(np.linalg.norm(fit.across @ (fit.centre - model.centre)))
        for plane, fit in detections[0].planes.items()
    }
    plane = max(away_mm, key=lambda name: away_mm[name])
    if len(away_mm) == len(PLANES) and min(away_mm.values()) < _SAME_MM and away_mm[plane] > _ELSEWHERE_MM:
        raise SeedError(
            f"the clicked images show the ring as plainly {away_mm[plane]:.1f} mm aside in plane {plane.upper()}: "
            "was the same loop clicked in both planes?"
        )
