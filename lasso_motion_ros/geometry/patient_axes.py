"""Where a world's axes point in the patient, and what the angles of a C-arm are called there."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from lasso_motion_ros.core.errors import ConfigurationError
from lasso_motion_ros.geometry.projection import Projection

Array = npt.NDArray[np.float64]

SUPINE = "LPS"
"""A C-arm's axes, as `carm_projection` and DICOM have them, in a patient who lies supine and head first."""
_DIRECTIONS = {"R": (0, 1.0), "L": (0, -1.0), "A": (1, 1.0), "P": (1, -1.0), "S": (2, 1.0), "I": (2, -1.0)}
_NAMES = {"R": "right", "L": "left", "A": "anterior", "P": "posterior", "S": "head", "I": "feet"}


@dataclass(frozen=True)
class _Tuning:
    """When two views are taken for those of a supine patient, in a world whose axes are given.

    Attributes:
        least_up: of the direction of both images' tops that must lie along the patient.
        most_rao_deg: to which the middle between the two detectors may be turned. Pairs in use have it between 0° (RAO
            45, LAO 45) and LAO 45° (AP, lateral); a world whose axes are others is a quarter turn off.
        most_lao_deg: likewise, to the left.
    """

    least_up: float = 0.5
    most_rao_deg: float = 35.0
    most_lao_deg: float = 60.0


TUNING = _Tuning()


def patient_axes(text: str) -> Array:
    """(3, 3) rotation from the world's axes to RAS (+x right, +y anterior, +z superior).

    Args:
        text: where in the patient the world's x, y and z point, a letter each, of R, L, A, P, S, I: `LPS`.

    Raises:
        ConfigurationError: other letters, two of one axis, or a left-handed set.
    """
    letters = text.strip().upper()
    found = [_DIRECTIONS[letter] for letter in letters if letter in _DIRECTIONS]
    if len(letters) == len(found) == len({axis for axis, _ in found}) == 3:
        axes = np.zeros((3, 3))
        for column, (row, sign) in enumerate(found):
            axes[row, column] = sign
        if np.linalg.det(axes) > 0.0:
            return axes
        raise ConfigurationError(f"axes: {text} is left-handed; a world frame is right-handed, as LPS and RAS are")
    raise ConfigurationError(
        f"axes: expected where the world's x, y and z point in the patient, a letter each of R, L, A, P, S, I, such as"
        f" LPS, found {text!r}"
    )


def axis_names(text: str) -> tuple[str, str, str]:
    """Where +x, +y and +z point, in words: `left`, `posterior`, `head` for LPS.

    Args:
        text: as in `patient_axes`, which says whether it is well-formed.
    """
    x, y, z = (_NAMES[letter] for letter in text.strip().upper())
    return x, y, z


def gantry_angles(projection: Projection, axes: Array) -> tuple[float, float]:
    """Where the detector stands: LAO (RAO negative) and CRAN (CAUD negative), radians.

    Args:
        projection: world metres to pixels; its mirror, scale and sign do not matter.
        axes: (3, 3) rotation from the world to RAS.
    """
    right, anterior, head = axes @ projection.viewing_direction
    return float(np.arctan2(-right, anterior)), float(np.arcsin(np.clip(head, -1.0, 1.0)))


def gantry_words(projection: Projection, axes: Array) -> str:
    """The same as it is said in a lab, to a whole degree: `RAO 30° CRAN 5°`, `LAO 90°`, `AP`."""
    lao_deg, cranial_deg = (round(float(np.degrees(angle))) for angle in gantry_angles(projection, axes))
    words = ["AP" if lao_deg == 0 else f"{'LAO' if lao_deg > 0 else 'RAO'} {abs(lao_deg)}°"]
    if cranial_deg:
        words.append(f"{'CRAN' if cranial_deg > 0 else 'CAUD'} {abs(cranial_deg)}°")
    return " ".join(words)


def shows_supine_patient(projections: tuple[Projection, Projection], axes: Array) -> bool:
    """Whether both images have the head at their tops, and the detectors stand about the chest, were these the axes.

    Which plane is which makes no difference, so that calibrations that were exchanged do not hide.

    Args:
        projections: of the two planes.
        axes: (3, 3) rotation from the world to RAS.
    """
    between = np.zeros(3)
    for projection in projections:
        up = -axes @ projection.jacobian(np.zeros(3))[1]
        if up[2] < TUNING.least_up * np.linalg.norm(up):
            return False
        between += axes @ projection.viewing_direction
    middle_deg = float(np.degrees(np.arctan2(-between[0], between[1])))
    return -TUNING.most_rao_deg <= middle_deg <= TUNING.most_lao_deg
