"""Vessels that an injection of contrast agent fills for a while: the vein at the ring, or the left coronary artery."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import cv2
import numpy as np
import numpy.typing as npt

from lasso_motion_ros.geometry.projection import Projection
from lasso_motion_ros.geometry.transforms import apply, rotation_from_vector
from lasso_motion_ros.phantom.catheters import Loop, spline
from lasso_motion_ros.phantom.lab_settings import Incident
from lasso_motion_ros.phantom.tubes import Segments, optical_depth

Array = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Flow:
    """How contrast agent flows and is rendered.

    Attributes:
        front_m_s: speed of its front in a vessel.
        rise_s: time constant with which it fills a place.
        washout_s: time constant with which it leaves after the injection.
        spacing_m: length of a vessel's pieces.
        blur_px: hides the joints of the pieces (sigma), in pixels twice as large as the image's.
    """

    front_m_s: float = 0.12
    rise_s: float = 0.4
    washout_s: float = 1.2
    spacing_m: float = 2.0e-3
    blur_px: float = 1.2


FLOW = Flow()


@dataclass(frozen=True, eq=False)
class Tree:
    """A vessel tree in the first pair.

    Attributes:
        start: (S, 3) ends of its pieces, metres.
        end: (S, 3) their other ends.
        radius: (S,) metres.
        distance: (S,) from where the contrast is injected, along the vessel, metres.
        share: (S,) of the heart's motion that a piece takes.
        beat: (S,) of the ventricles' contraction that it takes.
    """

    start: Array
    end: Array
    radius: Array
    distance: Array
    share: Array
    beat: Array


def concentration(incident: Incident, seconds: Array) -> Array:
    """Contrast, 0 to 1, at times (K,) since the injection began: it rises, stays while injected, and is washed out."""
    rising = 1.0 - np.exp(-np.maximum(seconds, 0.0) / FLOW.rise_s)
    washed = np.exp(-np.maximum(seconds - incident.duration_s, 0.0) / FLOW.washout_s)
    return np.asarray(rising * washed)


def contrast_depth(
    projection: Projection,
    trees: dict[str, Tree],
    incidents: Sequence[Incident],
    time_s: float,
    since_first: Array,
    contraction: float,
) -> Array:
    """Optical depth (H, W) of all contrast at one instant; `since_first` (4, 4) is the heart's motion by then.

    Vessels are wide and soft: they are computed on pixels twice as large and smoothed, which hides the joints of
    their pieces too.
    """
    half = projection.binned(2, 2)
    depth = np.zeros((half.height, half.width))
    for incident in incidents:
        if incident.kind != "contrast" or time_s < incident.start_s:
            continue
        tree = trees[incident.vessel]
        filled = incident.amount * concentration(incident, time_s - incident.start_s - tree.distance / FLOW.front_m_s)
        kept = filled > 0.5
        if kept.any():
            beat = contraction * tree.beat[kept, None] * np.array([-3.0e-3, 2.0e-3, 3.5e-3])
            start, end = (
                points[kept] + tree.share[kept, None] * (apply(since_first, points[kept]) - points[kept]) + beat
                for points in (tree.start, tree.end)
            )
            depth += optical_depth(half, Segments(start, end, tree.radius[kept], filled[kept]), 1)
    smooth = cv2.GaussianBlur(depth, (0, 0), FLOW.blur_px)
    return np.asarray(cv2.resize(smooth, (projection.width, projection.height), interpolation=cv2.INTER_LINEAR))


def vein_tree(loop: Loop, random: np.random.Generator) -> Tree:
    """The pulmonary vein in whose mouth the ring lies, with two or three orders of branches.

    Args:
        loop: the ring in the first pair; its axis points out of the vein.
        random: draws the branches.
    """
    into = -loop.normal
    radius = 0.45 * float(np.linalg.norm(loop.points - loop.centre, axis=1).mean())
    pieces: list[tuple[Array, float, float]] = []
    stack = [(loop.centre - 6.0e-3 * into, into, radius, 0.0, 0)]
    while stack:
        place, heading, wide, before, order = stack.pop()
        length = (26.0e-3, 24.0e-3, 20.0e-3, 16.0e-3)[order] * float(random.uniform(0.8, 1.2))
        bend = rotation_from_vector(random.normal(0.0, 0.2, 3))
        middle, end = place + 0.5 * length * heading, place + 0.5 * length * (heading + bend @ heading)
        pieces.append((np.stack([place, middle, end]), wide, before))
        if order < 3:
            for _ in range(2):
                turn = rotation_from_vector(random.normal(0.0, 0.45, 3))
                stack.append(
                    (end, turn @ bend @ heading, wide * float(random.uniform(0.6, 0.78)), before + length, order + 1)
                )
    return _tree(pieces, share=lambda distance: np.clip(1.0 - distance / 0.16, 0.4, 1.0), beat=0.0)


_CORONARY = (
    # Left main, then the anterior descending and the circumflex artery; millimetres, radius.
    (((16, -26, 30), (24, -34, 26), (29, -38, 20)), 2.0),
    (((29, -38, 20), (38, -62, 8), (54, -72, -16), (70, -72, -44)), 1.5),
    (((29, -38, 20), (42, -26, 6), (52, -10, -10), (44, 6, -26)), 1.5),
    (((38, -62, 8), (54, -58, 0), (68, -50, -18)), 1.0),
    (((50, -14, -8), (62, -22, -24), (68, -32, -42)), 1.0),
)  # fmt: skip


def coronary_tree(motion: Array) -> Tree:
    """The left coronary artery, on the heart's surface; `motion` (4, 4) is the heart's up to the first pair."""
    pieces = [
        (apply(motion, 1e-3 * np.asarray(points, dtype=np.float64)), 1e-3 * radius, 0.0 if index == 0 else 0.02)
        for index, (points, radius) in enumerate(_CORONARY)
    ]
    return _tree(pieces, share=np.ones_like, beat=1.0)


def _tree(pieces: list[tuple[Array, float, float]], share: Callable[[Array], Array], beat: float) -> Tree:
    starts, ends, radii, distances = [], [], [], []
    for knots, radius, before in pieces:
        curve = spline(knots, FLOW.spacing_m)
        count = len(curve) - 1
        starts.append(curve[:-1])
        ends.append(curve[1:])
        radii.append(radius * np.linspace(1.0, 0.82, count))
        distances.append(before + FLOW.spacing_m * np.arange(count))
    distance = np.concatenate(distances)
    return Tree(
        np.concatenate(starts),
        np.concatenate(ends),
        np.concatenate(radii),
        distance,
        share(distance),
        np.full(len(distance), beat),
    )
