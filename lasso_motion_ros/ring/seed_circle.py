"""The circle that the clicks and both images show best: where to begin, whatever the clicks are worth.

Ellipses through a user's clicks are many when the clicks are few or a millimetre off, or the loop is seen nearly
edge-on: two cones share two conics (`seeding/reconstruction.py`), and noise decides between them. A lasso is nearly a
circle, though, and what is dark along it is so in both images. So circles are tried: at first all that pass near the
clicks, then, about the best of them, those that most evidence in both planes lies on (a random search that narrows; its
numbers are the same each time).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache

import cv2
import numpy as np
import numpy.typing as npt

from lasso_motion_ros.core.compiled import has_kernels
from lasso_motion_ros.core.errors import GeometryError, ReconstructionError
from lasso_motion_ros.geometry.directions import axes_across, half_sphere
from lasso_motion_ros.geometry.frames import PLANES, Plane, Seed
from lasso_motion_ros.geometry.projection import Projection
from lasso_motion_ros.geometry.triangulation import triangulate
from lasso_motion_ros.ring.seed_images import SeedImages
from lasso_motion_ros.ring.working_image import Image, WorkingImage
from lasso_motion_ros.seeding.cones import Ellipse3D

Array = npt.NDArray[np.float64]


@dataclass(frozen=True)
class _Tuning:
    """How finely circles are searched, and what clicks are worth against images."""

    points: int = 48  # of a circle
    normals: int = 120  # over the half sphere: 15° apart
    radii_mm: tuple[float, ...] = (6.0, 7.5, 9.0, 11.0, 13.5, 16.0)
    kept: int = 24
    children: int = 5  # of each circle that is kept, a round
    # Standard deviation of what changes in a round (place, and radius along the normal, mm), rounds, and how many
    # circles go on: first by the clicks alone, then by images and clicks.
    by_clicks: tuple[float, int, int] = (1.5, 4, 16)
    by_images: tuple[tuple[float, int, int], ...] = ((1.0, 7, 10), (0.5, 7, 6), (0.25, 4, 6))
    settled_mm: float = 0.01  # at last each is followed to its own maximum, in steps down to this
    most_steps: int = 60
    largest_beside_mm2: float = 1.5  # mean squared distance of a plane's clicks: people click 0.25 mm beside the wire
    farthest_mm: float = 3.0  # what a click may count at most
    most_evidence: float = 1.5  # an electrode's; more of it in one place does not make up for none in others
    other_deg: float = 20.0  # between circles that are told apart


TUNING = _Tuning()
_SEED = 20090920  # of the random search
_TURN = 2.0 * np.pi * np.arange(TUNING.points) / TUNING.points
_AROUND = np.stack([np.ones(TUNING.points), np.cos(_TURN), np.sin(_TURN)], axis=1)  # (N, 3), of centre and two radii


def seed_circles(
    images: SeedImages, seed: Seed, shifts: dict[Plane, Array], click_penalty: float, *, count: int
) -> list[Ellipse3D]:
    """The circles nearest to what clicks and images show, the best first, each of another tilt.

    Those that the clicks lie far beside are none.

    Args:
        images: what was clicked.
        seed: the clicks.
        shifts: per plane, (2,) pixels by which its images lie off its calibration.
        click_penalty: of evidence, for a mean squared distance of the clicks of 1 mm².
        count: how many at most.

    Raises:
        ReconstructionError: the clicks' middles lie on no two rays that meet.
    """
    projections = tuple(images.projections[plane].shifted(*shifts[plane]) for plane in PLANES)
    try:
        centre = triangulate(projections, tuple(seed.points(plane).mean(axis=0) for plane in PLANES))
    except GeometryError as error:
        raise ReconstructionError(str(error)) from error
    seen = images.working(centre, shifts)
    views = _Views(
        [_View.of(seed.points(plane), one, seen[plane], centre) for plane, one in zip(PLANES, projections, strict=True)]
    )
    random = np.random.default_rng(_SEED)

    def by_clicks(circles: Array) -> Array:
        return np.asarray(-views.beside(circles).mean(axis=0))

    def by_images(circles: Array) -> Array:
        beside, shown = views.both(circles)
        inside = np.clip(shown.min(axis=0), 0.0, TUNING.most_evidence).mean(axis=1)
        return np.asarray(inside - click_penalty * beside.mean(axis=0))

    circles = np.hstack([np.tile(1e3 * centre, (len(_shapes()), 1)), _shapes()])
    circles = circles[np.argsort(-by_clicks(circles), kind="stable")[: TUNING.kept]]
    for worth, (step, rounds, kept) in ((by_clicks, TUNING.by_clicks), *((by_images, one) for one in TUNING.by_images)):
        best = worth(circles)
        for _ in range(rounds):
            tried = circles[:, None] + random.normal(0.0, step, (len(circles), TUNING.children, 6))
            found = worth(tried.reshape(-1, 6)).reshape(len(circles), -1)
            which = found.argmax(axis=1)
            is_better = found.max(axis=1) > best
            circles = np.where(is_better[:, None], tried[np.arange(len(circles)), which], circles)
            best = np.maximum(best, found.max(axis=1))
        circles = circles[np.argsort(-best, kind="stable")[:kept]]
    settled = [_settled(circle, by_images) for circle in _told_apart(circles)[:count]]
    farthest = [float(views.beside(circle[None]).max()) for circle in settled]
    return [_ellipse(one) for one, beside in zip(settled, farthest, strict=True) if beside <= TUNING.largest_beside_mm2]


@dataclass(frozen=True, eq=False)
class _View:
    """One plane: its clicks, and its evidence about them.

    Attributes:
        matrix: (3, 4) world metres to pixels from the clicks' middle.
        clicks: (C, 2) pixels from their middle.
        unit: millimetres per pixel at the ring.
        evidence: (h, w) attenuation, as `WorkingImage.evidence_about`.
        to_evidence: (3, 4) world metres to its pixels.
    """

    matrix: Array
    clicks: Array
    unit: float
    evidence: Image
    to_evidence: Array

    @classmethod
    def of(cls, clicks: Array, projection: Projection, image: WorkingImage, centre: Array) -> _View:
        """The view of a plane under the projection that its shift leads to; `centre` (3,) m is the ring's, roughly."""
        middle = clicks.mean(axis=0)
        points = projection.source + projection.depth(centre) * projection.rays(middle + 1.5 * (clicks - middle))
        evidence, corner = image.evidence_about(image.projection.project(points))
        return cls(
            _moved(projection.matrix, middle),
            clicks - middle,
            projection.millimetres_per_pixel(centre),
            evidence,
            _moved(image.projection.matrix, corner),
        )


class _Views:
    """Both planes, for many circles at once. Circles are (K, 6): centre, normal times radius; mm."""

    def __init__(self, views: list[_View]) -> None:
        self._views = views
        self._clicks = [np.column_stack([-2.0 * view.clicks, np.ones(len(view.clicks))]) for view in views]
        self._to_clicks = np.stack([view.matrix for view in views])
        self._to_all = np.concatenate([self._to_clicks, [view.to_evidence for view in views]])

    def beside(self, circles: Array) -> Array:
        """(2, K) mean squared distance of each plane's clicks from each circle, mm²."""
        return self._beside(_projected(circles, self._to_clicks))

    def both(self, circles: Array) -> tuple[Array, Image]:
        """The same, and (2, K, N) each plane's evidence along each circle; none outside of what was looked at."""
        pixels = _projected(circles, self._to_all)
        count = len(self._views)
        shown = [
            cv2.remap(view.evidence, x, y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_CONSTANT)
            for view, (x, y) in zip(self._views, pixels[count:].astype(np.float32), strict=True)
        ]
        return self._beside(pixels[:count]), np.ascontiguousarray(np.stack(shown).swapaxes(1, 2))

    def _beside(self, pixels: Array) -> Array:
        if has_kernels():
            from lasso_motion_ros.ring.kernels.seed import beside

            seen = zip(self._views, pixels, strict=True)
            return np.stack([beside(one, view.clicks, view.unit, TUNING.farthest_mm**2) for view, one in seen])
        means = []
        for view, clicks, (x, y) in zip(self._views, self._clicks, pixels, strict=True):
            # |p - c|² = |p|² + |c|² - 2 p · c: one product of matrices, for the many circles that are tried.
            squared = clicks @ np.stack([x, y, x * x + y * y]).reshape(3, -1)
            nearest = squared.reshape(-1, *x.shape).min(axis=1) + (view.clicks**2).sum(axis=1)[:, None]
            nearest = np.minimum(np.maximum(view.unit**2 * nearest, 0.0), TUNING.farthest_mm**2)
            means.append(nearest.mean(axis=0))
        return np.stack(means)


def _moved(matrix: Array, corner: Array) -> Array:
    """(3, 4) the projection to pixels that are counted from `corner` (2,)."""
    return np.vstack([matrix[:2] - corner[:, None] * matrix[2], matrix[2:]])


@cache
def _shapes() -> Array:
    """(K, 3) normals, evenly spread over half a sphere (a Fibonacci lattice), times radii, mm; not to be changed."""
    shapes = np.concatenate([radius * half_sphere(TUNING.normals) for radius in TUNING.radii_mm])
    shapes.setflags(write=False)
    return shapes


def _axes(circles: Array) -> tuple[Array, Array]:
    """(K, 3) two of each circle's radii, across each other, metres."""
    radius = np.linalg.norm(circles[:, 3:], axis=1, keepdims=True)
    first, second = axes_across(circles[:, 3:] / radius)
    return 1e-3 * radius * first, 1e-3 * radius * second


def _projected(circles: Array, matrices: Array) -> Array:
    """(M, 2, N, K) x and y of points along each circle under projections (M, 3, 4)."""
    world = np.empty((4, 3, len(circles)))  # homogeneous: the centre, and two radii
    world[:3, 0] = 1e-3 * circles[:, :3].T
    first, second = _axes(circles)
    world[:3, 1], world[:3, 2] = first.T, second.T
    world[3] = np.array([[1.0], [0.0], [0.0]])
    if has_kernels():
        from lasso_motion_ros.ring.kernels.seed import projected

        return np.stack([projected(world, matrix, _AROUND) for matrix in matrices])
    seen = _AROUND @ (matrices.reshape(-1, 4) @ world.reshape(4, -1)).reshape(-1, 3, len(circles))
    seen = seen.reshape(len(matrices), 3, TUNING.points, len(circles))
    return np.asarray(seen[:, :2] / seen[:, 2:])


def _settled(circle: Array, worth: Callable[[Array], Array]) -> Array:
    """A circle (6,) that no small step makes better: where the search ended by chance is not seen in it."""
    best, step = float(worth(circle[None])[0]), TUNING.by_images[-1][0]
    steps = np.vstack([np.eye(6), -np.eye(6)])
    for _ in range(TUNING.most_steps):
        tried = circle + step * steps
        found = worth(tried)
        if found.max() > best:
            circle, best = tried[found.argmax()], float(found.max())
        elif (step := 0.5 * step) < TUNING.settled_mm:
            break
    return circle


def _told_apart(circles: Array) -> list[Array]:
    """Of circles (K, 6), best first, those that are tilted otherwise than all before."""
    told: list[Array] = []
    nearest = np.cos(np.radians(TUNING.other_deg))
    for circle in circles:
        normal = circle[3:] / np.linalg.norm(circle[3:])
        if all(abs(normal @ other[3:]) < nearest * np.linalg.norm(other[3:]) for other in told):
            told.append(circle)
    return told


def _ellipse(circle: Array) -> Ellipse3D:
    first, second = _axes(circle[None])
    return Ellipse3D(1e-3 * circle[:3], first[0], second[0])
