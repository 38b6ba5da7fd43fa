"""Where breathing moves the heart, before any of it has been seen.

On inspiration the heart goes towards the feet, and about a quarter as far to the front: 4.9 ± 1.9 mm caudally and
1.3 ± 1.8 mm anteriorly in ten patients breathing freely (Shechter et al., "Respiratory motion of the heart from free
breathing coronary angiograms", IEEE Transactions on Medical Imaging 23(8), 2004). Where the images show how far it went
along the body, this tells how far, roughly, in depth.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from lasso_motion_ros.geometry.frames import PLANES, Plane
from lasso_motion_ros.geometry.projection import Projection

Array = npt.NDArray[np.float64]


@dataclass(frozen=True)
class _Tuning:
    """How the heart moves, in units of its way along the body, and how sure the views' directions have to be."""

    forward_share: float = 1.3 / 4.9  # to the front, where a supine patient has the detectors
    # Standard deviations: 1.8 / 4.9 between patients, and somewhat for hysteresis and the heartbeat; from left to right
    # a guess.
    frontal_sigma: float = 0.5
    lateral_sigma: float = 0.4
    share_of_a: float = 0.6  # plane A is taken for the more frontal view: of 0° and 90° it is the one at 0°
    smallest_part: float = 0.5  # of a direction along an axis, below which the axis is not known


TUNING = _Tuning()
TOWARDS_DETECTORS = {"supine": TUNING.forward_share, "prone": -TUNING.forward_share}


def breathing_shape(projections: dict[Plane, Projection], posture: str) -> Array:
    """Covariance of the heart's displacement, in units of its variance along the body.

    Args:
        projections: world metres to pixels, per plane.
        posture: how the patient lies, `supine`, `prone` or `unknown`.

    Returns:
        (3, 3), world frame; all directions are alike where the posture is unknown, or the views do not show it.
    """
    axes = None if posture == "unknown" else _head_and_detectors(projections)
    if axes is None:
        return np.eye(3)
    head, detectors = axes
    lateral = np.cross(head, detectors)
    main = TOWARDS_DETECTORS[posture] * detectors - head
    frontal, sideways = TUNING.frontal_sigma**2, TUNING.lateral_sigma**2
    covariance = np.outer(main, main)
    covariance += frontal * np.outer(detectors, detectors) + sideways * np.outer(lateral, lateral)
    return covariance


def _head_and_detectors(projections: dict[Plane, Projection]) -> tuple[Array, Array] | None:
    """The world's axes, (3,) each, nearest to where the images have their tops, and to where the detectors are.

    Makers count the axes of a table or an iso-centre differently, but lay one along the patient. Images are shown
    with the head up, whether or not they are mirrored, and the detectors are above the patient. None where the two
    images' tops, or the detectors, lie along no axis.
    """
    upward, outward = np.zeros(3), np.zeros(3)
    for plane, share in zip(PLANES, (TUNING.share_of_a, 1.0 - TUNING.share_of_a), strict=True):
        up = -projections[plane].jacobian(np.zeros(3))[1]
        upward += 0.5 * up / np.linalg.norm(up)
        outward += share * projections[plane].viewing_direction
    head = _nearest_axis(upward)
    detectors = None if head is None else _nearest_axis(outward - (outward @ head) * head)
    return None if head is None or detectors is None else (head, detectors)


def _nearest_axis(direction: Array) -> Array | None:
    largest = int(np.argmax(np.abs(direction)))
    if abs(direction[largest]) < TUNING.smallest_part:
        return None
    axis = np.zeros(3)
    axis[largest] = np.sign(direction[largest])
    return axis
