"""A volume drawn as a projection: the thickness that each ray crosses, as translucent colour.

The visible part is a cloud of small bodies, one for each block of voxels. Projecting them exactly and adding up their
volumes in a coarse grid over the image is fast enough to be done for every new motion; sampling along every ray is
not.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
import numpy.typing as npt

from lasso_motion_ros.core.errors import VolumeError
from lasso_motion_ros.geometry import transforms
from lasso_motion_ros.geometry.projection import Projection
from lasso_motion_ros.geometry.volumes import VolumeImage
from lasso_motion_ros.overlay.compositing import TUNING as LOOKS
from lasso_motion_ros.overlay.compositing import AlphaMask, band
from lasso_motion_ros.overlay.style import OverlayStyle

Array = npt.NDArray[np.float64]


@dataclass(frozen=True)
class _Tuning:
    """How a cloud is made and drawn.

    Attributes:
        most_points: upper bound on the number of bodies, so that a cloud is drawn anew for each image in time.
        nearest_depth_m: bodies nearer to the source are not drawn.
        rim_blocks: thickness, in spacings of the cloud, at which the outline is drawn.
        smallest_cell_px: smallest side of a grid cell, pixels of the image.
        largest_cell_px: largest side of a grid cell, pixels of the image.
    """

    most_points: int = 60_000
    nearest_depth_m: float = 0.05
    rim_blocks: float = 2.0
    smallest_cell_px: int = 2
    largest_cell_px: int = 32


_CLOUD = _Tuning()


@dataclass(frozen=True, eq=False)
class VolumeCloud:
    """The visible part of a volume as small bodies.

    Attributes:
        points: (N, 3) their centres, metres.
        sizes: (N,) their volumes, cubic metres.
        spacing_m: largest distance between neighbours.
    """

    points: Array
    sizes: Array
    spacing_m: float

    def moved(self, transform: Array) -> VolumeCloud:
        """The cloud after a rigid (4, 4) transform."""
        return VolumeCloud(transforms.apply(transform, self.points), self.sizes, self.spacing_m)


def volume_cloud(image: VolumeImage, inside: npt.NDArray[np.bool_]) -> VolumeCloud:
    """The voxels that are `inside`, joined to blocks until there are at most 60,000.

    Args:
        image: the volume; the cloud is in its patient axes, metres.
        inside: (Z, Y, X) which of its voxels are shown.

    Raises:
        VolumeError: no voxel is shown.
    """
    count = int(inside.sum())
    if count == 0:
        raise VolumeError("no voxel lies at this level or label")
    step = 1
    while True:
        blocks = _block_sums(inside, step)
        filled = np.argwhere(blocks > 0.0)
        if len(filled) <= _CLOUD.most_points:
            break
        step += 1
    # The middle of a block of voxels, index (x, y, z).
    index = np.asarray(filled[:, ::-1] * step + (step - 1) / 2.0, dtype=np.float64)
    voxel = abs(float(np.linalg.det(image.to_lps[:3, :3])))
    return VolumeCloud(
        transforms.apply(image.to_lps, index),
        np.asarray(blocks[tuple(filled.T)] * voxel, dtype=np.float64),
        step * float(image.spacing_m.max()),
    )


def cloud_mask(
    cloud: VolumeCloud, projection: Projection, transform: Array, style: OverlayStyle, width_px: float, faint: bool
) -> AlphaMask:
    """The projection of a cloud that was moved by `transform`, as opacity.

    Args:
        cloud: in the frame that `transform` maps to the world.
        projection: world to pixels.
        transform: (4, 4) rigid.
        style: what is drawn; the outline is where rays begin to cross two of the cloud's spacings.
        width_px: the outline's width in this picture, pixels.
        faint: drawn fainter, to stand behind another drawing.
    """
    cell, thickness = _thickness(cloud, projection, transform)
    rows, columns = np.flatnonzero(thickness.any(axis=1)), np.flatnonzero(thickness.any(axis=0))
    if rows.size == 0:
        return AlphaMask(np.zeros((0, 0), dtype=np.uint8), 0, 0)
    # With a margin of empty cells, so that the edge fades out as it would in the whole picture.
    top, left = max(0, int(rows[0]) - 2), max(0, int(columns[0]) - 2)
    seen = thickness[top : int(rows[-1]) + 3, left : int(columns[-1]) + 3]
    full = cv2.resize(seen, (seen.shape[1] * cell, seen.shape[0] * cell), interpolation=cv2.INTER_LINEAR)
    opacity = np.zeros(full.shape, dtype=np.uint8)
    if style.fill:
        densest = 2.0 * style.fill_opacity * (LOOKS.faint_fill if faint else 1.0)
        shade = cv2.exp(full * np.float32(-np.log(2.0) / style.projection_depth_m))
        opacity = cv2.convertScaleAbs(np.minimum(densest * (1.0 - shade), LOOKS.densest), alpha=255.0)
    if style.outline:
        # Blocks and cells widen the rim by about one of them; where rays cross two, the line is back on the true rim.
        coverage = np.clip((full / cloud.spacing_m - _CLOUD.rim_blocks) * cell + 0.5, 0.0, 1.0)
        line = band(cv2.convertScaleAbs(coverage, alpha=255.0), max(1, round(width_px / 2.0)))
        opacity = cv2.max(opacity, cv2.convertScaleAbs(line, alpha=LOOKS.faint_line if faint else 1.0))
    return AlphaMask(np.asarray(opacity, dtype=np.uint8), left * cell, top * cell)


def _thickness(cloud: VolumeCloud, projection: Projection, transform: Array) -> tuple[int, npt.NDArray[np.float32]]:
    """Side of a cell in pixels, and the thickness (h, w) in metres crossed by the rays through the cells' middles."""
    homogeneous = cloud.points @ (projection.matrix[:, :3] @ transform[:3, :3]).T + projection.matrix @ transform[:, 3]
    depth = homogeneous[:, 2]
    middle = max(float(np.median(depth)), _CLOUD.nearest_depth_m)
    reach = cloud.spacing_m * projection.focal_length_px / middle
    cell = int(np.clip(np.ceil(reach), _CLOUD.smallest_cell_px, _CLOUD.largest_cell_px))
    width, height = -(-projection.width // cell), -(-projection.height // cell)
    in_front = np.maximum(depth, _CLOUD.nearest_depth_m)
    # Cells' middles at integers, one cell of margin for what lies half outside.
    x, y = ((homogeneous[:, axis] / in_front + 0.5) / cell + 0.5 for axis in (0, 1))
    seen = np.flatnonzero(
        (depth > _CLOUD.nearest_depth_m) & (x >= 0.0) & (y >= 0.0) & (x < width + 1) & (y < height + 1)
    )
    x, y = x[seen], y[seen]
    column, row = x.astype(np.int64), y.astype(np.int64)
    right, down = x - column, y - row
    area = (cell / projection.focal_length_px * in_front[seen]) ** 2
    weight = cloud.sizes[seen] / area
    stride = width + 2
    first = row * stride + column
    total = np.zeros(stride * (height + 2))
    for offset, share in (
        (0, (1.0 - right) * (1.0 - down)),
        (1, right * (1.0 - down)),
        (stride, (1.0 - right) * down),
        (stride + 1, right * down),
    ):
        total += np.bincount(first + offset, weights=weight * share, minlength=len(total))
    grid = total.reshape(height + 2, stride)[1:-1, 1:-1].astype(np.float32)
    # A cell's and a block's edges beat against each other; a blur of half a cell evens that out.
    return cell, np.asarray(cv2.GaussianBlur(grid, (3, 3), 0.5), dtype=np.float32)


def _block_sums(inside: npt.NDArray[np.bool_], step: int) -> npt.NDArray[np.float32]:
    if step == 1:
        return inside.astype(np.float32)
    padded = np.pad(inside, [(0, -size % step) for size in inside.shape])
    z, y, x = (size // step for size in padded.shape)
    sums = padded.reshape(z, step, y, step, x, step).sum(axis=(1, 3, 5), dtype=np.float32)
    return np.asarray(sums, dtype=np.float32)
