"""Projection geometry of one X-ray plane: matrix, source, rays, and parts of an image.

A projection maps homogeneous world points (metres) to homogeneous pixels, x = P X, with P a 3×4 matrix
known up to scale *and sign*, possibly of a mirrored display (det of its left 3×3 block negative, or
K[0, 0] < 0). Nothing here depends on either. Formulas: Hartley and Zisserman, *Multiple View Geometry
in Computer Vision*, 2nd ed. 2004, chapter 6 (camera anatomy) and section 8.1 (back-projection).
"""

from __future__ import annotations

import math
from dataclasses import InitVar, dataclass, field
from functools import cached_property

import numpy as np
import numpy.typing as npt

from lasso_motion_ros.core.errors import GeometryError

Array = npt.NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Projection:
    """A finite projective camera, from world metres to the pixels of one image.

    The matrix is normalised on construction so that its third row measures depth: the distance in metres
    from the source along the central ray, positive on the side of the source where the world origin lies.

    Attributes:
        matrix: (3, 4) float64, of any scale and sign when given; normalised and read-only afterwards.
        width: image columns, pixels.
        height: image rows, pixels.
        detector_width: columns that an image of the whole detector would have at this image's pixel size; the image's
            own width unless given. Cropping keeps it, binning divides it, so lengths on the detector can be given as
            shares of it.

    Args:
        derived_from: for this class's own use: the projection from which this one differs by a shift and a scale of
            the pixels only, so that its matrix need not be checked or normalised again.

    Raises:
        GeometryError: wrong shape, non-finite or singular matrix, no image, or the world origin at the
            source's own depth (no side of it is then "in front").
    """

    matrix: Array
    width: int
    height: int
    detector_width: float = field(default=0.0, kw_only=True)
    derived_from: InitVar[Projection | None] = field(default=None, kw_only=True)

    def __post_init__(self, derived_from: Projection | None) -> None:
        if self.width < 1 or self.height < 1:
            raise GeometryError(f"an image has at least one pixel, found {self.width}×{self.height}")
        if derived_from is None:
            matrix = _normalised(np.asarray(self.matrix, dtype=np.float64))
        else:
            # A shift and a scale of the pixels keep rank, depth and source. Several are derived for each image pair.
            matrix = self.matrix
            object.__setattr__(self, "source", derived_from.source)
        matrix.setflags(write=False)
        object.__setattr__(self, "matrix", matrix)
        if self.detector_width == 0.0:
            object.__setattr__(self, "detector_width", float(self.width))

    @cached_property
    def source(self) -> Array:
        """(3,) X-ray source in world metres: the null vector of P (o = −M⁻¹ p₄; −Rᵀt for P = K[R|t])."""
        return np.asarray(-np.linalg.solve(self.matrix[:, :3], self.matrix[:, 3]))

    @cached_property
    def _inverse(self) -> Array:
        return np.asarray(np.linalg.inv(self.matrix[:, :3]))

    @cached_property
    def viewing_direction(self) -> Array:
        """(3,) unit vector from the source towards the detector, in the world frame."""
        return np.array(self.matrix[2, :3])

    @cached_property
    def focal_length_px(self) -> float:
        """Source–detector distance in pixels, the geometric mean of both image axes."""
        # |m1 × m3| and |m2 × m3| are the two axes' focal lengths when |m3| = 1 (H&Z 6.2.3).
        gram = self.matrix[:, :3] @ self.matrix[:, :3].T
        return float(((gram[0, 0] - gram[0, 2] ** 2) * (gram[1, 1] - gram[1, 2] ** 2)) ** 0.25)

    @cached_property
    def _rows(self) -> list[list[float]]:
        return self.matrix.tolist()  # type: ignore[no-any-return]

    def _homogeneous(self, point: Array) -> tuple[float, float, float]:
        """A world point (3,) times the matrix: written out, since numpy takes six times as long for so little."""
        x, y, z = point.tolist()
        (a, b, c, d), (e, f, g, h), (i, j, k, m) = self._rows
        return a * x + b * y + c * z + d, e * x + f * y + g * z + h, i * x + j * y + k * z + m

    def depth(self, points: Array) -> Array:
        """Depth of world points (..., 3) in metres along the central ray; shape (...)."""
        return np.asarray(np.asarray(points) @ self.matrix[2, :3] + self.matrix[2, 3])

    def project(self, points: Array) -> Array:
        """World points (..., 3) in metres to pixels (..., 2); a point at the source gives non-finite."""
        points = np.asarray(points, dtype=np.float64)
        if points.ndim == 1:
            x, y, depth = self._homogeneous(points)
            if depth != 0.0:
                return np.array([x / depth, y / depth])
        homogeneous = points @ self.matrix[:, :3].T + self.matrix[:, 3]
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.asarray(homogeneous[..., :2] / homogeneous[..., 2:])

    def jacobian(self, points: Array) -> Array:
        """Derivative of `project` by the point: world points (..., 3) to (..., 2, 3) pixels per metre."""
        points = np.asarray(points, dtype=np.float64)
        if points.ndim == 1:
            x, y, depth = self._homogeneous(points)
            (a, b, c, _), (d, e, f, _), (g, h, i, _) = self._rows
            if depth != 0.0:
                x, y = x / depth, y / depth
                along_x = [(a - x * g) / depth, (b - x * h) / depth, (c - x * i) / depth]
                return np.array([along_x, [(d - y * g) / depth, (e - y * h) / depth, (f - y * i) / depth]])
        pixels = self.project(points)
        numerator = self.matrix[:2, :3] - pixels[..., :, None] * self.matrix[2, :3]
        return np.asarray(numerator / self.depth(points)[..., None, None])

    def millimetres_per_pixel(self, point: Array) -> float:
        """Size of a pixel at a world point's depth, in mm (pixel pitch × source–object / source–detector)."""
        return 1e3 * self._homogeneous(np.asarray(point, dtype=np.float64))[2] / self.focal_length_px

    def rays(self, pixels: Array) -> Array:
        """Unit directions (..., 3) from the source through pixels (..., 2), pointing in front of it."""
        pixels = np.asarray(pixels, dtype=np.float64)
        homogeneous = np.concatenate([pixels, np.ones((*pixels.shape[:-1], 1))], axis=-1)
        # Of depth one, since the third row measures depth: in front of the source without further ado.
        directions = homogeneous @ self._inverse.T
        return np.asarray(directions / np.linalg.norm(directions, axis=-1, keepdims=True))

    def decompose(self) -> tuple[Array, Array, Array]:
        """Split the matrix as P = K [R | t].

        Returns:
            K (3, 3) upper triangular with K[2, 2] = 1 and K[1, 1] > 0; K[0, 0] is negative for a mirrored
            display. R (3, 3) a proper rotation, world to camera. t (3,) metres.
        """
        left = self.matrix[:, :3]
        # RQ decomposition from numpy's QR by reversing rows and columns.
        q, r = np.linalg.qr(np.flipud(left).T)
        k = np.flipud(np.fliplr(r.T))
        rotation = np.flipud(q.T)
        signs = np.sign(np.diag(k))
        signs[0] *= np.linalg.det(rotation) * np.prod(signs)  # keeps R proper; a mirror stays in K[0, 0]
        k, rotation = k * signs, signs[:, None] * rotation
        translation = np.linalg.solve(k, self.matrix[:, 3])
        return k / k[2, 2], rotation, translation

    def shifted(self, dx: float, dy: float) -> Projection:
        """The projection to the same image with its content moved by (dx, dy) pixels, right and down positive."""
        return self._resampled(-dx, -dy, 1, 1, self.width, self.height)

    def cropped(self, x: float, y: float, width: int, height: int) -> Projection:
        """The projection to a part of this image, whose first pixel is this image's pixel (x, y).

        Raises:
            GeometryError: no pixel is left, or a corner that is not finite.
        """
        return self._resampled(x, y, 1, 1, width, height)

    def binned(self, binning_x: int, binning_y: int) -> Projection:
        """The projection to this image with `binning_x` × `binning_y` of its pixels joined in one.

        Pixel i covers this image's pixels i·b … i·b + b − 1, so its centre is at i·b + (b − 1)/2. Columns and rows
        that fill no pixel are left out.

        Raises:
            GeometryError: no pixel is left, or a binning below one.
        """
        return self.read_out(0, 0, self.width, self.height, binning_x, binning_y)

    def read_out(self, x: float, y: float, width: int, height: int, binning_x: int, binning_y: int) -> Projection:
        """The projection to a part of this image, then binned: `cropped` and `binned` with one rounding.

        Args:
            x: first column of the part, in this image's pixels.
            y: first row of the part.
            width: columns of the part before binning.
            height: rows of the part before binning.
            binning_x: columns joined in one.
            binning_y: rows joined in one.

        Raises:
            GeometryError: no pixel is left, a binning below one, or a corner that is not finite.
        """
        if binning_x < 1 or binning_y < 1:
            raise GeometryError(f"binning joins at least one pixel, found {binning_x}×{binning_y}")
        return self._resampled(x, y, binning_x, binning_y, width // binning_x, height // binning_y)

    def _resampled(self, x: float, y: float, binning_x: int, binning_y: int, width: int, height: int) -> Projection:
        """The projection to `width` × `height` binned pixels from pixel (x, y) on."""
        if not (math.isfinite(x) and math.isfinite(y)):
            raise GeometryError(f"expected a finite place in the image, found ({x}, {y})")
        matrix = self.matrix.copy()
        matrix[0] = (matrix[0] - (x + (binning_x - 1) / 2.0) * matrix[2]) / binning_x
        matrix[1] = (matrix[1] - (y + (binning_y - 1) / 2.0) * matrix[2]) / binning_y
        made = Projection(matrix, width, height, detector_width=self.detector_width / binning_x, derived_from=self)
        object.__setattr__(made, "focal_length_px", self.focal_length_px / math.sqrt(binning_x * binning_y))
        return made


def _normalised(matrix: Array) -> Array:
    """A copy of the (3, 4) matrix whose third row measures depth; checked as `Projection` says."""
    if matrix.shape != (3, 4):
        raise GeometryError(f"a projection matrix is 3×4, found shape {matrix.shape}")
    if not np.all(np.isfinite(matrix)):
        raise GeometryError("the projection matrix has entries that are not finite")
    left = matrix[:, :3]
    row_norms = np.linalg.norm(left, axis=1)
    # Rows differ by the focal length in pixels; balanced rows make this a test of rank, not of units.
    if np.any(row_norms == 0.0) or abs(np.linalg.det(left / row_norms[:, None])) < 1e-9:
        raise GeometryError("the projection matrix is singular: its left 3×3 block has no inverse")
    if matrix[2, 3] == 0.0:
        raise GeometryError("the world origin lies at the source's depth: in front of it is undefined")
    return np.asarray(matrix * (np.sign(matrix[2, 3]) / row_norms[2]))
