"""How far the loop reaches: where on its ellipse each outline point lies, and the gap of an open loop."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from numpy.lib.stride_tricks import sliding_window_view

from lasso_motion_ros.core.compiled import has_kernels
from lasso_motion_ros.geometry.curves import resample
from lasso_motion_ros.geometry.frames import PLANES, Plane
from lasso_motion_ros.geometry.projection import Projection
from lasso_motion_ros.seeding.cones import Ellipse3D

Array = npt.NDArray[np.float64]

TURN = 2.0 * np.pi


@dataclass(frozen=True)
class _Tuning:
    """How outlines are laid along their ellipse; a turn is once round it.

    Attributes:
        angles_per_turn: angles that an outline's points may take.
        largest_step_turns: from one outline point to the next.
        outline_points: points that stand for an outline.
        smallest_overlap_turns: a loop overlaps itself where it was clicked past its start by this much.
        largest_turns: a loop of more turns does not exist: its outlines were started at opposite ends.
        smallest_gap_turns: a loop is open where the outlines leave this much uncovered.
    """

    angles_per_turn: int = 96
    largest_step_turns: float = 0.125
    outline_points: int = 90
    smallest_overlap_turns: float = 0.06
    largest_turns: float = 1.35
    smallest_gap_turns: float = 0.05


TUNING = _Tuning()


class LoopOutline:
    """Both planes' outlines, each point with its eccentric angle on one ellipse.

    Args:
        ellipse: the loop's, world metres.
        projections: world metres to pixels, per plane.
        paths: (N, 2) pixels along the loop, per plane.
    """

    def __init__(self, ellipse: Ellipse3D, projections: dict[Plane, Projection], paths: dict[Plane, Array]) -> None:
        self._points = {plane: resample(paths[plane], TUNING.outline_points) for plane in PLANES}
        a, b = _monotone_angles([self._points[plane] for plane in PLANES], ellipse, [projections[p] for p in PLANES])
        # The same angle plus a whole turn is the same place on the ellipse: bring both ranges together.
        b = b + TURN * np.round((a.mean() - b.mean()) / TURN)
        self._angles: dict[Plane, Array] = {"a": a, "b": b}

    @property
    def extent(self) -> tuple[float, float]:
        """The eccentric angles of the loop's ends: a whole turn, or more where it was clicked past its start."""
        a, b = self._angles["a"], self._angles["b"]
        spans = {"a": float(np.ptp(a)), "b": float(np.ptp(b))}
        if max(spans.values()) <= TURN * (1.0 + TUNING.smallest_overlap_turns):
            return float(a.min()), float(a.min()) + TURN
        low, high = min(a.min(), b.min()), max(a.max(), b.max())
        if high - low > TURN * TUNING.largest_turns:  # started at opposite ends: trust the longer outline
            longer = a if spans["a"] >= spans["b"] else b
            low, high = longer.min(), longer.max()
        return float(low), float(high)

    @property
    def gap(self) -> tuple[float, float] | None:
        """The largest range of angles that neither outline covers, above plane A's; None where it is next to nothing.

        An open loop has one; so has a closed one that was clicked in both planes from about the same place.
        """
        a, b = self._angles["a"], self._angles["b"]
        low, high = float(a.max()), float(a.min()) + TURN
        for whole in (-TURN, 0.0, TURN):
            first, last = float(b.min()) + whole, float(b.max()) + whole
            if first >= high or last <= low:
                continue
            # What plane B covers leaves the longer of the two sides.
            low, high = max(((low, first), (last, high)), key=lambda side: side[1] - side[0])
        return (low, high) if high - low > TUNING.smallest_gap_turns * TURN else None

    def at(self, angles: Array) -> dict[Plane, Array]:
        """Per plane, (N, 2) outline pixels at eccentric angles (N,); NaN where that plane's outline does not reach."""
        found: dict[Plane, Array] = {}
        for plane in PLANES:
            order = np.argsort(self._angles[plane], kind="stable")
            outline, own = self._points[plane][order], self._angles[plane][order]
            values = np.full((len(angles), 2), np.nan)
            for whole in (-TURN, 0.0, TURN):
                inside = (angles >= own[0] + whole) & (angles <= own[-1] + whole) & np.isnan(values[:, 0])
                for axis in range(2):
                    values[inside, axis] = np.interp(angles[inside], own + whole, outline[:, axis])
            found[plane] = values
        return found


def angles_between(low: float, high: float) -> Array:
    """(N,) evenly spaced eccentric angles from one to another."""
    return np.linspace(low, high, round(TUNING.angles_per_turn * (high - low) / TURN))


def on_ellipse(ellipse: Ellipse3D, angles: Array) -> Array:
    """(N, 3) points of an ellipse at eccentric angles (N,)."""
    angles = angles[:, None]
    return np.asarray(ellipse.centre + np.cos(angles) * ellipse.semi_major + np.sin(angles) * ellipse.semi_minor)


def _monotone_angles(outlines: list[Array], ellipse: Ellipse3D, projections: list[Projection]) -> list[Array]:
    """Per outline (N, 2), (N,) eccentric angles of its points, monotone along it; projection by projection.

    Dynamic programming, both directions.
    """
    turns = 2
    angles = np.linspace(0.0, 2.0 * np.pi * turns, TUNING.angles_per_turn * turns, endpoint=False)
    on_curve = on_ellipse(ellipse, angles)
    cost = np.empty((len(outlines[0]), len(outlines), 2, len(angles)))  # rising and falling
    for number, (outline, projection) in enumerate(zip(outlines, projections, strict=True)):
        x, y = (one[:, None] - other for one, other in zip(outline.T, projection.project(on_curve).T, strict=True))
        np.sqrt(x * x + y * y, out=cost[:, number, 0])
        cost[:, number, 1] = cost[:, number, 0, ::-1]
    reach = int(TUNING.angles_per_turn * TUNING.largest_step_turns)
    ways = _cheapest_ways(cost, reach)
    return [np.asarray(angles[:: (1, -1)[way[0]]][way[1:]]) for way in ways.tolist()]


def _cheapest_ways(cost: Array, reach: int) -> npt.NDArray[np.int64]:
    """The cheapest monotone way of each outline round its ellipse.

    Args:
        cost: (N, outlines, 2, angles) of each point at each angle, rising and falling.
        reach: largest step from point to point is one angle less.

    Returns:
        (outlines, N + 1): the direction, then the angle's number of each point.
    """
    if has_kernels():
        from lasso_motion_ros.seeding.kernels import cheapest_ways

        compiled_ways: npt.NDArray[np.int64] = cheapest_ways(cost, reach)
        return compiled_ways
    totals = np.full((*cost.shape[:-1], reach - 1 + cost.shape[-1]), np.inf)
    # From any earlier angle within the largest step, to this one: (N, reach, outlines, 2, angles), the farthest first.
    before = np.moveaxis(sliding_window_view(totals, cost.shape[-1], axis=-1), -2, 1)
    here = totals[..., reach - 1 :]
    here[0] = cost[0]
    for row in range(1, len(cost)):
        np.add(np.minimum.reduce(before[row - 1]), cost[row], out=here[row])
    found = []
    for number in range(cost.shape[1]):
        direction = int(np.argmin(here[-1, number].min(axis=-1)))
        index = int(np.argmin(here[-1, number, direction]))
        indices = [index]
        for total in totals[-2::-1, number, direction]:
            index -= int(total[index : index + reach][::-1].argmin())
            indices.append(index)
        found.append([direction, *indices[::-1]])
    return np.array(found, dtype=np.int64)
