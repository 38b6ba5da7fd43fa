"""A ring drawn on noise: to warm a tracker up, and to measure speed and endurance.

It is far cheaper than the simulator and needs nothing but geometry. It stands in this room, the lowest that draws it,
since the node warms up with it and is not to carry the simulator.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
import numpy.typing as npt

from lasso_motion_ros.geometry.carm import carm_projection
from lasso_motion_ros.geometry.frames import PLANES, Plane, Seed
from lasso_motion_ros.geometry.projection import Projection
from lasso_motion_ros.geometry.transforms import apply, rigid

Array = npt.NDArray[np.float64]

GANTRY_DEG: dict[Plane, float] = {"a": -30.0, "b": 60.0}
DETECTOR_M = 0.2048
"""Side of the square field on the detector."""


@dataclass(frozen=True)
class _Drawing:
    """What the ring looks like.

    Attributes:
        radius_m: of the ring, metres.
        electrodes: how many there are on it.
        background: grey value, of 256.
        wire: grey value of the ring, of 256.
        electrode: grey value of an electrode, of 256.
        noise: standard deviation, of 4096.
        subpixel_bits: OpenCV draws at 2⁻ᵇⁱᵗˢ pixels.
    """

    radius_m: float = 0.01
    electrodes: int = 10
    background: int = 180
    wire: int = 110
    electrode: int = 70
    noise: float = 60.0
    subpixel_bits: int = 4


_DRAWING = _Drawing()


def ring_projection(plane: Plane, side: int) -> Projection:
    """A C-arm's projection to a square image of `side` pixels, always of the same field."""
    return carm_projection(
        np.radians(GANTRY_DEG[plane]),
        0.0,
        source_detector_m=1.2,
        source_object_m=0.785,
        pixel_size_m=DETECTOR_M / side,
        width=side,
        height=side,
    )


def ring_points() -> Array:
    """(181, 3) world metres: a circle about the origin that neither plane sees edge-on."""
    angles = np.linspace(0.0, 2.0 * np.pi, 181)
    flat = _DRAWING.radius_m * np.column_stack([np.cos(angles), np.sin(angles), np.zeros_like(angles)])
    return apply(rigid((0.9, 0.3, 0.2), (0.0, 0.0, 0.0)), flat)


def ring_image(
    plane: Plane,
    side: int,
    displacement_mm: Array,
    generator: np.random.Generator,
    projection: Projection | None = None,
) -> npt.NDArray[np.uint16]:
    """(side, side) uint16 of 12 bits: the ring with its electrodes, moved, dark on a noisy background.

    Args:
        plane: which view.
        side: pixels.
        displacement_mm: (3,) world millimetres.
        generator: of the noise.
        projection: another view than `ring_projection`.
    """
    projection = ring_projection(plane, side) if projection is None else projection
    curve = projection.project(ring_points() + 1e-3 * np.asarray(displacement_mm))
    picture = np.full((side, side), _DRAWING.background, np.uint8)
    bits = _DRAWING.subpixel_bits
    fixed = np.rint(curve * (1 << bits)).astype(np.int32)
    width = max(1, round(side / 256))
    cv2.polylines(picture, [fixed], True, _DRAWING.wire, width, cv2.LINE_AA, bits)
    for x, y in fixed[:: len(fixed) // _DRAWING.electrodes]:
        cv2.circle(picture, (int(x), int(y)), width << bits, _DRAWING.electrode, -1, cv2.LINE_AA, bits)
    noise = generator.standard_normal((side, side), dtype=np.float32) * np.float32(_DRAWING.noise)
    return np.clip(16.0 * picture + noise, 0.0, 4095.0).astype(np.uint16)


def ring_seed(side: int, displacement_mm: npt.ArrayLike = (0.0, 0.0, 0.0)) -> Seed:
    """Ten clicks a plane on the ring, moved by world millimetres."""
    moved = ring_points() + 1e-3 * np.asarray(displacement_mm, dtype=np.float64)
    clicks = {plane: ring_projection(plane, side).project(moved)[:-1:18] for plane in PLANES}
    return Seed(clicks["a"], clicks["b"])


def breath_mm(time_s: float, period_s: float = 4.0, depth_mm: float = 12.0) -> Array:
    """(3,) world millimetres: where the ring is in a regular breath that begins at rest."""
    phase = 0.5 - 0.5 * np.cos(2.0 * np.pi * time_s / period_s)
    return np.asarray(depth_mm * phase * np.array([0.1, 0.3, 0.9]))
