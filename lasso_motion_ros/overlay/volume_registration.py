"""The overlay's `registration` parameter: where the volume lies in the world, as numbers or as a file with them."""

from __future__ import annotations

import os

import numpy as np
import numpy.typing as npt

from lasso_motion_ros.core.bounded_files import read_bounded
from lasso_motion_ros.core.errors import ConfigurationError
from lasso_motion_ros.geometry.transforms import rotation_from_quaternion

RIGID_TOLERANCE = 1e-3
MAX_FILE_BYTES = 64 * 1024


def read_registration(text: str) -> npt.NDArray[np.float64]:
    """The (4, 4) transform, volume to world, metres, from the numbers themselves or from a text file.

    Args:
        text: what `parse_registration` takes, or the path of a file that holds it; there, what follows a # is left
            out.

    Raises:
        ConfigurationError: as `parse_registration`, or the file cannot be read, or is too long to be one.
    """
    if len(text.replace(",", " ").split()) != 1 and not os.path.isfile(text):  # noqa: PTH113 - of any length
        return parse_registration(text)
    try:
        lines = read_bounded(text, MAX_FILE_BYTES).decode().splitlines()
    except (OSError, UnicodeDecodeError) as error:
        raise ConfigurationError(f"registration: {text}: neither numbers nor a readable file") from error
    try:
        return parse_registration(" ".join(line.partition("#")[0] for line in lines))
    except ConfigurationError as error:
        raise ConfigurationError(f"{text}: {error}") from error


def parse_registration(text: str) -> npt.NDArray[np.float64]:
    """The (4, 4) transform, volume to world, metres.

    Args:
        text: `x y z qx qy qz qw`, or the 16 numbers of a 4×4 matrix row by row; spaces or commas between them.

    Raises:
        ConfigurationError: another count of numbers, or a transform that is not rigid.
    """
    try:
        numbers = np.array([float(word) for word in text.replace(",", " ").split()])
    except ValueError as error:
        raise ConfigurationError(f"registration: {error}") from error
    if not np.all(np.isfinite(numbers)):
        raise ConfigurationError("registration: a number is not finite")
    if numbers.size == 7:
        if abs(np.linalg.norm(numbers[3:]) - 1.0) > RIGID_TOLERANCE:
            raise ConfigurationError(
                f"registration: the quaternion has length {np.linalg.norm(numbers[3:]):.4g}, not 1"
            )
        transform = np.eye(4)
        transform[:3, :3] = rotation_from_quaternion(numbers[3:])
        transform[:3, 3] = numbers[:3]
        return transform
    if numbers.size != 16:
        raise ConfigurationError(
            f"registration: expected x y z qx qy qz qw, or the 16 numbers of a 4×4 matrix, found {numbers.size} numbers"
        )
    transform = numbers.reshape(4, 4)
    rotation = transform[:3, :3]
    rigid = np.allclose(rotation @ rotation.T, np.eye(3), atol=RIGID_TOLERANCE) and np.linalg.det(rotation) > 0.0
    if not rigid or not np.allclose(transform[3], [0.0, 0.0, 0.0, 1.0], atol=RIGID_TOLERANCE):
        raise ConfigurationError(
            "registration: the matrix is not a rigid transform (rotation, metres, last row 0 0 0 1)"
        )
    return transform
