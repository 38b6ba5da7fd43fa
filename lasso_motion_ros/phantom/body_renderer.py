"""Optical depth of the thorax in one plane: what stays is computed once per geometry, what moves every time."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
import numpy.typing as npt

from lasso_motion_ros.geometry.projection import Projection
from lasso_motion_ros.phantom.anatomy import TISSUE, Additive, Thorax
from lasso_motion_ros.phantom.bodies import Body, Rays, covering_grid, pixel_rays, rays_near, union_length
from lasso_motion_ros.phantom.tubes import Segments, optical_depth

Array = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Sampling:
    """How far apart the rays through the body lie.

    Attributes:
        coarse_side: pixels of the coarse grid along the image's longer side. Anatomy has no detail below half a
            millimetre, so its rays may lie further apart than the pixels.
        moving_binning: coarse pixels per ray and direction for what moves: lung borders are blurred by the heartbeat
            within an exposure and by partial volume, so their rays lie a millimetre apart.
        edge_blur_px: that blur (sigma), in pixels of the moving grid.
    """

    coarse_side: int = 256
    moving_binning: int = 2
    edge_blur_px: float = 0.6


SAMPLING = Sampling()


@dataclass(frozen=True, eq=False)
class BodyState:
    """Where the moving anatomy is at one instant, relative to end-expiration.

    Attributes:
        heart: (4, 4) rigid motion of the heart, breathing and heartbeat.
        contraction: 0 (diastole) to 1 (systole).
        breath: (3,) displacement of the heart by breathing alone, metres.
        depth: depth of the breath, 0 at end-expiration, about 1 at full inspiration.
    """

    heart: Array
    contraction: float
    breath: Array
    depth: float


class BodyRenderer:
    """Renders one thorax through one plane's geometry after another."""

    def __init__(self, thorax: Thorax) -> None:
        self._thorax = thorax
        self._vessels = _inside_lungs(thorax)
        self._key: tuple[bytes, int, int] | None = None
        self._rays: Rays | None = None  # of the moving part
        self._fixed = np.zeros((0, 0))
        self._ribs = np.zeros((0, 0))

    def optical_depth(self, projection: Projection, state: BodyState) -> npt.NDArray[np.float32]:
        """Line integral of the attenuation through every pixel, (H, W), dimensionless."""
        binning = max(1, max(projection.width, projection.height) // SAMPLING.coarse_side)
        coarse = covering_grid(projection, binning)
        rays = self._prepare(coarse)
        depth = self._fixed + self._shifted_ribs(coarse, state)
        depth += self._moving(coarse, rays, state)
        # Binned pixel i covers pixels i·b … i·b + b − 1: the convention of cv2.resize.
        size = (coarse.width * binning, coarse.height * binning)
        full = cv2.resize(depth.astype(np.float32), size, interpolation=cv2.INTER_CUBIC)
        return np.ascontiguousarray(full[: projection.height, : projection.width])

    def _prepare(self, coarse: Projection) -> Rays:
        key = (coarse.matrix.tobytes(), coarse.width, coarse.height)
        if key != self._key or self._rays is None:
            rays = pixel_rays(coarse)
            depth = TISSUE.soft * self._thorax.trunk.chord(rays) + _added(self._thorax.fixed, rays)
            self._fixed = depth.reshape(rays.shape) + optical_depth(coarse, self._thorax.airways, 1)
            self._ribs = optical_depth(coarse, self._thorax.ribs, 1)
            self._rays = pixel_rays(covering_grid(coarse, SAMPLING.moving_binning))
            self._key = key
        return self._rays

    def _shifted_ribs(self, coarse: Projection, state: BodyState) -> Array:
        # The chest rises by a tenth of what the heart descends; parallax within the rib cage is below a pixel.
        lift = np.array([0.0, 0.10 * state.breath[2], -0.08 * state.breath[2]])
        shift = coarse.project(lift) - coarse.project(np.zeros(3))
        matrix = np.array([[1.0, 0.0, shift[0]], [0.0, 1.0, shift[1]]])
        size = (coarse.width, coarse.height)
        return np.asarray(
            cv2.warpAffine(self._ribs, matrix, size, flags=cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
        )

    def _moving(self, coarse: Projection, rays: Rays, state: BodyState) -> Array:
        thorax = self._thorax
        dome_shift = np.array([0.0, 0.1, 1.25]) * state.breath
        # The ventricles shorten by a tenth; the left atrium fills while they do.
        heart = [
            body.moved(state.heart).scaled(1.0 + (0.03 if index == 0 else -0.08) * state.contraction)
            for index, body in enumerate(thorax.heart)
        ]
        vessels = [body.shifted(0.25 * state.breath) for body in thorax.great_vessels]
        solid = heart + vessels + [dome.shifted(dome_shift) for dome in thorax.domes]
        air = np.zeros(rays.directions.shape[1])
        for cavity in thorax.cavities:
            inside, covered = union_length(cavity, solid, rays)
            air += inside - covered
        # Breathing in thins the lung.
        lung = TISSUE.lung * (1.0 - 0.12 * min(state.depth, 1.5))
        depth = (lung - TISSUE.soft) * air
        depth += _added([Additive(part.body.moved(state.heart), part.attenuation) for part in thorax.heart_fat], rays)
        under = [Additive(part.body.shifted(dome_shift), part.attenuation) for part in thorax.under_diaphragm]
        depth += _added(under, rays)
        sigma, binning = SAMPLING.edge_blur_px, SAMPLING.moving_binning
        soft = cv2.GaussianBlur(depth.reshape(rays.shape), (0, 0), sigma, borderType=cv2.BORDER_REPLICATE)
        size = (rays.shape[1] * binning, rays.shape[0] * binning)
        image = cv2.resize(soft, size, interpolation=cv2.INTER_CUBIC)[: coarse.height, : coarse.width]
        start, end = (_lung_shift(points, state.breath) for points in (self._vessels.start, self._vessels.end))
        return np.asarray(image + optical_depth(coarse, self._vessels.moved_by(start, end), 1))


def _added(parts: list[Additive], rays: Rays) -> Array:
    """Optical depth (N,) of bodies that add to their surroundings."""
    depth = np.zeros(rays.directions.shape[1])
    for part in parts:
        near = rays_near(part.body, rays)
        if near.size:
            chosen = Rays(rays.source, rays.directions[:, near], (1, near.size))
            depth[near] += part.attenuation * part.body.chord(chosen)
    return depth


def _lung_shift(points: Array, breath: Array) -> Array:
    """The lung hangs at the top and follows the diaphragm at the bottom: (N, 3) displacements in metres."""
    share = np.clip(0.55 - points[:, 2] / 0.16, 0.1, 1.2)
    return np.asarray(share[:, None] * breath * np.array([1.0, 0.6, 1.0]))


def _inside_lungs(thorax: Thorax) -> Segments:
    """The vessel segments that lie in lung: inside a cavity, outside what displaces it."""
    vessels = thorax.lung_vessels
    middle = 0.5 * (vessels.start + vessels.end)
    kept = np.any([_contains(body, middle) for body in thorax.cavities], axis=0)
    for body in thorax.heart + thorax.great_vessels + thorax.domes:
        kept &= ~_contains(body, middle)
    return Segments(vessels.start[kept], vessels.end[kept], vessels.radius[kept], vessels.attenuation[kept])


def _contains(body: Body, points: Array) -> npt.NDArray[np.bool_]:
    local = (points - body.centre) @ np.linalg.inv(body.axes).T
    if body.cylinder:
        return np.asarray((np.hypot(local[:, 0], local[:, 1]) < 1.0) & (np.abs(local[:, 2]) < 1.0))
    return np.asarray(np.einsum("ni,ni->n", local, local) < 1.0)


def heart_surface_points(thorax: Thorax, count: int, random: np.random.Generator) -> Array:
    """(count, 3) points on the left atrium at end-expiration, metres, about evenly over its area."""
    atrium = thorax.heart[0]
    directions = random.normal(size=(count, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    return np.asarray(atrium.centre + directions @ atrium.axes.T)
