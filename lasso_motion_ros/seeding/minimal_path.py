"""The path along the loop between the user's clicks: fast marching on a line-feature cost."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from math import hypot

import cv2
import numpy as np
import numpy.typing as npt
import skfmm

from lasso_motion_ros.core.compiled import has_kernels
from lasso_motion_ros.core.errors import SeedError
from lasso_motion_ros.geometry.curves import resample, slope
from lasso_motion_ros.seeding.line_filter import sato

Array = npt.NDArray[np.float64]


@dataclass(frozen=True)
class _Tuning:
    """How a path is traced.

    Attributes:
        margin_px: a path may run this far outside the clicks' bounding box.
        step_px: step of the walk along the path.
        nearest_px: clicks nearer than this are joined by a straight line.
        goal_px: the walk has arrived this near to its goal.
        largest_detour: a path longer than this times the clicks' distance has left the loop.
        wider_scale: the second scale of the line filter, in units of the first.
        neighbourhood: scale over which a line's usual strength is estimated, in units of the line filter's.
        full_strength: a line this many times as strong as usual has the lowest cost.
        bulges: heights of some arcs from click to click, in units of their distance: the loop is not far from one.
        slack: a front may take this many times as long as the cheapest of them is dear, for its sampling,
        beyond_px: and goes on for some pixels, between which the arrival times are interpolated.
        around_px: as far about its goal it has to have come by then; else it goes on.
    """

    margin_px: int = 24
    step_px: float = 0.5
    nearest_px: float = 2.0
    goal_px: float = 1.5
    largest_detour: float = 3.0
    wider_scale: float = 1.5
    neighbourhood: float = 12.0
    full_strength: float = 2.5
    bulges: tuple[float, ...] = (-0.5, -0.4, -0.3, -0.2, -0.15, -0.1, -0.05, 0.0, 0.05, 0.1, 0.15, 0.2, 0.3, 0.4, 0.5)
    slack: float = 1.0
    beyond_px: float = 2.0
    around_px: int = 2


TUNING = _Tuning()


def path_through_clicks(
    image: npt.NDArray[np.generic], clicks: Array, *, bright: bool, sigma_px: float, cost_floor: float
) -> Array:
    """The path that joins clicks along a line in the image.

    From every click a front marches with speed 1 / cost over the image (Sethian's fast marching, second
    order), where the cost is low on lines; the way back down its arrival times from the next click is the
    minimal path, traced with sub-pixel steps.

    Args:
        image: (H, W) pixels.
        clicks: (N, 2) pixels in order along the loop, N ≥ 2; a loop clicked past its start overlaps itself.
        bright: True where the catheter is brighter than its background.
        sigma_px: scale of the line filter, pixels.
        cost_floor: cost on a perfect line, relative to one off any line.

    Returns:
        (M, 2) float64 points, about half a pixel apart, from the first click to the last. Where two clicks
        lie closer than two pixels, or the minimal path would be a long detour, the straight line joins them.

    Raises:
        SeedError: a click outside the image, or fewer than two clicks.
    """
    clicks = np.asarray(clicks, dtype=np.float64)
    height, width = image.shape
    if clicks.ndim != 2 or clicks.shape[1:] != (2,) or len(clicks) < 2:
        raise SeedError(f"expected clicks (N, 2) with N ≥ 2, found shape {clicks.shape}")
    outside = ~np.all((clicks >= 0.0) & (clicks <= [width - 1, height - 1]), axis=1)
    if np.any(outside):
        x, y = clicks[outside][0]
        raise SeedError(f"click ({x:.0f}, {y:.0f}) lies outside the image of {width}×{height} pixels")
    low = np.maximum(np.floor(clicks.min(axis=0)).astype(int) - TUNING.margin_px, 0)
    high = np.minimum(np.ceil(clicks.max(axis=0)).astype(int) + TUNING.margin_px + 1, [width, height])
    cost = _line_cost(image[low[1] : high[1], low[0] : high[0]], bright, sigma_px, cost_floor)
    local = clicks - low
    pieces = [_minimal_path(cost, start, end) for start, end in pairwise(local)]
    return np.asarray(np.vstack([pieces[0][:1], *(piece[1:] for piece in pieces)]) + low)


def _line_cost(image: npt.NDArray[np.generic], bright: bool, sigma_px: float, cost_floor: float) -> Array:
    grey = image.astype(np.float32)
    response = sato(-grey if bright else grey, (sigma_px, TUNING.wider_scale * sigma_px))
    # Relative to the neighbourhood, so that a faint wire over the spine counts as much as one over the lung.
    scale = np.sqrt(cv2.GaussianBlur(response * response, (0, 0), TUNING.neighbourhood * sigma_px)) + 1e-6
    strength = np.clip(response / (TUNING.full_strength * scale), 0.0, 1.0)
    return np.asarray(cost_floor + (1.0 - cost_floor) * (1.0 - strength) ** 2, dtype=np.float64)


def _minimal_path(cost: Array, start: Array, end: Array) -> Array:
    """(M, 2) path from start to end (x, y) in the cost image, both ends exact."""
    straight = np.vstack([start, end])
    distance = float(np.linalg.norm(end - start))
    if distance < TUNING.nearest_px:
        return straight
    margin = int(np.ceil(0.75 * distance)) + 8
    low = np.maximum(np.floor(np.minimum(start, end)).astype(int) - margin, 0)
    high = np.minimum(np.ceil(np.maximum(start, end)).astype(int) + margin + 1, cost.shape[::-1])
    path = _way_down(cost[low[1] : high[1], low[0] : high[0]], start - low, end - low)
    if path is None:
        return straight
    path = path[::-1] + low
    path[0], path[-1] = start, end
    length = float(np.linalg.norm(np.diff(path, axis=0), axis=1).sum())
    if length > TUNING.largest_detour * distance:
        return straight
    return resample(path, max(2, int(np.ceil(length / TUNING.step_px)) + 1))


def _way_down(cost: Array, start: Array, end: Array) -> Array | None:
    """(M, 2) path from end back to start, where the front began; None where the walk does not get there."""
    rows, columns = np.ogrid[: cost.shape[0], : cost.shape[1]]
    # The level set's zero contour is a one-pixel disc about the click: the marching starts from there.
    signed_distance = np.hypot(columns - start[0], rows - start[1]) - 1.0
    # The minimal path is no dearer than any other; no pixel costs more than one.
    latest = TUNING.slack * _cheapest_arc(cost, start, end) + TUNING.beyond_px
    if has_kernels():
        from lasso_motion_ros.seeding.front_kernels import way_down

        walked, is_there = way_down(
            signed_distance, cost, end, start, TUNING.around_px, latest, TUNING.step_px, TUNING.goal_px
        )
        return walked if is_there else None
    return _descend(_arrival(cost, signed_distance, end, latest), end, start)


def _arrival(cost: Array, signed_distance: Array, end: Array, latest: float) -> Array:
    """(h, w) times at which the front gets to each pixel of the cost image, as far as end and a bit on."""
    arrival = skfmm.travel_time(signed_distance, 1.0 / cost, order=2, narrow=latest)
    column, row = np.rint(end).astype(int)
    around = TUNING.around_px
    near_end = np.s_[max(row - around, 0) : row + around + 1, max(column - around, 0) : column + around + 1]
    if np.ma.is_masked(arrival[near_end]):
        arrival = skfmm.travel_time(signed_distance, 1.0 / cost, order=2)
    return np.asarray(np.ma.filled(arrival, latest), dtype=np.float64)


def _cheapest_arc(cost: Array, start: Array, end: Array) -> float:
    """What the cheapest of some arcs from start to end costs."""
    chord = end - start
    t = np.linspace(0.0, 1.0, int(np.ceil(np.linalg.norm(chord) / TUNING.step_px)) + 1)
    height = 4.0 * t * (1.0 - t) * np.array(TUNING.bulges)[:, None]
    x = start[0] + t * chord[0] - height * chord[1]
    y = start[1] + t * chord[1] + height * chord[0]
    costs = cv2.remap(cost, x.astype(np.float32), y.astype(np.float32), cv2.INTER_LINEAR, borderValue=1.0)
    steps = np.hypot(np.diff(x, axis=1), np.diff(y, axis=1))
    return float((0.5 * (costs[:, 1:] + costs[:, :-1]) * steps).sum(axis=1).min())


def _descend(arrival: Array, start: Array, goal: Array) -> Array | None:
    """Walk down the arrival times in half-pixel steps; None where the walk does not get to the goal."""
    # Plain numbers: of the thousand steps each would spend its time in making arrays of two and four. A complex number
    # is both slopes at once.
    slopes = np.empty(arrival.shape, dtype=np.complex128)
    slopes.real, slopes.imag = slope(arrival, axis=1), slope(arrival, axis=0)
    at = slopes.item
    last_x, last_y = (side - 1.001 for side in arrival.shape[::-1])  # the last place with four pixels around it
    x, y = min(float(start[0]), last_x), min(float(start[1]), last_y)
    goal_x, goal_y = map(float, goal)
    step_px, goal_px = TUNING.step_px, TUNING.goal_px
    path = [(x, y)]
    for _ in range(20 * sum(arrival.shape)):
        if hypot(x - goal_x, y - goal_y) < goal_px:
            return np.array([*path, (goal_x, goal_y)])
        column, row = int(x), int(y)
        fx, fy = x - column, y - row
        down = (1.0 - fy) * ((1.0 - fx) * at(row, column) + fx * at(row, column + 1)) + fy * (
            (1.0 - fx) * at(row + 1, column) + fx * at(row + 1, column + 1)
        )
        size = abs(down)
        if not size > 0.0:
            return None
        x = min(max(x - step_px * down.real / size, 0.0), last_x)
        y = min(max(y - step_px * down.imag / size, 0.0), last_y)
        path.append((x, y))
    return None
