"""The image that search and alignment work on: reduced, band-passed, in units of its local noise."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cache, cached_property

import cv2
import numpy as np
import numpy.typing as npt

from lasso_motion_ros.core.compiled import has_kernels
from lasso_motion_ros.geometry.frames import Frame, Plane
from lasso_motion_ros.geometry.projection import Projection

Array = npt.NDArray[np.float64]
Image = npt.NDArray[np.float32]
Grey = npt.NDArray[np.uint16]
Pixels = npt.NDArray[np.uint8] | npt.NDArray[np.uint16]

# The grid that search and alignment share. Chosen for catheters: a loop's wire is 0.4–0.8 mm wide, an electrode 1–2 mm
# long.
PIXEL_MM = 0.25
CELL_PX = 2  # of a search cell: half a millimetre at the loop


@dataclass(frozen=True)
class _Tuning:
    """What is as fine as a catheter, as wide as an electrode, and how noise is told from it."""

    fine_sigma_px: float = 0.8
    fine_kernel_px: tuple[int, int] = (5, 5)
    # What changes slowly is worked out in cells, at a third of the time; the coarse scale is 3.7 working pixels in all.
    coarse_sigma_cells: float = 1.88
    coarse_kernel_cells: tuple[int, int] = (9, 9)
    noise_window_cells: tuple[int, int] = (31, 31)
    clip: float = 4.0  # in units of the local noise: what is denser is no better a catheter
    # Of evidence: differences of Gaussians as wide as an electrode, with kernels to three standard deviations.
    evidence_fine_px: float = 1.8
    evidence_fine_kernel_px: tuple[int, int] = (11, 11)
    # With the cells' own width and the interpolation between them 5.4 working pixels in all.
    evidence_coarse_cells: float = 2.65
    evidence_coarse_kernel_cells: tuple[int, int] = (17, 17)
    evidence_window_px: tuple[int, int] = (33, 33)
    evidence_floor: float = 1e-8  # of the mean square there: where nothing is, nothing is divided
    evidence_reach_px: int = 28  # what lies further from a pixel changes its evidence by 0.003 at most
    evidence_range: tuple[float, float] = (-1.0, 2.0)
    soft_box_px: tuple[int, int] = (7, 7)  # twice: nearly a Gaussian of 2.8 pixels


TUNING = _Tuning()
NOISE_WINDOW_PX = CELL_PX * TUNING.noise_window_cells[0]
SOFT_REACH_MM = 2 * (TUNING.soft_box_px[0] // 2) * PIXEL_MM


@dataclass(frozen=True, eq=False)
class WorkingImage:
    """A plane's image at about a quarter of a millimetre per pixel at the loop.

    Attributes:
        values: (h, w) float32, band-passed and divided by the local root mean square, clipped to ±4: positive
            on the catheter whatever its polarity. Equal weight to both planes and to bright and dark regions
            follows from that division.
        projection: world metres to *these* pixels.
        noise: (h, w) float32, the local root mean square by which was divided, grey values.
        grey: (h, w) uint16, the reduced image.
        bright: whether the catheter is brighter than its background.
    """

    values: Image
    projection: Projection
    noise: Image
    grey: Grey
    bright: bool = False

    @cached_property
    def cells(self) -> Image:
        """(h // CELL_PX, w // CELL_PX) means of the values, for the search."""
        return in_cells(self.values)

    def evidence_at(self, pixels: Array) -> Image:
        """(N,) attenuation as wide as an electrode at pixels (N, 2), relative to its local root mean square; -1 to 2.

        Bilinear, and zero outside the image. Worked out for the pixels' surroundings only, on which it rests.
        """
        if not np.isfinite(pixels).all():
            return np.zeros(len(pixels), dtype=np.float32)
        if has_kernels():
            from lasso_motion_ros.ring.kernels import band as kernels

            shown: Image = kernels.evidence_at(
                self.grey, pixels, CELL_PX, TUNING.evidence_reach_px, *_scales(self.bright)
            )
            if shown.size == len(pixels):
                return shown
        evidence, corner = self.evidence_about(pixels)
        if evidence.size == 0:
            return np.zeros(len(pixels), dtype=np.float32)
        x, y = (pixels - corner).astype(np.float32).T
        return np.asarray(cv2.remap(evidence, x, y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_CONSTANT)).reshape(-1)

    def evidence_about(self, pixels: Array) -> tuple[Image, Array]:
        """The same as an image (h, w) of the surroundings of pixels (N, 2), finite, and the pixel (2,) of its corner.

        It is empty where they lie outside the image.
        """
        grey, corner = self._grey_about(pixels)
        return (_evidence(grey, self.bright) if grey.size else np.zeros((0, 0), dtype=np.float32)), corner

    def _grey_about(self, pixels: Array) -> tuple[Grey, Array]:
        """The surroundings (h, w) of pixels (N, 2) on which their evidence rests, and the pixel (2,) of its corner."""
        height, width = self.grey.shape
        # Whole cells of the image's grid: a part of it shows what the whole does.
        left, top = (
            max(0, math.floor((v - TUNING.evidence_reach_px) / CELL_PX) * CELL_PX) for v in pixels.min(axis=0).tolist()
        )
        right, bottom = (
            min(side, math.ceil((v + TUNING.evidence_reach_px + 1) / CELL_PX) * CELL_PX)
            for v, side in zip(pixels.max(axis=0).tolist(), (width, height), strict=True)
        )
        return self.grey[max(top, 0) : max(bottom, 0), left : max(right, 0)], np.array([left, top], dtype=np.float64)

    def about(self, points: Array, reach_mm: float) -> WorkingImage:
        """The part of it that shows some world points (N, 3) m and what lies within a reach of them, there."""
        pixels = self.projection.project(points)
        reach_px = reach_mm / self.projection.millimetres_per_pixel(points.mean(axis=0))
        size = np.array(self.values.shape[::-1])
        left, top = np.clip(np.floor(pixels.min(axis=0) - reach_px), 0, size - 1).astype(int)
        right, bottom = np.clip(np.ceil(pixels.max(axis=0) + reach_px), 0, size - 1).astype(int) + 1
        part = slice(top, bottom), slice(left, right)
        projection = self.projection.cropped(left, top, right - left, bottom - top)
        return WorkingImage(self.values[part], projection, self.noise[part], self.grey[part], self.bright)

    def softened(self) -> WorkingImage:
        """The same, blurred: an alignment finds its way in it from further off."""
        return replace(self, values=softened(self.values))

    def contrast_unit(self, centre: Array) -> float:
        """What 1 in `values` is about a world point (3,) m, as a share of the grey there."""
        (x, y), half = self.projection.project(centre).tolist(), NOISE_WINDOW_PX // 2
        if has_kernels():
            from lasso_motion_ros.ring.kernels.band import contrast_unit

            return float(contrast_unit(self.noise, self.grey, x, y, half))
        height, width = self.noise.shape
        x, y = (min(max(round(v), 0), side - 1) for v, side in ((x, width), (y, height)))
        grey = cv2.mean(self.grey[max(y - half, 0) : y + half + 1, max(x - half, 0) : x + half + 1])[0]
        return float(self.noise[y, x]) / max(grey, 1.0)


def softened(values: Image) -> Image:
    """Values (h, w), blurred by three quarters of a millimetre."""
    once = cv2.blur(values, TUNING.soft_box_px, borderType=cv2.BORDER_REPLICATE)
    return np.asarray(cv2.blur(once, TUNING.soft_box_px, borderType=cv2.BORDER_REPLICATE))


def reduction_factor(projection: Projection, centre: Array) -> int:
    """How many pixels of the full image make one working pixel at a world point's depth."""
    return max(1, round(PIXEL_MM / projection.millimetres_per_pixel(centre)))


def working_image(
    frame: Frame, centre: Array, *, bright: bool, shift: Array, reach_mm: float | None = None
) -> WorkingImage:
    """Reduce and band-pass a frame, or a square of it.

    Args:
        frame: the plane's frame.
        centre: (3,) where the loop is about, world metres.
        bright: True where the catheter is brighter than its background.
        shift: (2,) pixels by which this plane's images lie off its calibration, absorbed at the seed.
        reach_mm: half the side of the square about the projected centre, millimetres there; None: all of it.
    """
    projection = frame.projection.shifted(*shift)
    factor = reduction_factor(projection, centre)
    height, width = frame.pixels.shape
    left, top, right, bottom = 0, 0, width, height
    if reach_mm is not None:
        reach = reach_mm / projection.millimetres_per_pixel(centre)
        x, y = projection.project(centre)
        left, right = (int(min(max(v, 0.0), width)) for v in (x - reach, x + reach))
        top, bottom = (int(min(max(v, 0.0), height)) for v in (y - reach, y + reach))
    # Whole cells of the whole image's grid: a part of it looks as it does in the whole.
    cell = CELL_PX * factor
    left, top = left // cell * cell, top // cell * cell
    width = CELL_PX * min(-(-(right - left) // cell), (frame.pixels.shape[1] - left) // cell)
    height = CELL_PX * min(-(-(bottom - top) // cell), (frame.pixels.shape[0] - top) // cell)
    if min(width, height) < 2 * NOISE_WINDOW_PX:
        return (
            working_image(frame, centre, bright=bright, shift=shift)
            if reach_mm is not None
            else _blank(projection, factor)
        )
    reduced = _reduced(frame.pixels, left, top, width, height, factor)
    values, noise = _band_pass(reduced, bright)
    seen = projection.read_out(left, top, width * factor, height * factor, factor, factor)
    return WorkingImage(values, seen, noise, reduced, bright)


def _reduced(pixels: Pixels, left: int, top: int, width: int, height: int, factor: int) -> Grey:
    """A part of an image from (left, top) on, reduced to (height, width); whatever it comes as, it is one kind then."""
    if factor == 2 and pixels.dtype == np.uint16 and pixels.flags.c_contiguous and has_kernels():
        from lasso_motion_ros.ring.kernels import band as kernels

        halved: Grey = kernels.halved(np.asarray(pixels, np.uint16), left, top, width, height)
        return halved
    cropped = pixels[top : top + height * factor, left : left + width * factor]
    reduced = cropped if factor == 1 else cv2.resize(cropped, (width, height), interpolation=cv2.INTER_AREA)
    return reduced.astype(np.uint16, order="C", copy=False)


class WholeImages:
    """Whole working images of some planes' frames, for any shift: the filters do not depend on it, and work once.

    Args:
        frames: per plane.

    Attributes:
        frames: as given.
    """

    def __init__(self, frames: Mapping[Plane, Frame]) -> None:
        self.frames = frames
        self._made: dict[tuple[Plane, bool, int], WorkingImage] = {}  # by polarity, and how much the frame was reduced

    def at(self, plane: Plane, centre: Array, shift: Array, *, bright: bool) -> WorkingImage:
        """What `working_image` gives of a plane for a centre (3,) m and a shift (2,) px."""
        frame = self.frames[plane]
        shifted = frame.projection.shifted(*shift)
        factor = reduction_factor(shifted, centre)
        made = self._made.get((plane, bright, factor))
        if made is None:
            made = working_image(frame, centre, bright=bright, shift=shift)
            self._made[plane, bright, factor] = made
        height, width = made.values.shape
        return replace(made, projection=shifted.read_out(0, 0, width * factor, height * factor, factor, factor))


def _band_pass(reduced: Grey, bright: bool) -> tuple[Image, Image]:
    """What is as fine as a catheter, relative to the local noise, and that noise.

    In few buffers, since fresh memory costs more time than the arithmetic on it.
    """
    if has_kernels():
        from lasso_motion_ros.ring.kernels import band as kernels

        taps = blur_taps(TUNING.fine_kernel_px[0], TUNING.fine_sigma_px)
        cells_taps = blur_taps(TUNING.coarse_kernel_cells[0], TUNING.coarse_sigma_cells)
        made: tuple[Image, Image] = kernels.band_passed(reduced, taps, cells_taps, bright, TUNING.clip)
        return made
    grey = reduced.astype(np.float32)
    size = reduced.shape[::-1]
    # A constant area (collimator, saturation) has no noise to divide by and stays zero.
    floor = 1e-6 * max(1.0, float(reduced.max()))
    fine = cv2.GaussianBlur(grey, TUNING.fine_kernel_px, TUNING.fine_sigma_px)
    slow = cv2.GaussianBlur(in_cells(grey), TUNING.coarse_kernel_cells, TUNING.coarse_sigma_cells)
    coarse = cv2.resize(slow, size, dst=grey, interpolation=cv2.INTER_LINEAR)
    band = cv2.subtract(fine, coarse, dst=fine) if bright else cv2.subtract(coarse, fine, dst=fine)
    power = cv2.blur(
        in_cells(cv2.multiply(band, band, dst=coarse)), TUNING.noise_window_cells, borderType=cv2.BORDER_REFLECT
    )
    noise = cv2.resize(cv2.sqrt(cv2.max(power, floor)), size, dst=coarse, interpolation=cv2.INTER_LINEAR)
    np.divide(band, noise, out=band)
    return _clipped(band, -TUNING.clip, TUNING.clip), np.asarray(noise)


def _evidence(grey: Grey, bright: bool) -> Image:
    """(h, w) attenuation as wide as an electrode, relative to its local root mean square.

    In the logarithm of the grey values attenuation adds up and the dose is a constant. The clip holds every device to
    what an electrode may count: a bigger or denser one is no better an electrode.
    """
    if has_kernels() and min(grey.shape) > TUNING.evidence_window_px[0] // 2:
        from lasso_motion_ros.ring.kernels import band as kernels

        shown: Image = kernels.evidence(grey, *_scales(bright))
        return shown
    fine, slow = _log_scales(grey)
    coarse = cv2.resize(slow, grey.shape[::-1], interpolation=cv2.INTER_LINEAR)
    band = cv2.subtract(fine, coarse, dst=fine) if bright else cv2.subtract(coarse, fine, dst=fine)
    power = cv2.blur(cv2.multiply(band, band, dst=coarse), TUNING.evidence_window_px, borderType=cv2.BORDER_REFLECT)
    noise = cv2.sqrt(cv2.max(power, TUNING.evidence_floor, dst=power), dst=power)
    return _clipped(np.divide(band, noise, out=band), *TUNING.evidence_range)


def _scales(bright: bool) -> tuple[Image, Image, Image, bool, float, float, float]:
    """What the compiled evidence is told besides the image."""
    fine = blur_taps(TUNING.evidence_fine_kernel_px[0], TUNING.evidence_fine_px)
    coarse = blur_taps(TUNING.evidence_coarse_kernel_cells[0], TUNING.evidence_coarse_cells)
    return grey_logarithms(), fine, coarse, bright, TUNING.evidence_floor, *TUNING.evidence_range


@cache
def grey_logarithms() -> Image:
    """(2^16,) the logarithm of each grey value that an image may have; of 0 that of 1."""
    greys = np.arange(1 << 16, dtype=np.float32)
    logarithms: Image = cv2.log(np.maximum(greys, np.float32(1.0))).reshape(-1)
    logarithms.flags.writeable = False
    return logarithms


def _log_scales(grey: Grey) -> tuple[Image, Image]:
    """Logarithm of grey values (h, w), blurred to an electrode's width; and in cells (h // 2, w // 2), blurred more."""
    values = grey.astype(np.float32)
    logarithm = cv2.log(cv2.max(values, 1.0, dst=values), dst=values)
    fine = cv2.GaussianBlur(logarithm, TUNING.evidence_fine_kernel_px, TUNING.evidence_fine_px)
    slow = cv2.GaussianBlur(in_cells(logarithm), TUNING.evidence_coarse_kernel_cells, TUNING.evidence_coarse_cells)
    return fine, slow


@cache
def blur_taps(count: int, sigma_px: float) -> Image:
    """Of a Gaussian blur, from the middle one of so many on."""
    taps: Image = cv2.getGaussianKernel(count, sigma_px, cv2.CV_32F)[count // 2 :, 0].copy()
    return taps


def _clipped(values: Image, lowest: float, highest: float) -> Image:
    """Values (h, w), changed in place, held in a range: numpy's takes twice as long."""
    return np.asarray(cv2.min(cv2.max(values, lowest, dst=values), highest, dst=values))


def in_cells(values: Image) -> Image:
    """Means (h // CELL_PX, w // CELL_PX) of values (h, w); what does not fill a cell is left out."""
    height, width = (size // CELL_PX for size in values.shape)
    whole = values[: height * CELL_PX, : width * CELL_PX]
    return np.asarray(cv2.resize(whole, (width, height), interpolation=cv2.INTER_AREA))


def _blank(projection: Projection, factor: int) -> WorkingImage:
    """An image too small to show a loop: nothing is found in it."""
    size = 2 * NOISE_WINDOW_PX
    nothing = np.zeros((size, size), dtype=np.float32)
    seen = projection.read_out(0, 0, size * factor, size * factor, factor, factor)
    return WorkingImage(nothing, seen, nothing, nothing.astype(np.uint16))
