"""A drawn lasso: a wire that overlaps itself a little, with electrodes, in noise, anywhere in space."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache

import numpy as np
from support.method_inputs import draw_curve
from support.tracking_inputs import LOOP, PERIOD_NS, SIDE, VIEWS

from lasso_motion_ros.geometry.frames import Frame, FramePair, Seed
from lasso_motion_ros.geometry.projection import Projection
from lasso_motion_ros.geometry.transforms import rotation_from_vector
from lasso_motion_ros.ring.working_image import WorkingImage

WIRE_SIGMA_MM, WIRE_DEPTH = 0.32, 35.0
ELECTRODE_SIGMA_MM, ELECTRODE_DEPTH, ELECTRODE_LENGTH_MM = 0.55, 60.0, 1.5
NOISE = 5.0


def lasso_curve(turns: float = 1.05, rise_m: float = 1e-3, count: int = 400) -> np.ndarray:
    """(count, 3) metres: `turns` of the ring of `tracking_inputs`, rising along its axis from end to end."""
    turn = np.linspace(0.0, turns, count)[:, None]
    angle = 2.0 * np.pi * turn
    flat = LOOP.centre + np.cos(angle) * LOOP.semi_major + np.sin(angle) * LOOP.semi_minor
    return flat + (turn / turns - 0.5) * rise_m * LOOP.normal


CURVE = lasso_curve()


@cache
def _background(shape: tuple[int, int]) -> np.ndarray:
    y, x = (np.arange(size)[:, None] / size for size in shape)
    return 150.0 + 40.0 * np.cos(5.0 * y) * np.sin(7.0 * x.T + 2.0)


def lasso_image(curve: np.ndarray, projection: Projection, *, electrodes: int = 10) -> np.ndarray:
    """uint8 image without noise: dark wire, darker electrodes, over a background that varies slowly."""
    shape = (projection.height, projection.width)
    pixels = projection.project(curve)
    unit = projection.millimetres_per_pixel(curve.mean(axis=0))
    image = draw_curve(pixels, shape, sigma_px=WIRE_SIGMA_MM / unit, background=_background(shape), depth=WIRE_DEPTH)
    length = np.linalg.norm(np.diff(curve, axis=0), axis=1).sum()
    half = 0.5 * ELECTRODE_LENGTH_MM / 1e3 / length * len(curve)
    for place in (np.arange(electrodes) + 0.4) / max(electrodes, 1) * len(curve):
        segment = pixels[max(int(place - half), 0) : int(place + half) + 1]
        low = np.clip(np.floor(segment.min(axis=0)).astype(int) - 16, 0, shape[::-1])
        high = np.clip(np.ceil(segment.max(axis=0)).astype(int) + 17, 0, shape[::-1])
        if (high - low).min() > 0:
            window = image[low[1] : high[1], low[0] : high[0]]
            window[:] = draw_curve(
                segment - low,
                window.shape,
                sigma_px=ELECTRODE_SIGMA_MM / unit,
                background=window,
                depth=ELECTRODE_DEPTH,
            )
    return image


def noisy(image: np.ndarray, seed: int | list[int], sigma: float = NOISE) -> np.ndarray:
    """A uint8 image with independent normal noise on every pixel."""
    noise = sigma * np.random.default_rng(seed).standard_normal(image.shape, dtype=np.float32)
    return np.clip(np.rint(image + noise), 0, 255).astype(np.uint8)


def bare(values: np.ndarray, projection: Projection) -> WorkingImage:
    """A working image of given values, whose noise and grey nobody asks for."""
    return WorkingImage(values, projection, np.ones_like(values), np.ones(values.shape, np.uint16))


@cache
def _clean(plane: str, translation: tuple[float, ...] | None) -> np.ndarray:
    away = (10.0, 0.0, 0.0)  # ten metres: nothing of it is in the picture
    return lasso_image(CURVE + np.array(translation or away), VIEWS[plane])


def pair_of(
    index: int, images: Mapping[str, np.ndarray], views: Mapping[str, Projection] = VIEWS, *, sigma: float = NOISE
) -> FramePair:
    """Pair number `index` of a sequence, of each plane's image (h, w) with noise on it; a plane may be missing."""
    stamp_ns = index * PERIOD_NS
    frames = {p: Frame(stamp_ns, noisy(image, [index, ord(p)], sigma), views[p]) for p, image in images.items()}
    return FramePair(stamp_ns, frames.get("a"), frames.get("b"))


def curve_pair(
    index: int, curve: np.ndarray, views: Mapping[str, Projection] = VIEWS, *, electrodes: int = 10
) -> FramePair:
    """Pair number `index` of a sequence, in which both planes show a lasso along a curve (N, 3), metres."""
    return pair_of(index, {p: lasso_image(curve, view, electrodes=electrodes) for p, view in views.items()}, views)


def turned(turn_deg: tuple[float, float, float]) -> np.ndarray:
    """The lasso's curve (N, 3), turned about its centre by a rotation vector in degrees."""
    return LOOP.centre + (CURVE - LOOP.centre) @ rotation_from_vector(np.radians(turn_deg)).T


def lasso_pair(
    index: int,
    translation_m: np.ndarray | None = (0.0, 0.0, 0.0),
    planes: str = "ab",
    *,
    sigma: float = NOISE,
) -> FramePair:
    """Pair number `index` of a sequence: the lasso moved by (3,) metres, or None: not there."""
    key = None if translation_m is None else tuple(float(v) for v in translation_m)
    return pair_of(index, {plane: _clean(plane, key) for plane in planes}, sigma=sigma)


def lasso_seed(count: int = 10, noise_px: float = 0.7, curve: np.ndarray = CURVE) -> Seed:
    """Clicks along the lasso where it is not moved, from end to end, a little beside it."""
    random = np.random.default_rng(1)
    at = np.linspace(0, len(curve) - 1, count).astype(int)
    return Seed(*(VIEWS[p].project(curve[at]) + random.normal(scale=noise_px, size=(count, 2)) for p in "ab"))


__all__ = [
    "CURVE",
    "LOOP",
    "PERIOD_NS",
    "SIDE",
    "VIEWS",
    "bare",
    "curve_pair",
    "lasso_curve",
    "lasso_image",
    "lasso_pair",
    "lasso_seed",
    "noisy",
    "pair_of",
    "turned",
]
