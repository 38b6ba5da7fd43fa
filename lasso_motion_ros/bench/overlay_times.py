"""Time to draw one plane's overlay: windowing, static and compensated surface, lasso and text."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from lasso_motion_ros.geometry import transforms
from lasso_motion_ros.geometry.carm import carm_projection
from lasso_motion_ros.geometry.projection import Projection
from lasso_motion_ros.overlay.atrium import left_atrium_surface
from lasso_motion_ros.overlay.painter import OverlayPainter

Array = npt.NDArray[np.float64]

SIDE_PX = 1024
GRID_STEP_MM = 1.31
PICTURES = 60
COVARIANCE = np.diag([0.5e-3] * 3 + [np.radians(0.3)] * 3) ** 2  # m, rad
_WARM_UP = 4


@dataclass(frozen=True)
class OverlayBenchmark:
    """What was measured, on one thread.

    Attributes:
        triangles: of the surface, a left atrium that fills a third of the picture.
        side_px: of the picture, 12 bits.
        pictures: how many were drawn, each with another motion.
        median_ms: of one plane's picture.
        p95_ms: its 95th percentile.
        moving_gantry_ms: median where the static place changes too, from picture to picture.
        band_ms: median where the band of 95 % of the error is drawn, as beside every pose with a covariance.
        processor_per_wall: processor time by wall time.
    """

    triangles: int
    side_px: int
    pictures: int
    median_ms: float
    p95_ms: float
    moving_gantry_ms: float
    band_ms: float
    processor_per_wall: float


def measure_overlay(pictures: int = PICTURES) -> OverlayBenchmark:
    """Draw a surface of 20,000 triangles over pictures of 1024²; the caller holds the thread pools at one."""
    mesh = left_atrium_surface(GRID_STEP_MM)
    image = np.random.default_rng(1).integers(200, 3800, (SIDE_PX, SIDE_PX)).astype(np.uint16)
    angle = np.linspace(0.0, 2.0 * np.pi, 65)
    ring = 0.011 * np.stack([np.cos(angle), np.sin(angle), 0.3 * np.sin(angle)], axis=1)
    painter = OverlayPainter(mesh)

    def draw(number: int, view: Projection, covariance: Array | None = None) -> None:
        motion = transforms.rigid((0.0, 0.0, 0.0), (0.0, 0.002, 0.012 * np.sin(0.2 * number)))
        painter.draw(image, view, motion, "", loop=transforms.apply(motion, ring), covariance=covariance)

    still = _view(0.0)
    for number in range(_WARM_UP):
        draw(number, still)
    wall, processor = _timed(lambda number: draw(number, still), pictures)
    turning, _ = _timed(lambda number: draw(number, _view(0.1 * (1 + number))), max(8, pictures // 4))
    banded, _ = _timed(lambda number: draw(number, still, COVARIANCE), max(8, pictures // 4))
    return OverlayBenchmark(
        triangles=len(mesh.triangles),
        side_px=SIDE_PX,
        pictures=pictures,
        median_ms=float(np.median(wall)),
        p95_ms=float(np.percentile(wall, 95)),
        moving_gantry_ms=float(np.median(turning)),
        band_ms=float(np.median(banded)),
        processor_per_wall=float(1e3 * processor / wall.sum()),
    )


def format_overlay(benchmark: OverlayBenchmark) -> str:
    """The figures as text."""
    moving = (
        f"while the gantry moves {benchmark.moving_gantry_ms:.1f} ms, with the error band {benchmark.band_ms:.1f} ms"
    )
    return (
        f"overlay, {benchmark.triangles} triangles on {benchmark.side_px}²: {benchmark.median_ms:.1f} ms a plane on "
        f"one thread (95 % within {benchmark.p95_ms:.1f} ms; {moving})"
    )


def _view(turned_deg: float) -> Projection:
    return carm_projection(
        np.radians(-30.0 + turned_deg),
        np.radians(5.0),
        source_detector_m=1.2,
        source_object_m=0.785,
        pixel_size_m=0.2e-3,
        width=SIDE_PX,
        height=SIDE_PX,
    )


def _timed(draw: Callable[[int], None], count: int) -> tuple[Array, float]:
    """(count,) milliseconds of each call, and the processor's seconds over all."""
    wall = np.zeros(count)
    processor = time.process_time()
    for number in range(count):
        begin = time.perf_counter()
        draw(number)
        wall[number] = 1e3 * (time.perf_counter() - begin)
    return wall, time.process_time() - processor
