"""Looks at the ring: what single pairs showed of it, cut out, and all of them laid on the first.

Noise is another one in each pair, and what lies behind the ring moves otherwise; the ring stays what it is. So the mean
of the pairs, each moved by the ring's own motion, shows wire and electrodes as no pair alone does.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import cv2
import numpy as np
import numpy.typing as npt

from lasso_motion_ros.geometry.frames import PLANES, Frame, FramePair, Plane
from lasso_motion_ros.geometry.projection import Projection
from lasso_motion_ros.geometry.transforms import rotation_from_vector
from lasso_motion_ros.ring.alignment import Alignment
from lasso_motion_ros.ring.loop_model import LoopModel
from lasso_motion_ros.ring.working_image import NOISE_WINDOW_PX, reduction_factor

Array = npt.NDArray[np.float64]


@dataclass(frozen=True)
class _Tuning:
    """How much is cut out, and what may be laid on each other."""

    margin_mm: float = 14.0  # of the images, beyond the ring
    # A ring tells badly how its image has turned and grown, above all where it is seen edge-on: so far, mm, what its
    # points say holds against what the projections do.
    held_mm: float = 2.0
    same_view_deg: float = 5.0  # seen from another side the ring is another picture
    fewest: int = 3  # later looks from where the first was taken: fewer show the curve no better than the clicks did


TUNING = _Tuning()
_FULL_SCALE = 60_000.0  # of a mean's grey values: finer than any noise
_SAMPLED = cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP


@dataclass(frozen=True, eq=False)
class Look:
    """One pair that shows the ring, cut out about it.

    Attributes:
        pair: both planes' frames, reduced to about a working image's pixels.
        origin: (3,) m that was taken for the ring's centre in the first look,
        centres: per plane, (3,) m where it is now,
        shape: (3, 3) and by which what lies about it is turned and stretched.
    """

    pair: FramePair
    origin: Array
    centres: Mapping[Plane, Array]
    shape: Array

    @staticmethod
    def first(pair: FramePair, model: LoopModel) -> Look:
        """The look of the seed pair."""
        return _cut(pair, model, dict.fromkeys(PLANES, model.centre), np.eye(3))

    @staticmethod
    def later(pair: FramePair, model: LoopModel, alignment: Alignment) -> Look:
        """The look of a pair in which both planes show the ring."""
        centres = {plane: fit.centre for plane, fit in alignment.planes.items()}
        return _cut(pair, model, centres, rotation_from_vector(alignment.turn) * np.exp(alignment.stretch))

    def moved(self, plane: Plane, points: Array) -> Array:
        """(N, 3) m where a plane shows what lay at points (N, 3) m in the first look."""
        return np.asarray(self.centres[plane] + (points - self.origin) @ self.shape.T)


@dataclass(frozen=True, eq=False)
class Looks:
    """The seed pair's look, and later ones.

    Attributes:
        first: that of the seed pair.
        later: others, oldest first.
    """

    first: Look
    later: tuple[Look, ...] = ()

    def after(self, look: Look) -> Looks:
        """With one more."""
        return replace(self, later=(*self.later, look))

    def mean(self, model: LoopModel) -> FramePair | None:
        """What all that were taken from the first one's side show together, as it lies there.

        Args:
            model: with which the ring was found in them.

        Returns:
            Both planes' frames, of the first look's size, stamps and projections; None where the looks are too few.
        """
        alike = [look for look in self.later if _is_from_same_side(look, self.first)]
        if len(alike) < TUNING.fewest:
            return None
        frames = {plane: _mean(self.first, alike, plane, model) for plane in PLANES}
        return replace(self.first.pair, a=frames["a"], b=frames["b"])


def _cut(pair: FramePair, model: LoopModel, centres: Mapping[Plane, Array], shape: Array) -> Look:
    frames = {}
    for plane, frame in pair.frames.items():
        points = centres[plane] + model.arms @ shape.T
        factor = reduction_factor(frame.projection, centres[plane])
        pixels = frame.projection.project(points) + model.shift(plane, frame.projection)
        unit = frame.projection.millimetres_per_pixel(centres[plane])
        # A working image is no smaller than twice its window: at an image's edge more is taken of the other side.
        reach = np.maximum(0.5 * np.ptp(pixels, axis=0) + TUNING.margin_mm / unit, factor * (NOISE_WINDOW_PX + 2))
        size = np.array(frame.pixels.shape[::-1])
        span = np.minimum(np.ceil(2.0 * reach).astype(int), size)
        corner = np.floor(0.5 * (pixels.min(axis=0) + pixels.max(axis=0)) - reach).astype(int)
        left, top = (np.clip(corner, 0, size - span) // factor * factor).tolist()
        width, height = span.tolist()
        projection = frame.projection.read_out(left, top, width, height, factor, factor)
        part = frame.pixels[top : top + projection.height * factor, left : left + projection.width * factor]
        # A copy even where nothing is reduced: a part of the frame would keep all of it.
        grey = cv2.resize(part, (projection.width, projection.height), interpolation=cv2.INTER_AREA)
        frames[plane] = Frame(frame.stamp_ns, grey, projection)
    return Look(replace(pair, a=frames.get("a"), b=frames.get("b")), model.centre, centres, shape)


def _is_from_same_side(look: Look, other: Look) -> bool:
    rays = ([one.pair.frames[plane].projection.viewing_direction for one in (look, other)] for plane in PLANES)
    return all(float(here @ there) > np.cos(np.radians(TUNING.same_view_deg)) for here, there in rays)


def _mean(first: Look, later: list[Look], plane: Plane, model: LoopModel) -> Frame:
    frame = first.pair.frames[plane]
    shown = frame.pixels.astype(np.float32)
    total, weights = shown.copy(), np.ones_like(shown)
    for look in later:
        other = look.pair.frames[plane]
        matrix = _affine(first, look, plane, model)
        block = cv2.warpAffine(
            other.pixels.astype(np.float32),
            matrix,
            shown.shape[::-1],
            flags=_SAMPLED,
            borderMode=cv2.BORDER_CONSTANT,
            borderValue=np.nan,
        )
        is_seen = np.isfinite(block)
        if is_seen.any():
            level = float(shown[is_seen].mean()) / max(float(block[is_seen].mean()), 1e-6)  # another exposure
            total += np.where(is_seen, block * np.float32(level), np.float32(0.0))
            weights += is_seen
    mean = total / weights
    scaled = mean * np.float32(_FULL_SCALE / max(float(mean.max()), 1e-6))
    return Frame(frame.stamp_ns, np.rint(scaled).astype(np.uint16), frame.projection)


def _affine(first: Look, look: Look, plane: Plane, model: LoopModel) -> Array:
    """(2, 3) pixels of a look by those of the first: as the ring's points have gone, near to what projections say."""
    here, there = (one.pair.frames[plane].projection for one in (first, look))
    from_ = _seen(first, plane, here, model)
    to = _seen(look, plane, there, model)
    about, after = from_.mean(axis=0), to.mean(axis=0)
    steps = here.jacobian(first.centres[plane]), there.jacobian(look.centres[plane])
    linear = steps[1] @ np.linalg.pinv(steps[0])
    held = TUNING.held_mm / here.millimetres_per_pixel(first.centres[plane])
    arms = from_ - about
    left = (to - after) - arms @ linear.T
    normal = arms.T @ arms + len(arms) * held**2 * np.eye(2)
    linear = linear + np.linalg.solve(normal, arms.T @ left).T
    return np.column_stack([linear, after - linear @ about])


def _seen(look: Look, plane: Plane, projection: Projection, model: LoopModel) -> Array:
    """(N, 2) pixels of the ring's curve in a look."""
    return np.asarray(projection.project(look.moved(plane, model.points)) + model.shift(plane, projection))
