"""Surfaces and views whose images are known by formula, for the tests of the drawing."""

import numpy as np

from lasso_motion_ros.geometry.carm import carm_projection
from lasso_motion_ros.geometry.projection import Projection
from lasso_motion_ros.overlay.triangle_mesh import TriangleMesh

TORUS_RING_M, TORUS_TUBE_M = 0.022, 0.008


def grid_mesh(points, closed_v):
    """Triangles over a (U, V, 3) grid that is closed along u, and along v if said."""
    rows, columns = points.shape[:2]
    u, v = np.meshgrid(np.arange(rows), np.arange(columns if closed_v else columns - 1), indexing="ij")
    right, up = (u + 1) % rows, (v + 1) % columns
    a, b, c, d = (i * columns + j for i, j in ((u, v), (right, v), (right, up), (u, up)))
    triangles = np.concatenate([np.stack([a, b, c], -1).reshape(-1, 3), np.stack([a, c, d], -1).reshape(-1, 3)])
    flat = points.reshape(-1, 3)
    corners = flat[triangles]
    area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    return TriangleMesh(flat, triangles[area > 0.0].astype(np.int32))


def is_closed(mesh):
    """Whether every edge has as many triangles running along it as against it."""
    table = mesh.edges
    balance = np.bincount(table.of_triangle.ravel(), weights=table.direction.ravel(), minlength=len(table.ends))
    return bool(np.all(balance == 0.0))


def ellipsoid_mesh(radii_m, centre_m=(0.0, 0.0, 0.0), rows=160, columns=81):
    u = np.linspace(0.0, 2.0 * np.pi, rows, endpoint=False)[:, None]
    v = np.linspace(0.0, np.pi, columns)[None, :]
    unit = np.stack([np.cos(u) * np.sin(v), np.sin(u) * np.sin(v), np.cos(v) + 0.0 * u], axis=-1)
    return grid_mesh(np.asarray(centre_m) + unit * np.asarray(radii_m), closed_v=False)


def torus_mesh(rows=240, columns=80):
    u = np.linspace(0.0, 2.0 * np.pi, rows, endpoint=False)[:, None]
    v = np.linspace(0.0, 2.0 * np.pi, columns, endpoint=False)[None, :]
    ring = TORUS_RING_M + TORUS_TUBE_M * np.cos(v)
    return grid_mesh(
        np.stack([ring * np.cos(u), ring * np.sin(u), TORUS_TUBE_M * np.sin(v) + 0.0 * u], -1), closed_v=True
    )


def ellipsoid_outline(projection, radii_m, centre_m=(0.0, 0.0, 0.0), count=400):
    """(N, 2) pixels of an ellipsoid's outline: its dual quadric projects to the outline's dual conic (H&Z eq. 8.5)."""
    move = np.eye(4)
    move[:3, 3] = centre_m
    dual = projection.matrix @ move @ np.diag([*(np.asarray(radii_m) ** 2), -1.0]) @ move.T @ projection.matrix.T
    dual = dual / -dual[2, 2]
    centre = -dual[:2, 2]
    # For a dual conic scaled to −1 in its corner, centre² + block is the ellipse's covariance-like matrix.
    shape = dual[:2, :2] + np.outer(centre, centre)
    angle = np.linspace(0.0, 2.0 * np.pi, count, endpoint=False)
    return centre + np.stack([np.cos(angle), np.sin(angle)], axis=1) @ np.linalg.cholesky(shape).T


def torus_outline(projection, count=1500):
    """(N, 2) pixels where rays touch the torus: on each circle u, n·(X − source) = 0 has two solutions."""
    u = np.linspace(0.0, 2.0 * np.pi, count, endpoint=False)
    outward = np.stack([np.cos(u), np.sin(u), 0.0 * u], axis=1)
    to_ring = TORUS_RING_M * outward - projection.source
    a, b = (to_ring * outward).sum(axis=1), to_ring[:, 2]
    length = np.hypot(a, b)
    seen = length > TORUS_TUBE_M
    base, spread = np.arctan2(b, a)[seen], np.arccos(-TORUS_TUBE_M / length[seen])
    points = []
    for v in (base + spread, base - spread):
        normal = np.cos(v)[:, None] * outward[seen] + np.sin(v)[:, None] * np.array([0.0, 0.0, 1.0])
        points.append(TORUS_RING_M * outward[seen] + TORUS_TUBE_M * normal)
    return projection.project(np.concatenate(points))


def _carm(lao_deg, cranial_deg, **settings):
    settings = {"source_detector_m": 1.1, "source_object_m": 0.75, "pixel_size_m": 0.4e-3} | settings
    return carm_projection(np.radians(lao_deg), np.radians(cranial_deg), width=512, height=512, **settings)


def views():
    """Name → projection: every kind of view that the drawing must not depend on."""
    plain = _carm(0.0, 0.0)
    oblique = _carm(-30.0, 25.0, roll_rad=0.4)
    zoomed = _carm(60.0, 10.0, pixel_size_m=0.16e-3)
    return {
        "plain": plain,
        "unmirrored": _carm(0.0, 0.0, mirrored=False),
        "oblique": oblique,
        "oblique, sign flipped": Projection(-2.5 * oblique.matrix, 512, 512),
        "zoomed": zoomed,
        "binned": zoomed.cropped(31, 17, 480, 460).binned(2, 2),
        "off-centre": _carm(-20.0, -20.0, iso_centre=(0.02, 0.01, -0.015)),
    }
