"""A tiny analytic sequence: a dark ring of Gaussian profile that moves over a smooth background."""

from __future__ import annotations

import numpy as np
from support.method_inputs import biplane, closed, draw_curve, ring

from lasso_motion_ros.geometry.frames import Frame, FramePair, Seed

SIDE = 512
PERIOD_NS = 333_000_000
LOOP = ring([0.3, -0.5, 0.8], [0.005, -0.010, 0.008])
VIEWS = biplane(side=SIDE)


def frame(plane: str, translation: np.ndarray, stamp_ns: int, *, bright: bool = False) -> Frame:
    """One plane's image of the ring, moved by (3,) metres."""
    curve = closed(LOOP.points(400)) + translation
    # Equalisation spreads what grey levels there are: over an even background, only the line's own tails.
    y, x = np.mgrid[:SIDE, :SIDE] / SIDE
    background = 140.0 + 40.0 * np.sin(7.0 * x + 2.0) * np.cos(5.0 * y)
    pixels = draw_curve(VIEWS[plane].project(curve), (SIDE, SIDE), background=background, depth=70.0)
    pixels = 255 - pixels if bright else pixels
    return Frame(stamp_ns, pixels, VIEWS[plane])


def pair(
    index: int, translation: np.ndarray = (0.0, 0.0, 0.0), planes: str = "ab", *, bright: bool = False
) -> FramePair:
    """Pair number `index` with the ring moved by (3,) metres."""
    stamp_ns = index * PERIOD_NS
    frames = {p: frame(p, np.asarray(translation), stamp_ns, bright=bright) if p in planes else None for p in "ab"}
    return FramePair(stamp_ns, frames["a"], frames["b"])


def seed(count: int = 10, noise_px: float = 0.5) -> Seed:
    """Clicks along the ring where it is not moved, a little beside it."""
    random = np.random.default_rng(1)
    clicks = {p: closed(VIEWS[p].project(LOOP.points(count))) for p in "ab"}
    return Seed(*(clicks[p] + random.normal(scale=noise_px, size=clicks[p].shape) for p in "ab"))
