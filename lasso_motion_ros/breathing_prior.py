"""Where breathing moves the heart, before any of it has been seen.

On inspiration the heart goes towards the feet, and about a quarter as far to the front: 4.9 ± 1.9 mm caudally and
1.3 ± 1.8 mm anteriorly in ten patients breathing freely (Shechter et al., "Respiratory motion of the heart from free
breathing coronary angiograms", IEEE Transactions on Medical Imaging 23(8), 2004). Where the images show how far it went
along the body, this tells how far, roughly, in depth.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from lasso_motion_ros.frames import PLANES, Plane
from lasso_motion_ros.geometry import Projection

Array = npt.NDArray[np.float64]

POSTURES = ("supine", "prone", "unknown")
ANTERIOR_SHARE = 1.3 / 4.9  # of the way along the body
# Standard deviations, in units of the way along the body. Patients differ by 0.37 front to back; the way back lies
# beside the way in, and the heart beats. Of left and right less is known, and less seen.
ANTERIOR_SIGMA = 0.5
LATERAL_SIGMA = 0.4
FRONTAL_SHARE = 0.6  # plane A is the frontal one, where neither is nearer to frontal than the other


def breathing_shape(projections: dict[Plane, Projection], posture: str) -> Array:
    """Covariance of the heart's displacement, in units of its variance along the body.

    Args:
        projections: world metres to pixels, per plane.
        posture: how the patient lies, one of `POSTURES`; where it is unknown, all directions are alike.

    Returns:
        (3, 3), world frame.
    """
    if posture == "unknown":
        return np.eye(3)
    head, front = _head_and_front(projections)
    lateral = np.cross(head, front)
    main = (ANTERIOR_SHARE if posture == "supine" else -ANTERIOR_SHARE) * front - head
    covariance = np.outer(main, main)
    covariance += ANTERIOR_SIGMA**2 * np.outer(front, front) + LATERAL_SIGMA**2 * np.outer(lateral, lateral)
    return covariance


def _head_and_front(projections: dict[Plane, Projection]) -> tuple[Array, Array]:
    """The world's axes, (3,) each, nearest to where the images have their tops, and to where the detectors are.

    Makers count the axes of a table or an iso-centre differently, but lay one along the patient. Images are shown
    with the head up, whether or not they are mirrored, and the detectors are above the patient.
    """
    upward, towards_detectors = np.zeros(3), np.zeros(3)
    for plane, share in zip(PLANES, (FRONTAL_SHARE, 1.0 - FRONTAL_SHARE), strict=True):
        up = -projections[plane].jacobian(np.zeros(3))[1]
        upward += up / np.linalg.norm(up)
        towards_detectors += share * projections[plane].viewing_direction
    head = _nearest_axis(upward)
    return head, _nearest_axis(towards_detectors - (towards_detectors @ head) * head)


def _nearest_axis(direction: Array) -> Array:
    axis = np.zeros(3)
    largest = int(np.argmax(np.abs(direction)))
    axis[largest] = np.sign(direction[largest])
    return axis
