"""The anatomy that the overlay draws: a surface, or a volume's surface or projection, read from a file."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

from lasso_motion_ros.config.overlay import OverlayConfig
from lasso_motion_ros.core.errors import ConfigurationError, LassoMotionError, VolumeError
from lasso_motion_ros.geometry import transforms
from lasso_motion_ros.geometry.volumes import VolumeImage, is_volume, read_volume_image
from lasso_motion_ros.overlay.surface_files import METRES_PER_UNIT, read_surface
from lasso_motion_ros.overlay.triangle_mesh import TriangleMesh, clean_mesh
from lasso_motion_ros.overlay.volume_cloud import VolumeCloud, volume_cloud
from lasso_motion_ros.overlay.volume_registration import read_registration

Array = npt.NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class ReferenceAnatomy:
    """The anatomy where it was at the reference pair, in world coordinates.

    Attributes:
        surface: its surface, world metres.
        cloud: drawn instead of the surface where a volume is shown as a projection; else None.
        description: what was read and how it was interpreted, one line for the user.
    """

    surface: TriangleMesh
    cloud: VolumeCloud | None
    description: str

    @property
    def drawn(self) -> TriangleMesh | VolumeCloud:
        """What the painter draws."""
        return self.surface if self.cloud is None else self.cloud


def read_reference_anatomy(config: OverlayConfig) -> ReferenceAnatomy:
    """Read the file that `volume_file` names and place it by `registration`.

    Raises:
        ConfigurationError: no file is named, or the registration is not rigid.
        SurfaceError: a surface that cannot be read, or a volume without one.
        VolumeError: a volume that cannot be read.
    """
    if not config.volume_file:
        raise ConfigurationError("volume_file: the surface or volume to draw must be given")
    to_world = read_registration(config.registration)
    path = Path(config.volume_file)
    if not is_volume(path):
        mesh = read_surface(path, config.units, config.axes)
        # Reported, so that wrong axes or a wrong unit show up in the log.
        low, high = mesh.vertices.min(axis=0), mesh.vertices.max(axis=0)
        axes = f"taken as {config.axes.upper()}" if config.axes else "axes as the file states them, else LPS"
        words = f"{path.name}: surface, coordinates in {config.units}, {axes}"
        return ReferenceAnatomy(mesh.moved(to_world), None, f"{words}, {_extent(high - low)}, {_triangles(mesh)}")
    if config.axes:
        raise ConfigurationError(f"axes: {path.name} states its own axes; axes is for surfaces")
    try:
        return _from_volume(path, config, to_world)
    except LassoMotionError as error:
        if str(path) in str(error):
            raise
        raise type(error)(f"{path}: {error}") from error


def _from_volume(path: Path, config: OverlayConfig, to_world: Array) -> ReferenceAnatomy:
    from lasso_motion_ros.overlay.vtk_bridge import label_surface, level_surface

    units = config.units or "mm"
    image = read_volume_image(path, METRES_PER_UNIT[units])
    level, label, most = config.volume.level, config.volume.label, config.volume.triangles
    low, high = float(image.values.min()), float(image.values.max())
    if label > 0:
        what = f"label {label}"
        inside = image.values == label
        if not inside.any():
            raise VolumeError(f"no voxel has the label {label}: the values are {low:g} to {high:g}")
        found = label_surface(image.values, label, image.spacing_m, most)
    else:
        what = f"at {level:g} of {low:g} to {high:g}"
        inside = image.values >= level
        if not low < level <= high:
            raise VolumeError(f"volume.level {level:g} lies outside of the values, {low:g} to {high:g}")
        found = level_surface(image.values, level, image.spacing_m, most)
    mesh = _placed(image, *found).moved(to_world)
    cloud = volume_cloud(image, inside).moved(to_world) if config.volume.display == "projection" else None
    words = (
        f"{path.name}: volume in {units}, its axes turned to LPS, {what}, "
        f"{_extent(image.spacing_m * np.array(image.values.shape[::-1]))}"
    )
    shown = _triangles(mesh) if cloud is None else f"{len(cloud.points)} blocks"
    return ReferenceAnatomy(mesh, cloud, f"{words}, {shown}")


def _placed(image: VolumeImage, index: Array, triangles: npt.NDArray[np.int64]) -> TriangleMesh:
    return clean_mesh(transforms.apply(image.to_lps, index), triangles)


def _extent(size_m: Array) -> str:
    return " × ".join(f"{1e3 * value:.0f}" for value in size_m) + " mm"


def _triangles(mesh: TriangleMesh) -> str:
    return f"{len(mesh.triangles)} triangles"
