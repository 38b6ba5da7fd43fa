"""Encodes pictures: windowed for the eye, as JPEG while they pass by, as PNG where someone clicks in them."""

from __future__ import annotations

import threading
from dataclasses import dataclass

import cv2
import numpy as np

from lasso_motion_ros.core.errors import LassoMotionError
from lasso_motion_ros.geometry.frames import PLANES
from lasso_motion_ros.overlay.windowing import window_image, window_limits
from lasso_motion_ros.web.protocol import DisplaySettings, EncodedPlane, Window, encode_picture
from lasso_motion_ros.web.recent import Recent
from lasso_motion_ros.web.source import Picture, PlanePicture


@dataclass(frozen=True)
class _Tuning:
    """How pictures are encoded.

    Attributes:
        jpeg_quality: of passing pictures; noise and thin lines survive.
        png_compression: of held pictures; the fastest, since the user waits.
        kept: encoded pictures in the cache: pages may want two views in two windowings.
    """

    jpeg_quality: int = 88
    png_compression: int = 1
    kept: int = 4


_TUNING = _Tuning()


class PictureEncoder:
    """Encodes each picture once for all pages with the same settings; may be called from several threads."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._kept: Recent[tuple[int, DisplaySettings], bytes] = Recent(_TUNING.kept)

    def encode(self, picture: Picture, settings: DisplaySettings) -> bytes:
        """The binary message of a picture (see `encode_picture`)."""
        key, windows = (picture.number, settings), dict(settings.windows)
        with self._lock:
            if key in self._kept:
                return self._kept[key]
            planes = {
                plane: encode_plane(picture.planes[plane], windows[plane], lossless=picture.held)
                for plane in PLANES
                if plane in picture.planes
            }
            message = encode_picture(picture.number, picture.held, settings.view, planes)
            self._kept[key] = message
            return message


def encode_plane(picture: PlanePicture, window: Window, *, lossless: bool) -> EncodedPlane:
    """One plane as JPEG or PNG.

    Args:
        picture: grey values of any depth, or RGB.
        window: brightness and contrast.
        lossless: PNG.

    Raises:
        LassoMotionError: it cannot be encoded.
    """
    pixels = picture.pixels
    shown = windowed(pixels, window) if pixels.ndim == 2 else cv2.cvtColor(relit(pixels, window), cv2.COLOR_RGB2BGR)
    name, options = ".jpg", [cv2.IMWRITE_JPEG_QUALITY, _TUNING.jpeg_quality]
    if lossless:
        name, options = ".png", [cv2.IMWRITE_PNG_COMPRESSION, _TUNING.png_compression]
    done, data = cv2.imencode(name, shown, options)
    if not done:
        raise LassoMotionError(f"a picture of {pixels.shape} {pixels.dtype} cannot be encoded")
    height, width = pixels.shape[:2]
    return EncodedPlane(
        picture.stamp_ns, width, height, "png" if lossless else "jpeg", data.tobytes(), picture.loop, pixels.ndim == 3
    )  # fmt: skip


def windowed(pixels: np.ndarray, window: Window) -> np.ndarray:
    """(H, W) uint8: the picture's own window, made brighter or richer in contrast about its middle."""
    low, high = window_limits(pixels)
    half = 0.5 * (high - low)
    middle = 0.5 * (high + low) - window.brightness * half
    half /= window.contrast
    return window_image(pixels, (middle - half, middle + half))


def relit(pixels: np.ndarray, window: Window) -> np.ndarray:
    """(H, W, 3) uint8 RGB: an already windowed picture, its film made brighter or richer in contrast.

    Each pixel changes by what its grey value would gain, in all three channels alike: so film looks as `windowed` would
    make it, as far as 8 bits allow, and what is drawn over it keeps its hue.
    """
    if window == Window():
        return pixels
    value = np.arange(256.0)
    gained = np.clip(127.5 + window.contrast * (value - 127.5 * (1.0 - window.brightness)), 0.0, 255.0) - value
    grey = cv2.cvtColor(pixels, cv2.COLOR_RGB2GRAY)
    more, less = (cv2.LUT(grey, np.rint(np.maximum(gain, 0.0)).astype(np.uint8)) for gain in (gained, -gained))
    return np.asarray(cv2.subtract(cv2.add(pixels, cv2.merge((more,) * 3)), cv2.merge((less,) * 3)))
