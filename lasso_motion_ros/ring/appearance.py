"""What the loop looks like: a strip of the working image along its curve, one per plane.

A strip follows the projected curve; its columns are offsets along the curve's normal in the image. It holds
the electrodes' pattern, so that it tells the lasso from other wires, and where along the curve one is.
"""

from __future__ import annotations

import copy
from dataclasses import dataclass

import cv2
import numpy as np
import numpy.typing as npt

from lasso_motion_ros.geometry.curves import quarter_turn, slope, unit_tangents
from lasso_motion_ros.geometry.projection import Projection
from lasso_motion_ros.ring.working_image import PIXEL_MM, Image, WorkingImage, softened

Array = npt.NDArray[np.float64]

MARGIN_COLUMNS = 2
MEDIAN_OF_SQUARED_NORMAL = 0.455  # of a standard normal variable
NOISE_SHARE = 0.25  # for alignment: margins hold background too, by which a clear loop must not be shrunk
SMALLEST_USUAL = 0.35  # correlation; with less no loop is told from noise
USUAL_SOFTENED = 0.9  # where noise is blurred away
HALF_WIDTH = 6  # strip columns on either side of the curve, each PIXEL_MM wide at the loop
_OFFSETS = np.arange(-HALF_WIDTH, HALF_WIDTH + 1, dtype=np.float32)


@dataclass(frozen=True, eq=False)
class Strip:
    """Where a strip's samples lie in a working image; or several strips at once, each in its own image.

    Attributes:
        pixels: (..., L, 2) the projected curve.
        tangents: (..., L, 2) unit tangents of the projected curve.
        normals: (..., L, 2) unit normals.
        spacing: (..., L) distance between neighbouring curve points, working pixels.
        step: (...) distance between neighbouring columns, working pixels.
    """

    pixels: Array
    tangents: Array
    normals: Array
    spacing: Array
    step: Array

    def coordinates(self) -> npt.NDArray[np.float32]:
        """(..., 2, L, 2·HALF_WIDTH + 1) sample positions, x and y, pixels."""
        across = self.step[..., None, None] * self.normals.swapaxes(-1, -2)
        along = self.pixels.swapaxes(-1, -2).astype(np.float32)
        return along[..., None] + across.astype(np.float32)[..., None] * _OFFSETS

    def sample(self, image: WorkingImage) -> Image:
        """(L, 2·HALF_WIDTH + 1) bilinear values of the working image; zero outside it."""
        return sample_at(self.coordinates(), image)


def sample_at(coordinates: npt.NDArray[np.float32], image: WorkingImage) -> Image:
    """(L, columns) bilinear values of a working image at x and y (2, L, columns); zero outside it."""
    x, y = coordinates
    return np.asarray(cv2.remap(image.values, x, y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_CONSTANT))


def strip_along(curve: Array, projection: Projection) -> Strip:
    """The strip along a curve (L, 3) of world metres under a projection to working pixels."""
    return strip_about(projection.project(curve), PIXEL_MM / projection.millimetres_per_pixel(curve.mean(axis=0)))


def strip_about(pixels: Array, step: float | Array) -> Strip:
    """The strip along a curve (..., L, 2) of working pixels, its columns `step` (...) pixels apart."""
    tangents, spacing = unit_tangents(pixels)
    return Strip(pixels, tangents, quarter_turn(tangents), spacing, np.asarray(step))


class Appearance:
    """The running mean of a plane's strips, each sampled where the loop was found.

    Attributes:
        values: (L, 2·HALF_WIDTH + 1) float32 with all that alignment can hold on to, little shrunk.
        distinctive: the same freed of all that noise and background explain, by which the loop is told from others.
        slopes: of `values`, along the curve and across it.
        usual: correlation with it where the loop is seen; at first what the noise about the loop lets expect.
        contrast: of the loop, as a share of the grey behind it, when last seen.
    """

    LONGEST_MEMORY = 16  # strips; then old ones fade, so that slow change of dose or angle is followed
    USUAL_MEMORY = 5  # pairs

    def __init__(self, first: Image, contrast: float) -> None:
        self.contrast = contrast
        self._mean: Image = np.array(first)
        self._count = 1
        self._show(*_without_noise(self._mean))
        # A strip of signal and as much noise again correlates with the signal by the root of the signal's share.
        share = float(np.sum(np.square(self.distinctive))) / max(float(np.sum(np.square(first))), 1e-9)
        self.expect(float(np.sqrt(share)))

    def softened(self) -> Appearance:
        """What it looks like in a softened `WorkingImage`."""
        soft = copy.copy(self)
        soft._show(softened(self.values), softened(self.distinctive))
        soft.usual = USUAL_SOFTENED
        return soft

    def expect(self, correlation: float) -> None:
        """Take a correlation for what is usual where the loop is seen."""
        self.usual = max(correlation, SMALLEST_USUAL)

    def update(self, strip: Image, correlation: float) -> None:
        """Take in the strip (L, 2·HALF_WIDTH + 1) of a pair that surely shows the loop, and how well it correlated."""
        self._count = min(self._count + 1, self.LONGEST_MEMORY)
        self.expect(self.usual + (correlation - self.usual) / min(self._count, self.USUAL_MEMORY))
        self._mean = self._mean + (strip - self._mean) * np.float32(1.0 / self._count)
        self._show(*_without_noise(self._mean))

    def _show(self, values: Image, distinctive: Image) -> None:
        self.values, self.distinctive = values, distinctive
        self.slopes = slope(values, axis=0), slope(values, axis=1)


def _without_noise(mean: Image) -> tuple[Image, Image]:
    """A mean strip shrunk towards zero, and towards the wire's mean profile, where it holds little more than noise.

    The columns farthest from the curve show background and noise. A strip that keeps them would be matched
    by any other background less well than it should be, and a faint loop be taken for none (Wiener's filter).
    The wire's profile is the same all along the loop, so that its median holds little noise: what stands out
    from it, electrodes and bends, is what a single noisy strip has to prove.
    """
    smooth = cv2.GaussianBlur(mean, (0, 0), 0.6)
    margins = np.concatenate([smooth[:, :MARGIN_COLUMNS], smooth[:, -MARGIN_COLUMNS:]], axis=1)
    noise = float(upper_median(np.square(margins).reshape(1, -1))[0]) / MEDIAN_OF_SQUARED_NORMAL
    profile = upper_median(smooth.T)
    return _shrunk(smooth, NOISE_SHARE * noise), profile + _shrunk(smooth - profile, noise)


def upper_median(values: Image) -> Image:
    """(R,) the middle value of each row (R, N), or the upper one of two, in a fifth of the time of numpy's median."""
    middle = values.shape[1] // 2
    return np.asarray(np.partition(values, middle, axis=1)[:, middle])


def _shrunk(strip: Image, noise: float) -> Image:
    energy = cv2.blur(np.square(strip), (3, 5), borderType=cv2.BORDER_REFLECT)
    return np.asarray(strip * np.maximum(0.0, 1.0 - noise / np.maximum(energy, 1e-9)), dtype=np.float32)


def render(values: Image, strip: Strip, cell_px: float) -> tuple[Image, npt.NDArray[np.int64]]:
    """Lay a strip's values back into the image plane: the matched filter for a search.

    Args:
        values: (L, 2·HALF_WIDTH + 1) appearance.
        strip: where it would lie.
        cell_px: size of a search cell, working pixels.

    Returns:
        (h, w) float32 kernel of zero mean and unit norm on the search cells, and the cell (2,) x, y of its
        first element.
    """
    at = strip.coordinates().reshape(2, -1) / np.float32(cell_px) + np.float32(0.5 / cell_px - 0.5)
    cell = np.floor(at)
    fraction = at - cell
    corner = cell.astype(np.int64)
    low = corner.min(axis=1) - 1
    width, height = corner.max(axis=1) + 3 - low
    first = (corner[1] - low[1]) * width + corner[0] - low[0]
    density = np.repeat(np.minimum(strip.spacing, 2.0 * cell_px), values.shape[1])
    # Each sample is shared out among the four cells about it.
    right, down = density * fraction[0], fraction[1]
    left, up = density - right, 1.0 - down
    share = np.concatenate([left * up, right * up, left * down, right * down])
    index = np.concatenate([first, first + 1, first + width, first + width + 1])
    weight = np.bincount(index, share, width * height)
    weighted = np.bincount(index, share * np.tile(values.ravel(), 4), width * height)
    # Where both sides of an edge-on loop overlap, their strips are averaged rather than added.
    kernel = weighted / np.maximum(weight, 0.25 * weight.max())
    inside = weight > 0.05 * weight.max()
    kernel = np.where(inside, kernel - kernel[inside].mean(), 0.0).reshape(height, width)
    return np.asarray(kernel / max(float(np.linalg.norm(kernel)), 1e-12), dtype=np.float32), low
