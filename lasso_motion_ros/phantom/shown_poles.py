"""How plainly an image shows electrodes at given places: a measure on pixels and truth alone, for judging trackers.

The logarithm of the image is band-passed to the size of an electrode and divided by what the image has of that band
round about; the mean over the true electrodes says whether a person, or a tracker, could see them there.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]


@dataclass(frozen=True)
class EvidenceConstants:
    """What the evidence of electrodes is made with; lengths at the ring's depth.

    Attributes:
        electrode_mm: width (sigma) of the Gaussian that keeps an electrode.
        surround_mm: of the one whose result is taken off it.
        local_mm: of the one over which the band's mean square is taken.
        least: contrast is clipped here,
        most: and here: one very dark thing on an electrode does not make up for nine that are not seen.
        margin_mm: of the image round the electrodes that is looked at.
        plain: mean from which on a plane shows the ring plainly.
    """

    electrode_mm: float = 0.45
    surround_mm: float = 1.35
    local_mm: float = 8.0
    least: float = -1.0
    most: float = 2.0
    margin_mm: float = 20.0
    plain: float = 1.2


EVIDENCE = EvidenceConstants()


def pole_evidence(
    pixels: npt.NDArray[np.uint8] | npt.NDArray[np.uint16], poles: Array, pixel_mm: float, *, dark: bool = True
) -> float:
    """Mean contrast of electrodes in units of the local contrast, −1 to 2.

    Args:
        pixels: (H, W) the image.
        poles: (E, 2) the electrodes' true places at the image's own exposure, pixels; those outside count as unseen.
        pixel_mm: size of a pixel at the ring's depth.
        dark: whether they are darker than their surroundings.

    Returns:
        The mean over the electrodes; −1 where there are none.
    """
    height, width = pixels.shape
    inside = np.all((poles >= 0.0) & (poles <= (width - 1, height - 1)), axis=1)
    if not inside.any():
        return EVIDENCE.least
    margin = EVIDENCE.margin_mm / pixel_mm
    low = np.maximum(np.floor(poles[inside].min(axis=0) - margin).astype(int), 0)
    high = np.minimum(np.ceil(poles[inside].max(axis=0) + margin).astype(int) + 1, (width, height))
    part = pixels[low[1] : high[1], low[0] : high[0]].astype(np.float32)
    if not dark:
        part = np.float32(np.iinfo(pixels.dtype).max if pixels.dtype == np.uint8 else 4095) - part
    logarithm = np.log(part + np.float32(1.0))
    band = _smooth(logarithm, EVIDENCE.surround_mm / pixel_mm) - _smooth(logarithm, EVIDENCE.electrode_mm / pixel_mm)
    local = np.sqrt(_smooth(band * band, EVIDENCE.local_mm / pixel_mm)) + np.float32(1e-6)
    contrast = np.clip(band / local, EVIDENCE.least, EVIDENCE.most)
    at = (poles[inside] - low).astype(np.float32)
    seen = cv2.remap(contrast, at[:, :1], at[:, 1:], cv2.INTER_LINEAR).ravel()
    return float((seen.sum() + EVIDENCE.least * np.count_nonzero(~inside)) / len(poles))


def _smooth(image: npt.NDArray[np.float32], sigma_px: float) -> npt.NDArray[np.float32]:
    return np.asarray(cv2.GaussianBlur(image, (0, 0), sigma_px, borderType=cv2.BORDER_REFLECT_101), np.float32)
