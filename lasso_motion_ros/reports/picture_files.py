"""Pictures as PNG files, and as data embedded in a page."""

from __future__ import annotations

import base64
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import cv2

from lasso_motion_ros.core.errors import RecordingError
from lasso_motion_ros.overlay.windowing import RgbImage

JPEG_QUALITY = 90


@dataclass(frozen=True)
class EmbeddedPicture:
    """A picture as part of the page itself.

    Attributes:
        kind: file format.
        base64: the file, encoded for a data URL.
        caption: text below it.
    """

    kind: Literal["png", "jpeg"]
    base64: str
    caption: str


def write_png(path: Path, picture: RgbImage) -> None:
    """Write a picture (H, W, 3) uint8 RGB, overwriting.

    Raises:
        RecordingError: the file cannot be written.
    """
    done, encoded = cv2.imencode(".png", cv2.cvtColor(picture, cv2.COLOR_RGB2BGR))
    if not done:
        raise RecordingError(f"{path}: the picture cannot be encoded")
    try:
        path.write_bytes(encoded.tobytes())
    except OSError as error:
        raise RecordingError(f"{path}: cannot be written: {error.strerror}") from error


def embedded_png(path: Path, caption: str) -> EmbeddedPicture:
    """A PNG file that has been written.

    Raises:
        OSError: it cannot be read.
    """
    return EmbeddedPicture("png", base64.b64encode(path.read_bytes()).decode("ascii"), caption)


def embedded_jpeg(picture: RgbImage, caption: str) -> EmbeddedPicture:
    """A picture (H, W, 3) uint8 RGB, compressed.

    Raises:
        RecordingError: it cannot be encoded.
    """
    options = [cv2.IMWRITE_JPEG_QUALITY, JPEG_QUALITY]
    done, data = cv2.imencode(".jpg", cv2.cvtColor(picture, cv2.COLOR_RGB2BGR), options)
    if not done:
        raise RecordingError(f"a picture of {picture.shape} cannot be encoded as JPEG")
    return EmbeddedPicture("jpeg", base64.b64encode(data.tobytes()).decode("ascii"), caption)
