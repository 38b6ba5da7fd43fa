"""A left atrium from formulas, for demonstrations: body, four pulmonary veins, appendage.

Nothing in it is measured from a patient. The shape is an implicit surface: signed distances of simple bodies joined
by a smooth minimum (I. Quilez's polynomial form), which rounds the junctions as tissue does. Sizes follow the usual
adult ranges: a body 45–60 mm wide, ostia 14–20 mm. Axes are the patient's, LPS: +x left, +y posterior, +z cranial.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import numpy.typing as npt

from lasso_motion_ros.core.errors import SurfaceError
from lasso_motion_ros.overlay.isosurface import iso_surface
from lasso_motion_ros.overlay.triangle_mesh import TriangleMesh

Array = npt.NDArray[np.float64]


@dataclass(frozen=True)
class _Shape:
    """How finely and how smoothly the atrium is modelled.

    Attributes:
        grid_step_mm: spacing of the sampling grid; the default gives about 10,000 triangles.
        join_mm: how widely a vein's junction with the body is rounded.
        largest_bend_rad: the furthest a vein is bent from its usual course; a lasso may lie oblique in it.
    """

    grid_step_mm: float = 1.9
    join_mm: float = 6.0
    largest_bend_rad: float = float(np.radians(40.0))


_SHAPE = _Shape()


@dataclass(frozen=True)
class _Tube:
    """A vein's stub: ostium and direction in millimetres from the body's centre, radius, length outside the ostium."""

    ostium: tuple[float, float, float]
    direction: tuple[float, float, float]
    radius: float
    length: float = 13.0


_LEFT_SUPERIOR = _Tube((24.5, 9.0, 14.5), (0.80, 0.28, 0.53), 8.5, 14.0)
_VEINS = (
    _Tube((25.0, 12.5, -6.0), (0.84, 0.50, -0.20), 7.2),  # left inferior
    _Tube((-24.0, 6.5, 13.5), (-0.82, 0.05, 0.57), 8.6),  # right superior
    _Tube((-24.0, 13.0, -6.5), (-0.80, 0.56, -0.20), 7.6),  # right inferior
)
# The appendage: centres (mm) and radii of a chain that rises in front of the left superior vein and curls forward.
_APPENDAGE = (
    ((19.0, -10.0, 6.0), 8.0),
    ((28.0, -15.0, 9.0), 7.2),
    ((34.0, -22.0, 10.5), 6.4),
    ((34.5, -30.0, 8.0), 5.4),
    ((30.0, -35.5, 3.5), 3.8),
)


def left_atrium_surface(grid_step_mm: float = _SHAPE.grid_step_mm) -> TriangleMesh:
    """The atrium about the world origin (the centre of its body), metres, closed.

    Args:
        grid_step_mm: spacing of the sampling grid; the default gives about 10,000 triangles.
    """
    return _atrium(_LEFT_SUPERIOR, grid_step_mm)


def atrium_at_ostium(centre: npt.ArrayLike, normal: npt.ArrayLike, diameter_m: float) -> TriangleMesh:
    """The atrium placed so that the ostium of its left superior pulmonary vein is at a given place.

    The atrium stays upright in the patient's axes. Only that vein is bent towards the given normal, at most 40° from
    its usual course: a lasso may lie oblique in a vein, and the vein does not follow it.

    Args:
        centre: (3,) centre of the ostium, world metres (LPS axes).
        normal: (3,) the ostium's normal; its length and sign do not matter.
        diameter_m: the ostium's diameter, metres, 8–35 mm.

    Returns:
        The surface in world metres.

    Raises:
        SurfaceError: a diameter or normal that no vein has.
    """
    if not 0.008 <= diameter_m <= 0.035:
        raise SurfaceError(f"a vein's ostium is 8 to 35 mm wide, found {1e3 * diameter_m:.1f} mm")
    axis = np.asarray(normal, dtype=np.float64)
    length = float(np.linalg.norm(axis))
    if axis.shape != (3,) or not np.isfinite(length) or length == 0.0:
        raise SurfaceError(f"an ostium's normal is a finite vector with a length, found {normal!r}")
    usual = np.array(_LEFT_SUPERIOR.direction) / np.linalg.norm(_LEFT_SUPERIOR.direction)
    axis = axis / length if axis @ usual >= 0.0 else -axis / length
    vein = _Tube(
        _LEFT_SUPERIOR.ostium, _bent(usual, axis), radius=500.0 * diameter_m, length=max(14.0, 700.0 * diameter_m)
    )
    mesh = _atrium(vein)
    shift = np.asarray(centre, dtype=np.float64) - 1e-3 * np.array(vein.ostium)
    return TriangleMesh(mesh.vertices + shift, mesh.triangles)


def _bent(usual: Array, wanted: Array) -> tuple[float, float, float]:
    angle = float(np.arccos(np.clip(usual @ wanted, -1.0, 1.0)))
    if angle > _SHAPE.largest_bend_rad:
        across = wanted - (wanted @ usual) * usual
        across /= np.linalg.norm(across)
        wanted = np.cos(_SHAPE.largest_bend_rad) * usual + np.sin(_SHAPE.largest_bend_rad) * across
    x, y, z = wanted
    return float(x), float(y), float(z)


def _atrium(left_superior: _Tube, grid_step_mm: float = _SHAPE.grid_step_mm) -> TriangleMesh:
    reach = np.array([52.0, 48.0, 46.0])
    axes = [np.arange(-r, r + grid_step_mm, grid_step_mm) for r in reach]
    points = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1)
    distance = _signed_distance(points, left_superior)
    mesh = iso_surface(distance, 0.0, -1e-3 * reach, np.full(3, 1e-3 * grid_step_mm))
    # One Newton step puts the vertices, averages of their cells, onto the surface itself.
    at, step = 1e3 * mesh.vertices, 1e-2
    value = _signed_distance(at, left_superior)
    gradient = np.stack([(_signed_distance(at + step * e, left_superior) - value) / step for e in np.eye(3)], axis=1)
    at = at - value[:, None] * gradient / np.maximum((gradient**2).sum(axis=1, keepdims=True), 0.25)
    return TriangleMesh(1e-3 * at, mesh.triangles)


def _signed_distance(points: Array, left_superior: _Tube) -> Array:
    """About the distance (...) in mm of points (..., 3) from the wall, negative inside."""
    body = _ellipsoid(points, (0.0, 0.0, 0.0), (27.5, 20.0, 23.0))
    body = _join(body, _ellipsoid(points, (5.0, -9.0, -9.0), (20.0, 17.0, 18.0)), 8.0)  # towards the mitral valve
    outflow = np.array([0.45, -0.62, -0.64])
    valve = (points - np.array([9.0, -17.0, -19.0])) @ (outflow / np.linalg.norm(outflow))
    body = -_join(-body, -valve, 5.0)  # flattened by the valve's plane
    for vein in (left_superior, *_VEINS):
        body = _join(body, _stub(points, vein), _SHAPE.join_mm)
    appendage = np.full(points.shape[:-1], np.inf)
    for (start, r0), (end, r1) in pairwise(_APPENDAGE):
        appendage = np.minimum(appendage, _capsule(points, np.array(start), np.array(end), r0, r1))
    lobes = 0.55 * np.sin(points[..., 0] * 0.75) * np.sin(points[..., 1] * 0.7) * np.sin(points[..., 2] * 0.8)
    return _join(body, appendage + lobes, 3.5)


def _join(a: Array, b: Array, width: float) -> Array:
    """Smooth minimum: equals the smaller value where they differ by more than `width`."""
    blend = np.maximum(width - np.abs(a - b), 0.0) / width
    return np.asarray(np.minimum(a, b) - blend * blend * width / 4.0)


def _ellipsoid(points: Array, centre: tuple[float, float, float], radii: tuple[float, float, float]) -> Array:
    scaled = (points - np.array(centre)) / np.array(radii)
    length = np.linalg.norm(scaled, axis=-1)
    slope = np.linalg.norm(scaled / np.array(radii), axis=-1)
    return np.asarray(length * (length - 1.0) / np.maximum(slope, 1e-9))


def _capsule(points: Array, start: Array, end: Array, start_radius: float, end_radius: float) -> Array:
    axis = end - start
    along = np.clip(((points - start) @ axis) / (axis @ axis), 0.0, 1.0)
    nearest = start + along[..., None] * axis
    return np.asarray(np.linalg.norm(points - nearest, axis=-1) - (start_radius + along * (end_radius - start_radius)))


def _stub(points: Array, vein: _Tube) -> Array:
    """A vein from inside the body to its cut end, a little wider at the ostium (its funnel) than beyond it."""
    direction = np.array(vein.direction) / np.linalg.norm(vein.direction)
    ostium = np.array(vein.ostium)
    along = (points - ostium) @ direction
    across = np.linalg.norm(points - ostium - along[..., None] * direction, axis=-1)
    radius = vein.radius * (0.92 + 0.08 * np.clip(1.0 - along / vein.length, 0.0, 2.0))
    side = across - radius
    ends = np.abs(along - 0.5 * (vein.length - 14.0)) - 0.5 * (vein.length + 14.0)
    return -_join(-side, -ends, 3.0)
