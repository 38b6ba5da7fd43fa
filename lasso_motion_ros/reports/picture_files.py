"""PNG files."""

from __future__ import annotations

from pathlib import Path

import cv2

from lasso_motion_ros.core.errors import RecordingError
from lasso_motion_ros.overlay.windowing import RgbImage


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


def jpeg_bytes(picture: RgbImage) -> bytes:
    """A picture (H, W, 3) uint8 RGB as a JPEG file in memory: for a page that holds many.

    Raises:
        RecordingError: it cannot be encoded.
    """
    done, data = cv2.imencode(".jpg", cv2.cvtColor(picture, cv2.COLOR_RGB2BGR), [cv2.IMWRITE_JPEG_QUALITY, 90])
    if not done:
        raise RecordingError(f"a picture of {picture.shape} cannot be encoded as JPEG")
    return data.tobytes()
