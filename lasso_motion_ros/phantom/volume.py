"""A CT volume given by the user as the patient's body, projected by sampling along the rays.

Needs the optional extra `volume` (SimpleITK, which reads NIfTI, NRRD and MHA and gives all of them in the LPS axes
used here). The volume's attenuation is that of its Hounsfield units; what lies about the heart is carried along with
breathing and heartbeat by a smooth warp, and only that part is sampled again for every picture.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
import numpy.typing as npt
from scipy.ndimage import map_coordinates

from lasso_motion_ros.core.errors import ScenarioError, VolumeError
from lasso_motion_ros.geometry.frames import PLANES, Plane
from lasso_motion_ros.geometry.projection import Projection
from lasso_motion_ros.geometry.volumes import read_volume_image
from lasso_motion_ros.phantom.anatomy import TISSUE
from lasso_motion_ros.phantom.bodies import Rays, covering_grid, pixel_rays
from lasso_motion_ros.phantom.body_renderer import BodyState

Array = npt.NDArray[np.float64]
Sampler = Callable[[Array], npt.NDArray[np.float32]]


@dataclass(frozen=True)
class Sampling:
    """How finely the volume is sampled, and how far about the origin it moves.

    Attributes:
        fixed_side: rays along the image's longer side through what stays.
        moving_side: the same through what moves, which is computed for every picture.
        step_m: between samples along a ray, metres.
        heart_radius_m: within it the heart moves as a whole, metres.
        fade_radius_m: from there to here the motion fades to nothing, metres.
        chunk_samples: samples taken at once, which bounds the memory.
    """

    fixed_side: int = 256
    moving_side: int = 128
    step_m: float = 1.5e-3
    heart_radius_m: float = 0.055
    fade_radius_m: float = 0.105
    chunk_samples: int = 4_000_000


SAMPLING = Sampling()


class Volume:
    """Attenuation on a regular grid, placed in the world.

    Args:
        attenuation: (Z, Y, X) linear attenuation, 1/m.
        to_index: (4, 4) world metres to array indices (z, y, x).
    """

    def __init__(self, attenuation: npt.NDArray[np.float32], to_index: Array) -> None:
        self.attenuation = attenuation
        self.to_index = to_index
        to_world = np.linalg.inv(to_index)
        corners = np.array(np.meshgrid(*[(-0.5, size - 0.5) for size in attenuation.shape])).reshape(3, -1).T
        world = corners @ to_world[:3, :3].T + to_world[:3, 3]
        self.centre = world.mean(axis=0)
        self.radius = float(np.linalg.norm(world - self.centre, axis=1).max())

    def sample(self, points: Array) -> npt.NDArray[np.float32]:
        """Attenuation at world points (3, N), trilinear, 0 outside."""
        index = self.to_index[:3, :3] @ points + self.to_index[:3, 3:]
        return np.asarray(map_coordinates(self.attenuation, index, order=1, mode="constant", cval=0.0))


class VolumeRenderer:
    """A volume as the body in one plane; the still part is kept per geometry."""

    def __init__(self, volume: Volume) -> None:
        self._volume = volume
        self._key: tuple[bytes, int, int] | None = None
        self._fixed: npt.NDArray[np.float32] = np.zeros((0, 0), np.float32)

    def optical_depth(self, projection: Projection, state: BodyState) -> npt.NDArray[np.float32]:
        """Line integral of the attenuation through every pixel, (H, W), dimensionless."""
        key = (projection.matrix.tobytes(), projection.width, projection.height)
        if key != self._key:
            self._fixed = self._on_grid(projection, SAMPLING.fixed_side, None)
            self._key = key
        return np.asarray(self._fixed + self._on_grid(projection, SAMPLING.moving_side, state), np.float32)

    def _on_grid(self, projection: Projection, side: int, state: BodyState | None) -> npt.NDArray[np.float32]:
        binning = max(1, max(projection.width, projection.height) // side)
        coarse = covering_grid(projection, binning)
        rays = pixel_rays(coarse)
        if state is None:
            depth = _integrate(rays, self._volume.centre, self._volume.radius, self._volume.sample)
        else:
            shift = state.heart[:3, 3]

            def change(points: Array) -> npt.NDArray[np.float32]:
                moved = points - _warp_weight(points) * shift[:, None]
                return np.asarray(self._volume.sample(moved) - self._volume.sample(points))

            depth = _integrate(rays, np.zeros(3), SAMPLING.fade_radius_m, change)
        image = depth.reshape(rays.shape).astype(np.float32)
        size = (coarse.width * binning, coarse.height * binning)
        full = cv2.resize(image, size, interpolation=cv2.INTER_CUBIC)
        return np.asarray(full[: projection.height, : projection.width], np.float32)


def volume_bodies(path: str | Path, centre_mm: npt.ArrayLike | None = None) -> dict[Plane, VolumeRenderer]:
    """The body in both planes, from a CT file.

    Args:
        path: NIfTI, NRRD or MHA, Hounsfield units.
        centre_mm: (3,) place of the left atrium in the file's LPS coordinates; the volume's middle if not given.

    Raises:
        ScenarioError: SimpleITK is not installed, the file cannot be read, or it is no CT volume.
    """
    volume = read_volume(path, centre_mm)
    return {plane: VolumeRenderer(volume) for plane in PLANES}


def read_volume(path: str | Path, centre_mm: npt.ArrayLike | None = None) -> Volume:
    """See `volume_bodies`."""
    try:
        image = read_volume_image(path)
    except VolumeError as error:
        raise ScenarioError(str(error)) from error
    hounsfield = np.asarray(image.values, dtype=np.float32)
    # Index (x, y, z) to LPS millimetres, then the chosen centre to the world's origin.
    to_lps = image.to_lps.copy()
    to_lps[:3] *= 1e3
    size = np.array(hounsfield.shape[::-1])
    extent_mm = 1e3 * size * image.spacing_m
    if not 50.0 <= extent_mm.max() <= 3000.0:
        raise ScenarioError(f"{path}: expected 50 to 3000 mm along the longest side, found {extent_mm.max():.4g} mm")
    middle = to_lps[:3, :3] @ (0.5 * (size - 1.0)) + to_lps[:3, 3]
    to_lps[:3, 3] -= middle if centre_mm is None else np.asarray(centre_mm, dtype=np.float64)
    to_lps[:3] *= 1e-3
    reverse = np.eye(4)[[2, 1, 0, 3]]
    attenuation = (TISSUE.soft * np.maximum(1.0 + hounsfield / 1000.0, 0.0)).astype(np.float32)
    return Volume(attenuation, reverse @ np.linalg.inv(to_lps))


def _integrate(rays: Rays, centre: Array, radius: float, value: Sampler) -> Array:
    """Midpoint rule along each ray's part inside a ball; (N,)."""
    middle = (centre - rays.source) @ rays.directions
    count = int(np.ceil(2.0 * radius / SAMPLING.step_m))
    depth = np.zeros(rays.directions.shape[1])
    nearest_squared = np.sum((centre - rays.source) ** 2) - middle**2
    hit = np.flatnonzero(nearest_squared < radius * radius)
    offsets = (np.arange(count) + 0.5) * SAMPLING.step_m - 0.5 * count * SAMPLING.step_m
    chunk = max(1, SAMPLING.chunk_samples // count)
    for first in range(0, hit.size, chunk):
        part = hit[first : first + chunk]
        distance = middle[part, None] + offsets
        points = rays.source[:, None, None] + rays.directions[:, part, None] * distance
        samples = value(points.reshape(3, -1))
        depth[part] = SAMPLING.step_m * samples.reshape(part.size, count).sum(axis=1)
    return depth


def _warp_weight(points: Array) -> Array:
    """1 inside the heart's radius, falling smoothly to 0; (N,) for world points (3, N)."""
    distance = np.sqrt(np.einsum("in,in->n", points, points))
    part = np.clip((SAMPLING.fade_radius_m - distance) / (SAMPLING.fade_radius_m - SAMPLING.heart_radius_m), 0.0, 1.0)
    return np.asarray(part * part * (3.0 - 2.0 * part))
