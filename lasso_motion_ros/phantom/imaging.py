"""From optical depth to the published picture: beam, quanta, detector, display."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
import numpy.typing as npt

from lasso_motion_ros.phantom.settings import ImagingSettings

Image = npt.NDArray[np.float32]
Pixels = npt.NDArray[np.uint8] | npt.NDArray[np.uint16]


@dataclass(frozen=True)
class ChainConstants:
    """Constants of the imaging chain that no scenario varies.

    Attributes:
        fwhm_per_sigma: full width at half maximum of a Gaussian in units of its standard deviation.
        scatter_width: of scattered radiation (sigma), as a share of the image's width: as broad as the patient is
            thick.
        scatter_behind_leaves: the share of it that arrives behind the collimator's leaves.
        leaf_transmission: what the leaves let through.
        penumbra_px: blur of the leaves' edges (sigma), pixels.
        white_percentile: of the open field in the first picture; with white_headroom it is the display's white.
        white_headroom: white as a multiple of that percentile.
        edge_sigma_px: blur of the unsharp mask (sigma) in an image 1024 pixels wide; at least one pixel.
    """

    fwhm_per_sigma: float = 2.3548
    scatter_width: float = 0.14
    scatter_behind_leaves: float = 0.2
    leaf_transmission: float = 0.02
    penumbra_px: float = 1.6
    white_percentile: float = 99.5
    white_headroom: float = 1.1
    edge_sigma_px: float = 2.5


CHAIN = ChainConstants()


@dataclass(frozen=True)
class Exposure:
    """How one picture is taken and shown.

    Attributes:
        dose: quanta by those of the scenario; the display evens it out.
        window: factor of the grey level.
        covered: part of the field that the shutters cover at left, top, right, bottom.
    """

    dose: float = 1.0
    window: float = 1.0
    covered: tuple[float, ...] = (0.0, 0.0, 0.0, 0.0)


class ImagingChain:
    """One plane's tube, detector and display. It remembers: gain and window from its first picture, lag from the last.

    The order is that of the physics: Beer–Lambert, focal spot, collimator, scatter, Poisson quanta, detector blur
    (signal and noise alike), read-out noise, lag; then display curve, edge enhancement, polarity, bits.

    Args:
        settings: the scenario's.
        focal_spot_px: width (FWHM) of the focal spot's image on the detector, pixels.
    """

    def __init__(self, settings: ImagingSettings, focal_spot_px: float) -> None:
        self._settings = settings
        self._focal_sigma = focal_spot_px / CHAIN.fwhm_per_sigma
        self._gain = 0.0
        self._white = 0.0
        self._last: Image | None = None

    def fluence(self, optical_depth: npt.NDArray[np.floating], covered: tuple[float, ...] | None = None) -> Image:
        """Primary and scattered fluence behind the patient, (H, W), 1 for the open beam.

        Args:
            optical_depth: (H, W) line integrals of the attenuation.
            covered: part of the field that the collimator covers; the settings' if not given.
        """
        settings = self._settings
        primary = blurred(np.exp(-np.asarray(optical_depth, dtype=np.float32)), self._focal_sigma)
        opening = collimator_mask(primary.shape, settings.collimator if covered is None else covered)
        primary *= opening
        # Scatter is as broad as the patient is thick; it also reaches what the collimator covers.
        small = cv2.resize(primary, None, fx=0.125, fy=0.125, interpolation=cv2.INTER_AREA)
        sigma = CHAIN.scatter_width * small.shape[1]
        spread = cv2.GaussianBlur(small, (0, 0), sigma, borderType=cv2.BORDER_REPLICATE)
        height, width = primary.shape
        scatter = cv2.resize(spread, (width, height), interpolation=cv2.INTER_LINEAR)
        # Behind the leaves less of it arrives: less patient is lit there.
        behind = CHAIN.scatter_behind_leaves
        reached = behind + (1.0 - behind) * opening
        return np.asarray(primary + np.float32(settings.scatter) * scatter * reached, dtype=np.float32)

    def expose(
        self,
        optical_depth: npt.NDArray[np.floating],
        dose: float,
        random: np.random.Generator,
        exposure: Exposure | None = None,
    ) -> Pixels:
        """One picture.

        Args:
            optical_depth: (H, W) line integrals of the attenuation.
            dose: tube output relative to the first picture's; the display shows it.
            random: draws the quanta.
            exposure: how it is taken and shown, if otherwise than the settings say.

        Returns:
            (H, W) uint8, or uint16 up to 4095.
        """
        exposure = exposure or Exposure(covered=self._settings.collimator)
        fluence = self.fluence(optical_depth, exposure.covered)
        if self._last is None:
            # The exposure control looks at the middle of the field.
            opening = collimator_mask(fluence.shape, exposure.covered)
            high, wide = fluence.shape[0] // 4, fluence.shape[1] // 4
            self._gain = self._settings.quanta / float(fluence[high:-high, wide:-wide].mean())
            brightest = float(np.percentile(fluence[opening > 0.5], CHAIN.white_percentile))
            self._white = brightest * self._gain * CHAIN.white_headroom
        mode = np.float32(exposure.dose)
        # Between fluoroscopy and cine the exposure control evens the grey level out: only the noise changes.
        signal = self.detect(fluence * np.float32(self._gain * dose) * mode, random) / mode
        lag = np.float32(self._settings.lag)
        self._last = signal if self._last is None else signal * (1 - lag) + self._last * lag
        return self.display(self._last, exposure.window)

    def detect(self, expected: Image, random: np.random.Generator) -> Image:
        """Quanta counted, blurred with the detector, and read out: (H, W) in quanta."""
        settings = self._settings
        counted = random.poisson(expected).astype(np.float32)
        signal = blurred(counted, settings.detector_blur_px)
        if settings.electronic_noise > 0.0:
            noise = random.standard_normal(signal.shape, dtype=np.float32)
            signal += noise * np.float32(settings.electronic_noise)
        return signal

    def display(self, signal: Image, window: float = 1.0) -> Pixels:
        """Display curve, edge enhancement, window, polarity and quantisation of a detector signal in quanta."""
        settings = self._settings
        grey = np.power(np.maximum(signal, 0.0) / np.float32(self._white), np.float32(settings.gamma))
        if settings.edge_enhancement > 0.0:
            width = max(1.0, CHAIN.edge_sigma_px * grey.shape[1] / 1024.0)
            grey += np.float32(settings.edge_enhancement) * (grey - blurred(grey, width))
        grey = grey * np.float32(window)
        if settings.polarity == "bright":
            grey = np.float32(1.0) - grey
        top = 255 if settings.bits == 8 else 4095
        quantised = np.rint(np.clip(grey, 0.0, 1.0) * np.float32(top))
        return quantised.astype(np.uint8) if settings.bits == 8 else quantised.astype(np.uint16)


def blurred(image: Image, sigma_px: float) -> Image:
    """The image convolved with a Gaussian; unchanged where sigma is 0."""
    if sigma_px <= 0.0:
        return image
    side = 2 * int(np.ceil(4.0 * sigma_px)) + 1
    return np.asarray(cv2.GaussianBlur(image, (side, side), sigma_px, borderType=cv2.BORDER_REFLECT_101), np.float32)


def collimator_mask(shape: tuple[int, ...], covered: tuple[float, ...]) -> Image:
    """(H, W) transmission of the collimator: 1 open, 0.02 covered, with a penumbra.

    Args:
        shape: rows and columns.
        covered: part of the field covered at left, top, right, bottom.
    """
    height, width = shape[:2]
    left, top, right, bottom = covered
    mask = np.full((height, width), CHAIN.leaf_transmission, dtype=np.float32)
    rows = slice(round(top * height), height - round(bottom * height))
    columns = slice(round(left * width), width - round(right * width))
    mask[rows, columns] = 1.0
    return mask if not any(covered) else blurred(mask, CHAIN.penumbra_px)
