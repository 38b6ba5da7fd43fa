"""Images: encoding, size, byte order, empty pictures, from a few samples."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from lasso_motion_ros.core.errors import MessageError
from msg_adapters.checks.issue import Issue, Severity, cure_of
from msg_adapters.crop import Crop
from msg_adapters.images import TAKEN_AS_LUMINANCE, Pixels, decode_grey


@dataclass(frozen=True)
class _Limits:
    """Where images become suspicious.

    Attributes:
        smallest_side_px: with fewer pixels a lasso's wire is hardly one pixel wide.
        saturated: share of pixels at the highest value.
        swapped: roughness with swapped bytes, as a share of that without.
    """

    smallest_side_px: int = 256
    saturated: float = 0.5
    swapped: float = 0.5


LIMITS = _Limits()

_CURES = {
    "crop": "set plane_x.crop to a part of the picture: x y width height",
    "encoding": "publish mono8 or mono16, linear, before any colour map",
    "step": "set step to the bytes of a row, padding included",
    "data": "send step × height bytes",
    "width, height": "publish the image as the detector read it out",
}


@dataclass
class ImageSamples:
    """What was found in some images of one plane.

    Attributes:
        crop: the part of them that is looked at; None: all of it.
        shapes: (height, width) of that part → how often.
        sizes: (height, width) → how often.
        encodings: encoding → how often.
        refusals: why an image was refused → how often.
        colours: what colour pictures came as → how often.
        samples: images looked at.
        flat: of those, all of one value.
        saturated: of those, more than half at the highest value that occurs in the picture's range.
        swapped: of those, smoother when their bytes are swapped.
    """

    crop: Crop | None = None
    shapes: Counter[tuple[int, int]] = field(default_factory=Counter)
    sizes: Counter[tuple[int, int]] = field(default_factory=Counter)
    encodings: Counter[str] = field(default_factory=Counter)
    refusals: Counter[str] = field(default_factory=Counter)
    colours: Counter[str] = field(default_factory=Counter)
    samples: int = 0
    flat: int = 0
    saturated: int = 0
    swapped: int = 0

    def add(self, message: Any) -> None:
        """Look at one image (Image or CompressedImage)."""
        self.samples += 1
        self.encodings[message.encoding if hasattr(message, "encoding") else message.format] += 1
        try:
            grey = decode_grey(message, self.crop)
        except MessageError as error:
            self.refusals[str(error)] += 1
            return
        pixels = grey.pixels
        if grey.colour:
            self.colours[grey.colour] += 1
        self.sizes[grey.picture] += 1
        self.shapes[pixels.shape[0], pixels.shape[1]] += 1
        lowest, highest = int(pixels.min()), int(pixels.max())
        if lowest == highest:
            self.flat += 1
            return
        self.saturated += int(np.count_nonzero(pixels == highest)) > LIMITS.saturated * pixels.size
        self.swapped += _looks_swapped(pixels)


def _looks_swapped(pixels: Pixels) -> bool:
    """Whether neighbours are much more alike after a swap of bytes (X-ray film is smooth; a low byte is not)."""
    if pixels.dtype != np.uint16:
        return False
    swapped = pixels.byteswap()

    def roughness(image: Pixels) -> float:
        rows = image[::4].astype(np.float64)
        return float(np.abs(np.diff(rows, axis=1)).mean() / max(rows.std(), 1e-9))

    # An 8-bit picture in 16 bits differs from its swap by a factor only.
    return bool(np.any(swapped < pixels)) and roughness(swapped) < LIMITS.swapped * roughness(pixels)


def check_images(name: str, seen: ImageSamples) -> Iterator[Issue]:
    """Issues with the images of one topic."""
    for refusal, count in seen.refusals.items():
        found = f"{refusal} ({count} of {seen.samples} images looked at)"
        yield Issue("error", name, found, cure_of(refusal, _CURES))
    for colour in seen.colours:
        yield Issue("note", name, f"{colour} {TAKEN_AS_LUMINANCE}", "mono8 or mono16 from the detector shows more")
    if len(seen.sizes) > 1:
        sizes = ", ".join(f"{width}×{height}" for height, width in seen.sizes)
        yield Issue("note", name, f"the size changes: {sizes}", "let the calibration come with each image")
    for height, width in seen.shapes:
        if min(height, width) < LIMITS.smallest_side_px:
            yield Issue(
                "warning", name, f"{width}×{height} pixels are few for a lasso's wire", "publish the full read-out"
            )
    mostly_swapped: Severity = "error" if seen.swapped > seen.samples / 2 else "warning"
    suspicions: tuple[tuple[int, Severity, str, str], ...] = (
        (seen.flat, "warning", "are all of one value", "see that the beam is on, and that the pixels are copied"),
        (seen.saturated, "warning", "are half saturated", "publish the linear detector values, before windowing"),
        (seen.swapped, mostly_swapped, "look byte-swapped", "set is_bigendian to the data's true order"),
    )
    for count, severity, what, cure in suspicions:
        if count:
            yield Issue(severity, name, f"{count} of {seen.samples} images looked at {what}", cure)
