"""The part of a published picture that is the X-ray field, where a source shows more than that."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from lasso_motion_ros.core.errors import ConfigurationError, MessageError


@dataclass(frozen=True)
class Crop:
    """A rectangle of pixels in the published picture.

    Attributes:
        x: its first column.
        y: its first row.
        width: its columns.
        height: its rows.
    """

    x: int
    y: int
    width: int
    height: int

    @classmethod
    def parse(cls, text: str, name: str) -> Crop | None:
        """The crop that a parameter asks for; None where it is empty: the whole picture.

        Args:
            text: `x y width height`, whole pixels.
            name: the parameter's, for the error.

        Raises:
            ConfigurationError: not four such numbers.
        """
        words = text.replace(",", " ").strip("[] ").split()
        if not words:
            return None
        if len(words) != 4 or not all(word.isdecimal() and word.isascii() for word in words):
            raise ConfigurationError(f"{name}: expected x y width height in whole pixels, found {text!r}")
        crop = cls(*map(int, words))
        if crop.width < 1 or crop.height < 1:
            raise ConfigurationError(f"{name}: expected a width and a height of at least 1 pixel, found {text!r}")
        return crop

    @property
    def origin(self) -> npt.NDArray[np.float64]:
        """(2,) its first pixel in the published picture."""
        return np.array([self.x, self.y], dtype=np.float64)

    def part(self, picture: npt.NDArray[Any]) -> npt.NDArray[Any]:
        """The view of a picture (H, W, …) inside the crop.

        Raises:
            MessageError: the crop reaches beyond the picture.
        """
        height, width = picture.shape[:2]
        if self.x + self.width > width or self.y + self.height > height:
            raise MessageError(
                f"crop: {self.width}×{self.height} pixels at ({self.x}, {self.y}) reach beyond the picture, which has"
                f" {width}×{height}"
            )
        return picture[self.y : self.y + self.height, self.x : self.x + self.width]
