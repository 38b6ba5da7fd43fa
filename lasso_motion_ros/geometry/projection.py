"""Projection geometry of one X-ray plane: matrix, source, rays, planes, and a C-arm's angles.

A projection maps homogeneous world points (metres) to homogeneous pixels, x = P X, with P a 3×4 matrix
known up to scale *and sign*, possibly of a mirrored display (det of its left 3×3 block negative, or
K[0, 0] < 0). Nothing here depends on either. Formulas: Hartley and Zisserman, *Multiple View Geometry
in Computer Vision*, 2nd ed. 2004, chapter 6 (camera anatomy) and section 8.1 (back-projection).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt

from lasso_motion_ros.core.errors import GeometryError

Array = npt.NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Projection:
    """A finite projective camera, from world metres to pixels of one image.

    The matrix is normalised on construction so that its third row measures depth: the distance in metres
    from the source along the central ray, positive on the side of the source where the world origin lies.

    Attributes:
        matrix: (3, 4) float64, any scale and sign when given; normalised afterwards.
        width: image columns, pixels.
        height: image rows, pixels.

    Raises:
        GeometryError: wrong shape, non-finite or singular matrix, no image, or the world origin at the
            source's own depth (no side of it is then "in front").
    """

    matrix: Array
    width: int
    height: int

    def __post_init__(self) -> None:
        matrix = np.asarray(self.matrix, dtype=np.float64)
        if matrix.shape != (3, 4):
            raise GeometryError(f"a projection matrix is 3×4, found shape {matrix.shape}")
        if not np.all(np.isfinite(matrix)):
            raise GeometryError("the projection matrix has entries that are not finite")
        _require_pixels(self.width, self.height)
        left = matrix[:, :3]
        row_norms = np.linalg.norm(left, axis=1)
        # Rows differ by the focal length in pixels; balanced rows make this a test of rank, not of units.
        if np.any(row_norms == 0.0) or abs(np.linalg.det(left / row_norms[:, None])) < 1e-9:
            raise GeometryError("the projection matrix is singular: its left 3×3 block has no inverse")
        if matrix[2, 3] == 0.0:
            raise GeometryError("the world origin lies at the source's depth: in front of it is undefined")
        matrix = matrix * (np.sign(matrix[2, 3]) / row_norms[2])
        matrix.setflags(write=False)
        object.__setattr__(self, "matrix", matrix)

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

    def depth(self, points: Array) -> Array:
        """Depth of world points (..., 3) in metres along the central ray; shape (...)."""
        return np.asarray(np.asarray(points) @ self.matrix[2, :3] + self.matrix[2, 3])

    def project(self, points: Array) -> Array:
        """World points (..., 3) in metres to pixels (..., 2); a point at the source gives non-finite."""
        homogeneous = np.asarray(points, dtype=np.float64) @ self.matrix[:, :3].T + self.matrix[:, 3]
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.asarray(homogeneous[..., :2] / homogeneous[..., 2:])

    def jacobian(self, points: Array) -> Array:
        """Derivative of `project` by the point: world points (..., 3) to (..., 2, 3) pixels per metre."""
        points = np.asarray(points, dtype=np.float64)
        pixels = self.project(points)
        numerator = self.matrix[:2, :3] - pixels[..., :, None] * self.matrix[2, :3]
        return np.asarray(numerator / self.depth(points)[..., None, None])

    def millimetres_per_pixel(self, point: Array) -> float:
        """Size of a pixel at a world point's depth, in mm (pixel pitch × source–object / source–detector)."""
        return float(1e3 * self.depth(point) / self.focal_length_px)

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

    def read_out(
        self, x_offset: float, y_offset: float, width: int, height: int, binning_x: int = 1, binning_y: int = 1
    ) -> Projection:
        """The projection of a cropped and binned read-out of this detector.

        Binned pixel i covers full pixels offset + i·b … offset + i·b + b − 1; its centre is offset + i·b
        + (b − 1)/2.

        Args:
            x_offset: first full-resolution column read out, pixels.
            y_offset: first full-resolution row read out, pixels.
            width: columns of the read-out image.
            height: rows of the read-out image.
            binning_x: full-resolution columns per published column.
            binning_y: full-resolution rows per published row.

        Raises:
            GeometryError: no pixel is read out.
        """
        _require_pixels(width, height)
        matrix = self.matrix.copy()
        matrix[0] = (matrix[0] - (x_offset + (binning_x - 1) / 2.0) * matrix[2]) / binning_x
        matrix[1] = (matrix[1] - (y_offset + (binning_y - 1) / 2.0) * matrix[2]) / binning_y
        matrix.setflags(write=False)
        # Several a pair: what holds of the detector's matrix holds of this one, and the source is the same.
        read_out = object.__new__(Projection)
        read_out.__dict__.update(matrix=matrix, width=width, height=height, source=self.source)
        return read_out


def _require_pixels(width: int, height: int) -> None:
    if width < 1 or height < 1:
        raise GeometryError(f"an image has at least one pixel, found {width}×{height}")


def carm_projection(
    lao_rad: float,
    cranial_rad: float,
    *,
    source_detector_m: float,
    source_object_m: float,
    pixel_size_m: float,
    width: int,
    height: int,
    mirrored: bool = True,
    iso_centre: npt.ArrayLike = (0.0, 0.0, 0.0),
    roll_rad: float = 0.0,
) -> Projection:
    """The projection of an ideal C-arm at the usual angles.

    World axes are the patient's, supine: +x to the left, +y posterior, +z cranial (LPS), metres.

    Args:
        lao_rad: rotation of the detector about the patient's long axis, LAO positive, RAO negative.
        cranial_rad: tilt of the detector, CRAN positive, CAUD negative.
        source_detector_m: source to detector (SID), metres.
        source_object_m: source to iso-centre (SOD), metres.
        pixel_size_m: detector pixel pitch, metres.
        width: image columns.
        height: image rows.
        mirrored: True for the usual display as seen facing the patient (patient's left at the image's right).
        iso_centre: (3,) iso-centre in the world frame, metres.
        roll_rad: rotation of the image about its centre, from +x towards +y.

    Raises:
        GeometryError: a distance or size that is not positive.
    """
    for name, value in (
        ("source_detector_m", source_detector_m),
        ("source_object_m", source_object_m),
        ("pixel_size_m", pixel_size_m),
    ):
        if not value > 0.0:
            raise GeometryError(f"{name} must be positive, found {value}")
    sin_a, cos_a = np.sin(lao_rad), np.cos(lao_rad)
    sin_b, cos_b = np.sin(cranial_rad), np.cos(cranial_rad)
    towards_detector = np.array([sin_a * cos_b, -cos_a * cos_b, sin_b])
    image_right = np.array([cos_a, sin_a, 0.0]) * (1.0 if mirrored else -1.0)
    image_down = np.array([sin_a * sin_b, -cos_a * sin_b, -cos_b])
    cos_r, sin_r = np.cos(roll_rad), np.sin(roll_rad)
    rows = np.stack(
        [
            cos_r * image_right - sin_r * image_down,
            sin_r * image_right + cos_r * image_down,
            towards_detector,
        ]
    )
    focal = source_detector_m / pixel_size_m
    camera = np.array([[focal, 0.0, (width - 1) / 2.0], [0.0, focal, (height - 1) / 2.0], [0.0, 0.0, 1.0]])
    origin = np.array([0.0, 0.0, source_object_m]) - rows @ np.asarray(iso_centre, dtype=np.float64)
    return Projection(camera @ np.column_stack([rows, origin]), width, height)


def triangulate(projections: tuple[Projection, ...], pixels: tuple[Array, ...]) -> Array:
    """World point (3,) in metres nearest to the rays through one pixel (2,) per view (least squares).

    Raises:
        GeometryError: the rays are parallel, so that no point is nearest.
    """
    normal, right = np.zeros((3, 3)), np.zeros(3)
    for projection, pixel in zip(projections, pixels, strict=True):
        ray = projection.rays(pixel)
        across = np.eye(3) - np.outer(ray, ray)
        normal += across
        right += across @ projection.source
    if np.linalg.cond(normal) > 1e8:
        raise GeometryError("the rays are parallel: no point lies nearest to them")
    return np.asarray(np.linalg.solve(normal, right))
