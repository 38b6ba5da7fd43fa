"""Whether the ring from the clicks is a lasso's: its size and its shape.

A loop may be open, overlap itself, rise like a helix and be squeezed by its vein, but it goes round a middle. Clicks on
different things, on a straight catheter, or with a calibration of another scale make a ring that does not.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from lasso_motion_ros.config.catheters import Catheter
from lasso_motion_ros.core.errors import SeedError
from lasso_motion_ros.geometry.frames import PLANES, Seed
from lasso_motion_ros.ring.loop_model import LoopModel

Array = npt.NDArray[np.float64]


@dataclass(frozen=True)
class _Tuning:
    """What is a lasso's shape, what is in doubt, and what is none (docs/constants.md)."""

    doubtful_roundness: float = 0.55  # smallest by largest distance from the middle
    smallest_roundness: float = 0.4
    doubtful_size: float = 0.2  # beside the named catheter's range, as a share of it
    largest_size: float = 0.4
    straight: float = 0.1  # of clicks' spread across their line, of that along it
    one_way: float = 1.3  # of the way from click to click, by the distance spanned: about two round a loop


TUNING = _Tuning()


def require_loop_of_clicks(seed: Seed) -> None:
    """Refuse clicks that lie along one straight line in both planes: a loop seen edge-on goes there and back.

    Raises:
        SeedError: a straight catheter was clicked, or a part of the loop only.
    """
    if all(_is_line(seed.points(plane)) for plane in PLANES):
        raise SeedError(
            "the clicks lie on a straight line in both planes, from one end to the other; expected clicks along the"
            " whole loop, there and back where it is seen edge-on"
        )


def shape_doubt(model: LoopModel, catheter: Catheter | None) -> str:
    """Why the ring's size or shape is in doubt; empty if it is not.

    Args:
        model: the ring from the clicks.
        catheter: that was named, or None.

    Raises:
        SeedError: no lasso has such a shape, or the named catheter has another size.
    """
    roundness = model.roundness
    text = f"the clicks' ring is far from round: nearest by farthest point from its middle {roundness:.2f}"
    if roundness < TUNING.smallest_roundness:
        raise SeedError(f"{text}, expected at least {TUNING.smallest_roundness:g}: were the clicks set along one loop?")
    doubts = [f"{text}, usually {TUNING.doubtful_roundness:g} or more"] if roundness < TUNING.doubtful_roundness else []
    if catheter is not None and catheter.diameter_mm is not None:
        low, high = catheter.diameter_mm
        off = max(low / model.diameter_mm, model.diameter_mm / high) - 1.0
        expected = f"{low:g} mm" if low == high else f"{low:g} to {high:g} mm"
        text = f"the clicks' ring is {model.diameter_mm:.1f} mm across, {catheter.name} {expected}"
        if off > TUNING.largest_size:
            raise SeedError(f"{text}: another catheter, clicks beside it, or a calibration of another scale?")
        if off > TUNING.doubtful_size:
            doubts.append(f"{text}: another catheter?")
    return "; ".join(doubts)


def _is_line(clicks: Array) -> bool:
    """Whether clicks (N, 2) lie along one straight line, one after another."""
    _, spread, directions = np.linalg.svd(clicks - clicks.mean(axis=0), full_matrices=False)
    span = float(np.ptp(clicks @ directions[0]))
    way = float(np.linalg.norm(np.diff(clicks, axis=0), axis=1).sum())
    return bool(spread[1] < TUNING.straight * spread[0] and way < TUNING.one_way * span)
