"""The catheters: curves, electrodes, and how they follow the heart."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.interpolate import CubicSpline

from lasso_motion_ros.geometry.curves import arc_length, resample
from lasso_motion_ros.geometry.transforms import apply
from lasso_motion_ros.phantom.settings import LassoSettings
from lasso_motion_ros.phantom.tubes import Segments, chain, joined

Array = npt.NDArray[np.float64]

LOOP_POINTS = 90


@dataclass(frozen=True)
class CatheterMaterials:
    """Attenuation in excess of blood's, 1/m, and the lasso's radii, metres.

    Attenuation is the mean over the cylinder, of a polymer tube with its braid or core wire, or of a thin-walled
    platinum ring. Solid platinum would be opaque; real rings are 0.05 mm thin.

    Attributes:
        loop_shaft: the lasso's loop.
        loop_core: the wire inside it.
        shaft: the bodies of all catheters.
        core: their pull wires.
        ring: electrodes of the loop.
        large_ring: electrodes of the thicker catheters.
        tip: the ablation catheter's tip electrode.
        loop_radius_m: of the loop's shaft.
        loop_core_radius_m: of its core wire.
    """

    loop_shaft: float = 120.0
    loop_core: float = 700.0
    shaft: float = 55.0
    core: float = 330.0
    ring: float = 620.0
    large_ring: float = 400.0
    tip: float = 380.0
    loop_radius_m: float = 0.35e-3
    loop_core_radius_m: float = 0.18e-3


MATERIAL = CatheterMaterials()


@dataclass(frozen=True, eq=False)
class Loop:
    """The lasso's loop in the world, before any motion.

    Attributes:
        points: (90, 3) centreline, metres, from the tip to where the shaft leaves, evenly spaced.
        centre: (3,) mean of the points.
        normal: (3,) unit axis, pointing to where the shaft comes from.
        across: (3,) unit vector in the loop's plane.
    """

    points: Array
    centre: Array
    normal: Array
    across: Array


def build_loop(settings: LassoSettings, shaft_from: Array) -> Loop:
    """An open or overlapping, slightly helical ellipse with the settings' centre as the mean of its points.

    Args:
        settings: the scenario's.
        shaft_from: (3,) metres, where the shaft crosses the septum: the loop's shaft end lies on that side.
    """
    centre = np.asarray(settings.centre_mm) * 1e-3
    normal = np.asarray(settings.normal) / np.linalg.norm(settings.normal)
    if normal @ (shaft_from - centre) < 0.0:
        normal = -normal
    helper = np.eye(3)[np.argmin(np.abs(normal))]
    first = np.cross(normal, helper)
    first /= np.linalg.norm(first)
    second = np.cross(normal, first)
    angle = np.radians(settings.spin_deg) + np.linspace(0.0, 2.0 * np.pi * settings.turns, 721)
    part = np.linspace(0.0, 1.0, 721)
    radius = 0.5e-3 * settings.diameter_mm
    # An overlapping loop winds inside itself by a catheter's width.
    shrink = 1.0 - 0.06 * max(settings.turns - 1.0, 0.0) * (1.0 - part) * 4.0
    shrink = shrink * (1.0 + settings.bulge * np.cos(3.0 * angle))
    curve = (
        radius * (shrink * np.cos(angle))[:, None] * first
        + radius * settings.aspect * (shrink * np.sin(angle))[:, None] * second
        + 1e-3 * settings.helix_mm * (part - 0.5)[:, None] * normal
        + 1e-3 * settings.saddle_mm * np.cos(2.0 * angle)[:, None] * normal
    )
    points = resample(curve, LOOP_POINTS)
    return Loop(points + (centre - points.mean(axis=0)), centre, normal, first)


def deformed_loop(loop: Loop, tilt_rad: float, stretch: float) -> Array:
    """(90, 3) the loop tilted about its own in-plane axis and widened in its plane, about its own centre."""
    offset = loop.points - loop.centre
    along = offset @ loop.normal
    in_plane = offset - along[:, None] * loop.normal
    offset = in_plane * (1.0 + stretch) + along[:, None] * loop.normal
    axis, cosine, sine = loop.across, np.cos(tilt_rad), np.sin(tilt_rad)
    # Rodrigues' formula about the in-plane axis.
    turned = offset * cosine + np.cross(axis, offset) * sine + np.outer(offset @ axis, axis) * (1.0 - cosine)
    return np.asarray(loop.centre + turned)


def curve_length(curve: Array) -> float:
    """Length of a polyline (N, 3), metres."""
    return float(np.linalg.norm(np.diff(curve, axis=0), axis=1).sum())


def along_curve(curve: Array, at: Array) -> Array:
    """(K, 3) points at distances (K,) along a polyline (N, 3) from its first point."""
    length = arc_length(curve)
    return np.column_stack([np.interp(at, length, column) for column in curve.T])


def spline(knots: Array, spacing_m: float = 1.1e-3) -> Array:
    """(N, 3) points along the smooth curve through the knots (K, 3), evenly spaced."""
    length = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(knots, axis=0), axis=1) ** 0.5)])
    dense = CubicSpline(length, knots)(np.linspace(0.0, length[-1], 1500))
    total = float(np.linalg.norm(np.diff(dense, axis=0), axis=1).sum())
    return resample(np.asarray(dense), max(8, int(total / spacing_m)))


def electrode(curve: Array, at_m: float, length_m: float, radius_m: float, attenuation: float) -> Segments:
    """A flat-ended ring on a curve (N, 3), centred `at_m` along it from its first point."""
    distance = arc_length(curve)
    ends = [
        np.array([np.interp(at_m + half, distance, curve[:, axis]) for axis in range(3)])
        for half in (-0.5 * length_m, 0.5 * length_m)
    ]
    return chain(np.stack(ends), radius_m, attenuation)


def electrode_places(length_m: float, settings: LassoSettings) -> Array:
    """(E,) the electrodes' middles along the loop from its tip, metres; the last one lies at the shaft."""
    index = np.arange(settings.electrodes)
    # In pairs: within one by `pair_spacing`, from one to the next by 1.
    units = index // 2 + settings.pair_spacing * (index % 2)
    last = units[-1] if len(units) > 1 else 1.0
    return np.asarray(0.8e-3 + (length_m - 2.4e-3) * units / last)


def loop_segments(points: Array, settings: LassoSettings) -> Segments:
    """The loop's shaft (0.7 mm) with its ring electrodes, from its centreline (N, 3)."""
    fine = resample(points, 2 * LOOP_POINTS)
    places = electrode_places(curve_length(points), settings)
    return joined([wire_segments(fine, settings), electrode_segments(fine, places, settings)])


def wire_segments(points: Array, settings: LassoSettings) -> Segments:
    """The loop's shaft (0.7 mm) without electrodes, along a curve (N, 3)."""
    contrast = settings.contrast
    return joined(
        [
            chain(points, MATERIAL.loop_radius_m, contrast * MATERIAL.loop_shaft),
            chain(points, MATERIAL.loop_core_radius_m, contrast * MATERIAL.loop_core),
        ]
    )


def electrode_segments(curve: Array, places: Array, settings: LassoSettings) -> Segments:
    """The ring electrodes with their middles at distances (E,) along a curve (N, 3), metres."""
    size, radius = 1e-3 * settings.electrode_length_mm, 0.5e-3 * settings.electrode_diameter_mm
    return joined([electrode(curve, at, size, radius, settings.contrast * MATERIAL.ring) for at in places.tolist()])


def body_segments(curve: Array, radius_m: float) -> Segments:
    """A catheter's body along a curve (N, 3): a loaded polymer tube round a pull wire."""
    return joined([chain(curve, radius_m, MATERIAL.shaft), chain(curve, 0.2e-3, MATERIAL.core)])


# Knots in millimetres at end-expiration, with the share of the heart's motion each follows.
SEPTUM = np.array([-22.0, -6.0, -12.0]) * 1e-3
_CAVA = (((-30, -2, -62), 0.6), ((-31, 2, -120), 0.15), ((-30, 6, -190), 0.0))


def lasso_shaft(loop: Array, normal: Array, motion: Array) -> Array:
    """(N, 3) the shaft from the loop's end over the septum into the inferior vena cava.

    Args:
        loop: (90, 3) the loop now, metres.
        normal: (3,) its axis, pointing to where the shaft comes from.
        motion: (4, 4) the heart's motion from end-expiration.
    """
    end = loop[-1]
    tangent = (loop[-1] - loop[-3]) / np.linalg.norm(loop[-1] - loop[-3])
    middle = loop.mean(axis=0)
    knots = [end, end + 3.0e-3 * tangent + 2.0e-3 * normal, middle + 13.0e-3 * normal + 0.35 * (end - middle)]
    knots.append(apply(motion, SEPTUM))
    knots += [followed(np.asarray(place) * 1e-3, share, motion) for place, share in _CAVA]
    return spline(np.asarray(knots))


def followed(point: Array, share: float, motion: Array) -> Array:
    """A point (3,) that takes only a share of the heart's motion."""
    return np.asarray(point + share * (apply(motion, point) - point))


_SINUS = (
    ((-30, -26, 150), 0.0), ((-31, -18, 95), 0.15), ((-32, -14, 40), 0.6), ((-29, -12, -8), 1.0), ((-17, -3, -33), 1.0),
    ((4, 8, -34), 1.0), ((28, 6, -26), 1.0), ((46, -6, -15), 1.0), ((56, -20, -5), 1.0),
)  # fmt: skip


def coronary_sinus(motion: Array, contraction: float) -> Segments:
    """A decapolar 6F catheter from the superior vena cava along the groove below the left atrium."""
    knots = []
    for place, share in reversed(_SINUS):
        point = followed(np.asarray(place) * 1e-3, share, motion)
        # The groove between atrium and ventricle descends towards the apex in systole.
        knots.append(point + share * contraction * np.array([0.8e-3, -1.2e-3, -2.5e-3]))
    curve = spline(np.asarray(knots))
    parts = [body_segments(curve, 1.0e-3)]
    at = 1.2e-3
    for _pair in range(5):
        for within in range(2):
            parts.append(electrode(curve, at + 2.6e-3 * within, 1.2e-3, 1.06e-3, MATERIAL.large_ring))
        at += 8.2e-3
    return joined(parts)


def ablation(
    tip: Array, heading: Array, motion: Array, tip_length_m: float = 4.0e-3, tip_radius_m: float = 1.33e-3
) -> Segments:
    """An ablation catheter over the septum, its tip at `tip` (3,) m pointing along `heading` (3,)."""
    back = tip - 7.0e-3 * heading
    knots = [tip, 0.5 * (tip + back), back, back - 9.0e-3 * heading + 0.25 * (apply(motion, SEPTUM) - back)]
    knots.append(apply(motion, SEPTUM + np.array([2.0, 5.0, -5.0]) * 1e-3))
    knots += [followed(np.asarray(place) * 1e-3 + 4e-3, share, motion) for place, share in _CAVA]
    curve = spline(np.asarray(knots))
    body_radius = tip_radius_m - 0.08e-3
    parts = [body_segments(curve, body_radius)]
    parts.append(electrode(curve, 0.5 * tip_length_m, tip_length_m, tip_radius_m, MATERIAL.tip))
    for at in (6.0e-3, 9.5e-3, 12.8e-3):
        parts.append(electrode(curve, at, 1.3e-3, tip_radius_m - 0.05e-3, MATERIAL.large_ring))
    return joined(parts)
