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
from lasso_motion_ros.ring.strip import shared_out
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


def _elsewhere() -> npt.NDArray[np.bool_]:
    """(K, K) of the places where a curve is laid, every second working pixel, which are far enough from its own."""
    at = 2.0 * np.arange(-_STEPS, _STEPS + 1)
    return np.asarray(np.hypot(at, at[:, None]) >= TUNING.nearest_mm / PIXEL_MM)


_STEPS = round(0.5 * TUNING.reach_mm / PIXEL_MM)
_ELSEWHERE = _elsewhere()


@dataclass(frozen=True, eq=False)
class _Laid:
    """What an image shows along a curve in its place, and laid aside.

    Laid aside by whole pixels, every point of a curve lies between its four pixels as it does in its place. So a mean
    along it, wherever it is laid, is a correlation with what those pixels' shares add up to.

    Attributes:
        shown: (H, W) evidence about the curve, nothing outside the picture.
        inside: (H, W) 1 in the picture, 0 outside; None where all is inside.
        pixels: (2, L) x and y of the curve in it.
    """

    shown: Image
    inside: Image | None
    pixels: Array

    @classmethod
    def of(cls, image: WorkingImage, along: Array) -> _Laid:
        """Of a curve (L, 2), working pixels."""
        # A pixel more on each side is what is between pixels.
        reach = 2 * _STEPS + 2
        low, high = (np.floor(one).astype(np.intp) for one in (along.min(axis=0), along.max(axis=0)))
        (left, top), (right, bottom) = (low - reach).tolist(), (high + reach + 1).tolist()
        evidence, corner = image.evidence_about(np.array([[left, top], [right, bottom]], np.float64))
        x, y = corner.astype(int).tolist()
        height, width = evidence.shape
        if min(right, x + width) <= max(left, x) or min(bottom, y + height) <= max(top, y):
            nothing = np.zeros((bottom - top, right - left), np.float32)
            return cls(nothing, nothing, (along - (left, top)).T)
        part = evidence[max(top - y, 0) : max(bottom - y, 0), max(left - x, 0) : max(right - x, 0)]
        beyond = (max(y - top, 0), max(bottom - y - height, 0), max(x - left, 0), max(right - x - width, 0))
        shown = cv2.copyMakeBorder(part, *beyond, cv2.BORDER_CONSTANT)
        is_whole = not any(beyond)
        inside = None if is_whole else cv2.copyMakeBorder(np.ones_like(part), *beyond, cv2.BORDER_CONSTANT)
        return cls(np.asarray(shown), None if inside is None else np.asarray(inside), (along - (left, top)).T)

    def means(self, weights: Image | None) -> Image:
        """(M,) of those that are asked, the weighted means (L,), or the plain ones, of what lies in the picture.

        The first is that in its place. Beyond its edge nothing is known. To count as a place without evidence it would
        make all others stand out. None are left where too little of the curve itself is in the picture.
        """
        each = np.ones(self.pixels.shape[1], np.float32) if weights is None else weights
        whole = max(float(each.sum()), 1e-9)
        index, share, (left, top), (width, height) = shared_out(self.pixels, each / whole, 1.0)
        kernel = np.bincount(index.reshape(-1), share.reshape(-1), width * height).astype(np.float32)
        part = slice(top - 2 * _STEPS, top + height + 2 * _STEPS), slice(left - 2 * _STEPS, left + width + 2 * _STEPS)

        def laid(values: Image) -> Image:
            """(M,) sums wherever the curve is laid, the first in its place."""
            found = cv2.matchTemplate(values[part], kernel.reshape(height, width), cv2.TM_CCORR)[::2, ::2]
            return np.concatenate([found[_STEPS, _STEPS : _STEPS + 1], found[_ELSEWHERE]])

        shown = laid(self.shown)
        if self.inside is None:
            return shown
        inside = laid(self.inside)
        is_asked = inside >= TUNING.smallest_inside
        return np.asarray(shown[is_asked] / inside[is_asked]) if is_asked[0] else np.zeros(0, np.float32)


def _stands_out(means: Image) -> tuple[float, float]:
    """By how many standard deviations the first of some means (K,) stands out from the others, and beyond the most.

    Nothing does where there are no others.
    """
    if len(means) < 2:
        return 0.0, 0.0
    here, others = float(means[0]), means[1:]
    spread = max(float(others.std()), TUNING.smallest_spread)
    return (here - float(others.mean())) / spread, here - float(others.max())
