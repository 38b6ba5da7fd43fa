"""The C-arm's projections pair by pair: events that move it, and how far the published matrices are off."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from lasso_motion_ros.geometry.carm import carm_projection
from lasso_motion_ros.geometry.frames import Plane
from lasso_motion_ros.geometry.projection import Projection
from lasso_motion_ros.geometry.transforms import rigid
from lasso_motion_ros.phantom.settings import Event, Scenario

Array = npt.NDArray[np.float64]


def progress(event: Event, pair: int) -> float:
    """How much of an event's motion is done at a pair: 0 before its first, 1 from its last on."""
    if pair < event.first:
        return 0.0
    return min(1.0, (pair - event.first + 1) / (event.end - event.first + 1))


def concerns(event: Event, plane: Plane) -> bool:
    """Whether an event is about this plane."""
    return event.plane in ("both", plane)


def true_projection(scenario: Scenario, plane: Plane, pair: int, *, as_published: bool = False) -> Projection:
    """The projection with which a pair is exposed.

    The world is fixed to the table top: a table pan by v moves the iso-centre by −v in the world.

    Args:
        scenario: the sequence.
        plane: "a" or "b".
        pair: number of the pair.
        as_published: leave out the events whose calibration does not follow.
    """
    geometry = scenario.geometry
    angles = geometry.plane_a if plane == "a" else geometry.plane_b
    lao, cranial, pixel_mm = angles.lao_deg, angles.cranial_deg, geometry.field_mm / geometry.size_px
    iso_centre = np.zeros(3)
    for event in scenario.events:
        done = progress(event, pair)
        if done == 0.0 or (as_published and not event.calibrated):
            continue
        if event.kind == "table_pan":
            iso_centre = iso_centre - done * 1e-3 * np.asarray(event.shift_mm)
        elif event.kind == "gantry_turn" and concerns(event, plane):
            lao, cranial = lao + done * event.lao_deg, cranial + done * event.cranial_deg
        elif event.kind == "zoom" and concerns(event, plane):
            # The zoom format is switched, not driven.
            pixel_mm /= event.factor
    return carm_projection(
        np.radians(lao),
        np.radians(cranial),
        source_detector_m=geometry.source_detector_mm * 1e-3,
        source_object_m=geometry.source_object_mm * 1e-3,
        pixel_size_m=pixel_mm * 1e-3,
        width=geometry.size_px,
        height=geometry.size_px,
        mirrored=geometry.mirrored,
        iso_centre=iso_centre,
        roll_rad=np.radians(angles.roll_deg),
    )


def published_projection(scenario: Scenario, plane: Plane, pair: int) -> Projection:
    """The projection that is published with a pair: off by the calibration error, constant over the sequence."""
    error = scenario.calibration_error
    if error.swapped:
        plane = "b" if plane == "a" else "a"
    projection = true_projection(scenario, plane, pair, as_published=True)
    if not (error.angle_deg or error.shift_mm or error.shift_px):
        return projection
    random = np.random.default_rng([scenario.seed, 70, 0 if plane == "a" else 1])
    axis, shift = (_direction(random, 3) for _ in range(2))
    in_image = error.shift_px * _direction(random, 2)
    off = rigid(np.radians(error.angle_deg) * axis, 1e-3 * error.shift_mm * shift)
    to_image = np.eye(3)
    to_image[:2, 2] = in_image
    return Projection(to_image @ projection.matrix @ off, projection.width, projection.height)


def _direction(random: np.random.Generator, dimensions: int) -> Array:
    vector = random.normal(size=dimensions)
    return np.asarray(vector / np.linalg.norm(vector))
