"""How far a ring stands out: what the planes show along its curve, by what they show along that curve laid elsewhere.

Where there is much, whatever lies along a curve is dark: ribs, wires, contrast, noise. How dark says little, then; how
much darker than along the same curve laid anywhere nearby says much, in standard deviations of what lies there. That
is one unit at every dose, on bone and on lung, and each curve has its own: a long narrow one along a row of wires
meets much by chance, a wide one on lung next to nothing.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import cv2
import numpy as np
import numpy.typing as npt

from lasso_motion_ros.geometry.curves import arc_length
from lasso_motion_ros.geometry.frames import PLANES, Plane
from lasso_motion_ros.ring.working_image import PIXEL_MM, Image, WorkingImage

Array = npt.NDArray[np.float64]


@dataclass(frozen=True)
class _Tuning:
    """Where else a curve is laid, and how wide a pole is."""

    reach_mm: float = 8.0
    nearest_mm: float = 1.5  # what is nearer shows the ring itself
    pole_mm: float = 0.7  # standard deviation along the arc
    smallest_spread: float = 0.05  # of evidence: where nothing is, nothing is divided
    smallest_inside: float = 0.5  # of the curve: laid farther out of the picture it is not asked


TUNING = _Tuning()


@dataclass(frozen=True)
class Distinctness:
    """How far a ring stands out, both planes together.

    Attributes:
        curve: by the mean along all of its curve, standard deviations, sum of the planes.
        poles: by the mean at its poles, likewise.
        lead: by how much more evidence its poles show than at best elsewhere, in the plane where that is less.
    """

    curve: float
    poles: float
    lead: float


class CurveElsewhere:
    """A ring's curve, laid all about its place in both planes.

    Args:
        seen: per plane, its working image.
        along: per plane, (L, 2) working pixels of the curve there.
    """

    def __init__(self, seen: Mapping[Plane, WorkingImage], along: Mapping[Plane, Array]) -> None:
        self._laid = {plane: _Laid.of(seen[plane], along[plane]) for plane in PLANES}

    @property
    def curve(self) -> float:
        """See `Distinctness`."""
        return sum(_stands_out(laid.means(None))[0] for laid in self._laid.values())

    def with_poles(self, points: Array, places_mm: tuple[float, ...]) -> Distinctness:
        """How far it stands out with poles.

        Args:
            points: (L, 3) of the curve, metres.
            places_mm: of the poles, from its beginning.
        """
        apart = (1e3 * arc_length(points)[:, None] - np.asarray(places_mm)[None]) / TUNING.pole_mm
        weights = np.exp(-0.5 * (apart**2).min(axis=1, initial=np.inf))
        told = [_stands_out(laid.means(weights.astype(np.float32))) for laid in self._laid.values()]
        return Distinctness(self.curve, sum(far for far, _ in told), min(lead for _, lead in told))


def _offsets() -> Array:
    """(K, 2) working pixels by which a curve is laid aside, every second one; the first not at all."""
    count = round(0.5 * TUNING.reach_mm / PIXEL_MM)
    at = 2.0 * np.arange(-count, count + 1)
    aside = np.stack(np.meshgrid(at, at), axis=2).reshape(-1, 2)
    return np.concatenate([np.zeros((1, 2)), aside[np.hypot(*aside.T) >= TUNING.nearest_mm / PIXEL_MM]])


OFFSETS = _offsets()


@dataclass(frozen=True, eq=False)
class _Laid:
    """What an image shows along a curve in its place, and laid aside.

    Attributes:
        shown: (K, L) evidence, nothing outside the picture; the first in its place.
        is_inside: (K, L) which of it lies in the picture; None where all does.
    """

    shown: Image
    is_inside: npt.NDArray[np.bool_] | None

    @classmethod
    def of(cls, image: WorkingImage, along: Array) -> _Laid:
        """Of a curve (L, 2), working pixels."""
        reach = TUNING.reach_mm / PIXEL_MM
        evidence, corner = image.evidence_about(np.concatenate([along - reach, along + reach]))
        if evidence.size == 0:
            shape = len(OFFSETS), len(along)
            return cls(np.zeros(shape, np.float32), np.zeros(shape, np.bool_))
        at = (OFFSETS[:, None] + (along - corner)).astype(np.float32)
        shown = cv2.remap(evidence, at, None, cv2.INTER_LINEAR, borderMode=cv2.BORDER_CONSTANT)
        farthest = np.array(evidence.shape[::-1]) - 1.0
        if (at.min(axis=(0, 1)) >= 0.0).all() and (at.max(axis=(0, 1)) <= farthest).all():
            return cls(np.asarray(shown), None)
        return cls(np.asarray(shown), np.asarray(((at >= 0.0) & (at <= farthest)).all(axis=2)))

    def means(self, weights: Image | None) -> Image:
        """(M,) of those that are asked, the weighted means (L,), or the plain ones, of what lies in the picture.

        Beyond its edge nothing is known. To count as a place without evidence it would make all others stand out. None
        are left where too little of the curve itself is in the picture.
        """
        each = np.ones(self.shown.shape[1], np.float32) if weights is None else weights
        whole = max(float(each.sum()), 1e-9)
        if self.is_inside is None:
            return np.asarray(self.shown @ (each / np.float32(whole)))
        inside = self.is_inside @ each
        is_asked = inside >= TUNING.smallest_inside * whole
        if not (is_asked[0] and inside[0] > 0.0):
            return np.zeros(0, np.float32)
        return np.asarray((self.shown @ each)[is_asked] / np.maximum(inside[is_asked], np.float32(1e-9)))


def _stands_out(means: Image) -> tuple[float, float]:
    """By how many standard deviations the first of some means (K,) stands out from the others, and beyond the most.

    Nothing does where there are no others.
    """
    if len(means) < 2:
        return 0.0, 0.0
    here, others = float(means[0]), means[1:]
    spread = max(float(others.std()), TUNING.smallest_spread)
    return (here - float(others.mean())) / spread, here - float(others.max())
