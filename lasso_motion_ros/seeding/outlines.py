"""From a user's clicks to outlines: polarity of the catheter, the path along the loop in each plane."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.interpolate import splev, splprep

from lasso_motion_ros.config.tracker import TrackerConfig
from lasso_motion_ros.core.errors import SeedError
from lasso_motion_ros.geometry.frames import PLANES, FramePair, Plane, Seed
from lasso_motion_ros.geometry.projection import Projection
from lasso_motion_ros.seeding.line_filter import sato
from lasso_motion_ros.seeding.minimal_path import path_through_clicks

Array = npt.NDArray[np.float64]


@dataclass(frozen=True)
class _Tuning:
    """Which clicks are accepted.

    Attributes:
        fewest_clicks: for a plane; an ellipse needs as many points.
        smallest_radius_mm: of a lasso. Catheters of 15 to 25 mm diameter are made; a projection whose scale is wrong is
            further off than both limits.
        largest_radius_mm: likewise.
        click_reach_px: a click may be this far beside the line.
        smallest_sigma_px: scale of the line filter; below it the sampled kernel is no Gaussian.
        click_spread_mm: standard deviation of clicks about the loop, each way.
        curve_points: of a smooth curve through the clicks.
    """

    fewest_clicks: int = 6
    smallest_radius_mm: float = 3.0
    largest_radius_mm: float = 30.0
    click_reach_px: int = 4
    smallest_sigma_px: float = 0.8
    click_spread_mm: float = 0.25
    curve_points: int = 200


TUNING = _Tuning()


def require_both_planes(pair: FramePair) -> dict[Plane, Projection]:
    """The pair's projections.

    Raises:
        SeedError: a plane is missing, so that no 3-D model can be built on this pair.
    """
    missing = [plane.upper() for plane in pair.missing]
    if missing:
        raise SeedError(f"the clicked pair lacks plane {' and '.join(missing)}; both planes are needed for a seed")
    return {plane: frame.projection for plane, frame in pair.frames.items()}


def line_sigma_px(projection: Projection, sigma_mm: float) -> float:
    """A line filter's scale in pixels of an image, from millimetres at the world origin's depth."""
    return max(TUNING.smallest_sigma_px, sigma_mm / projection.millimetres_per_pixel(np.zeros(3)))


def is_bright(pair: FramePair, seed: Seed, config: TrackerConfig) -> bool:
    """Whether the catheter is brighter than its background: as configured, or (auto) as the clicks show."""
    if config.polarity != "auto":
        return config.polarity == "bright"
    evidence = 0.0
    for plane, frame in pair.frames.items():
        sigma = line_sigma_px(frame.projection, config.path.line_sigma_mm)
        height, width = frame.pixels.shape
        for x, y in np.rint(seed.points(plane)).astype(int):
            if not (0 <= x < width and 0 <= y < height):
                continue
            # Clicks are a few pixels off: the strongest line nearby speaks for each.
            reach = TUNING.click_reach_px + int(np.ceil(4.0 * sigma))
            left, top = max(x - reach, 0), max(y - reach, 0)
            grey = frame.pixels[top : y + reach + 1, left : x + reach + 1].astype(np.float32)
            near = np.s_[
                max(y - TUNING.click_reach_px, 0) - top : y + TUNING.click_reach_px + 1 - top,
                max(x - TUNING.click_reach_px, 0) - left : x + TUNING.click_reach_px + 1 - left,
            ]
            dark, bright = float(sato(grey, (sigma,))[near].max()), float(sato(-grey, (sigma,))[near].max())
            evidence += (bright - dark) / max(dark + bright, 1e-6)
    return evidence > 0.0


def is_lasso_size(radius_mm: float) -> bool:
    """Whether lassos are as large as that."""
    return TUNING.smallest_radius_mm <= radius_mm <= TUNING.largest_radius_mm


def require_lasso_size(radius_mm: float) -> None:
    """Refuse a loop that no lasso has the size of.

    Raises:
        SeedError: clicks beside it, or not along it, or a calibration that is not in metres.
    """
    low, high = TUNING.smallest_radius_mm, TUNING.largest_radius_mm
    if not is_lasso_size(radius_mm):
        raise SeedError(
            f"the clicks make a loop of {radius_mm:.1f} mm radius, expected {low:g} to {high:g} mm: "
            "were they set along the lasso in both planes?"
        )


def outlines(pair: FramePair, seed: Seed, config: TrackerConfig, *, bright: bool) -> dict[Plane, Array]:
    """The loop in each plane, (M, 2) pixels from the first click to the last, by minimal paths.

    Raises:
        SeedError: a missing plane, fewer than six clicks, a click outside its image, or clicks so close together that
            they cannot go round a loop.
    """
    paths: dict[Plane, Array] = {}
    for plane in PLANES:
        frame, clicks = pair.frame(plane), seed.points(plane)
        if frame is None:
            raise SeedError(f"the clicked pair lacks plane {plane.upper()}; both planes are needed for a seed")
        if len(clicks) < TUNING.fewest_clicks:
            raise SeedError(f"plane {plane.upper()}: {len(clicks)} clicks, expected at least {TUNING.fewest_clicks}")
        try:
            paths[plane] = path_through_clicks(
                frame.pixels,
                clicks,
                bright=bright,
                sigma_px=line_sigma_px(frame.projection, config.path.line_sigma_mm),
                cost_floor=config.path.cost_floor,
            )
        except SeedError as error:
            raise SeedError(f"plane {plane.upper()}: {error}") from error
        # Even edge-on a loop spans its diameter; the world origin is near enough to tell a millimetre there.
        span_mm = frame.projection.millimetres_per_pixel(np.zeros(3)) * float(np.hypot(*np.ptp(clicks, axis=0)))
        if span_mm < 2.0 * TUNING.smallest_radius_mm:
            raise SeedError(
                f"plane {plane.upper()}: the clicks span {span_mm:.1f} mm, expected at least "
                f"{2.0 * TUNING.smallest_radius_mm:g} mm: were they set along the whole lasso?"
            )
    return paths


def curves_through_clicks(seed: Seed, projections: Mapping[Plane, Projection]) -> dict[Plane, Array]:
    """The loop in each plane, (M, 2) pixels from the first click to the last, as a smooth curve.

    Where noise outweighs the wire, a minimal path wanders from click to click, and the clicks alone tell more. (A
    smoothing spline: Dierckx, "Curve and Surface Fitting with Splines", 1993.)

    Args:
        seed: the clicks, six or more a plane.
        projections: world metres to pixels: what the smoothing is, in pixels.
    """
    curves: dict[Plane, Array] = {}
    for plane in PLANES:
        clicks = seed.points(plane)
        clicks = clicks[np.append(True, np.any(np.diff(clicks, axis=0) != 0.0, axis=1))]  # a double click is one
        spread_px = TUNING.click_spread_mm / projections[plane].millimetres_per_pixel(np.zeros(3))
        spline, _ = splprep(clicks.T, s=len(clicks) * spread_px**2, k=min(3, len(clicks) - 1))
        curves[plane] = np.stack(splev(np.linspace(0.0, 1.0, TUNING.curve_points), spline), axis=1)
    return curves
