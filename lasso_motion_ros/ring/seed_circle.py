"""The circle that the clicks and both images show best: where to begin, whatever the clicks are worth.

Ellipses through a user's clicks are many when the clicks are few or a millimetre off, or the loop is seen nearly
edge-on: two cones share two conics (`seeding/reconstruction.py`), and noise decides between them. A lasso is nearly a
circle, though, and what is dark along it is so in both images. So circles are tried: at first all that pass near the
clicks, then, about the best of them, those that most evidence in both planes lies on (a random search that narrows; its
numbers are the same each time).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cache

import cv2
import numpy as np
import numpy.typing as npt

from lasso_motion_ros.core.errors import GeometryError, ReconstructionError
from lasso_motion_ros.geometry.directions import axes_across, half_sphere
from lasso_motion_ros.geometry.frames import PLANES, Frame, Plane, Seed
from lasso_motion_ros.geometry.triangulation import triangulate
from lasso_motion_ros.ring.working_image import Image, WorkingImage, working_image
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


def seed_circles(
    frames: Mapping[Plane, Frame],
    seed: Seed,
    shifts: Mapping[Plane, Array],
    click_penalty: float,
    *,
    bright: bool,
    count: int,
) -> list[Ellipse3D]:
    """The circles nearest to what clicks and images show, the best first, each of another tilt.

    Those that the clicks lie far beside are none.

    Args:
        frames: the clicked images.
        seed: the clicks.
        shifts: per plane, (2,) pixels by which its images lie off its calibration.
        click_penalty: of evidence, for a mean squared distance of the clicks of 1 mm².
        bright: whether the catheter is brighter than its background.
        count: how many at most.

    Raises:
        ReconstructionError: the clicks' middles lie on no two rays that meet.
    """
    views = [_View(frames[plane], seed.points(plane), shifts[plane]) for plane in PLANES]
    try:
        centre = triangulate(
            tuple(view.projection for view in views), tuple(view.clicks.mean(axis=0) for view in views)
        )
    except GeometryError as error:
        raise ReconstructionError(str(error)) from error
    for view in views:
        view.look_about(centre, bright=bright)
    random = np.random.default_rng(_SEED)

    def by_clicks(circles: Array) -> Array:
        return np.asarray(-np.mean([view.beside(circles) for view in views], axis=0))

    def by_images(circles: Array) -> Array:
        shown = np.minimum(*(view.evidence(circles) for view in views))
        inside = np.clip(shown, 0.0, TUNING.most_evidence).mean(axis=1)
        return np.asarray(inside + click_penalty * by_clicks(circles))

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
    farthest = [max(float(view.beside(circle[None])[0]) for view in views) for circle in settled]
    return [_ellipse(one) for one, beside in zip(settled, farthest, strict=True) if beside <= TUNING.largest_beside_mm2]


class _View:
    """One plane: its clicks, and its evidence about them. Circles are (K, 6): centre, normal times radius; mm."""

    def __init__(self, frame: Frame, clicks: Array, shift: Array) -> None:
        self._frame, self._shift, self.clicks = frame, shift, clicks
        self._middle = clicks.mean(axis=0)
        self.projection = frame.projection.shifted(*shift)
        self._shown: tuple[WorkingImage, Image, Array] | None = None
        self._unit = 1.0

    def look_about(self, centre: Array, *, bright: bool) -> None:
        """Work out the evidence about the clicks; `centre` (3,) m is the ring's, roughly."""
        self._unit = self.projection.millimetres_per_pixel(centre)
        image = working_image(self._frame, centre, bright=bright, shift=self._shift)
        around = self.clicks.mean(axis=0) + 1.5 * (self.clicks - self.clicks.mean(axis=0))
        depth = self.projection.depth(centre)
        points = self.projection.source + depth * self.projection.rays(around)
        self._shown = (image, *image.evidence_about(image.projection.project(points)))

    def beside(self, circles: Array) -> Array:
        """(K,) mean squared distance of the clicks from each circle, mm²."""
        pixels = _projected(circles, self.projection.matrix) - self._middle
        clicks = self.clicks - self._middle
        # |p - c|² = |p|² + |c|² - 2 p · c: one product of matrices, for the many circles that are tried.
        squared = (pixels**2).sum(axis=-1)[..., None] - 2.0 * pixels @ clicks.T
        nearest = self._unit * np.sqrt(np.maximum(squared.min(axis=1) + (clicks**2).sum(axis=-1), 0.0))
        return np.asarray((np.minimum(nearest, TUNING.farthest_mm) ** 2).mean(axis=1))

    def evidence(self, circles: Array) -> Array:
        """(K, N) along each circle, as `WorkingImage.evidence_at`; none outside of what was looked at."""
        assert self._shown is not None  # noqa: S101 - for the type only
        image, evidence, corner = self._shown
        at = (_projected(circles, image.projection.matrix) - corner).astype(np.float32)
        return np.asarray(cv2.remap(evidence, at, None, cv2.INTER_LINEAR, borderMode=cv2.BORDER_CONSTANT))


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


def _projected(circles: Array, matrix: Array) -> Array:
    """(K, N, 2) pixels of points along each circle."""
    first, second = _axes(circles)
    turn = 2.0 * np.pi * np.arange(TUNING.points) / TUNING.points
    middle = 1e-3 * circles[:, :3] @ matrix[:, :3].T + matrix[:, 3]
    first, second = first @ matrix[:, :3].T, second @ matrix[:, :3].T
    homogeneous = (
        middle[:, None] + np.cos(turn)[None, :, None] * first[:, None] + np.sin(turn)[None, :, None] * second[:, None]
    )
    return np.asarray(homogeneous[..., :2] / homogeneous[..., 2:])


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
