"""From what is known of a track to the result of a pair: pose, covariance, curve, and what the ring does by itself."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import numpy.typing as npt

from lasso_motion_ros.geometry.covariance import at_world_origin
from lasso_motion_ros.geometry.frames import FramePair
from lasso_motion_ros.geometry.transforms import rotation_from_vector
from lasso_motion_ros.ring.association import Hypothesis
from lasso_motion_ros.ring.track import Track
from lasso_motion_ros.ring.uncertainty import calibration_covariance, pivot_covariance
from lasso_motion_ros.tracking.tracker import RingMotion, TrackerState, TrackResult

Array = npt.NDArray[np.float64]

RESOLVED_SHARE = 0.5  # of the prior's standard deviation: the images tell more of the spin than was known before


def without_pose(track: Track, pair: FramePair, state: TrackerState, reason: str) -> TrackResult:
    """A result without a pose and without the ring's curve."""
    return TrackResult(
        pair.stamp_ns,
        state,
        reason,
        None,
        None,
        None,
        track.reference_ns,
        seed_gap_mm=track.agreement.gap_mm,
        catheter=track.electrodes,
        temporal_filter=track.display.filters,
    )


def with_curve(
    track: Track, pair: FramePair, state: TrackerState, reason: str, best: Hypothesis, prior_turn_rad: float
) -> TrackResult:
    """A result that shows the ring where it was detected.

    Args:
        track: all that is known; its displacement is the ring's.
        pair: the pair.
        state: the state.
        reason: why.
        best: the detection.
        prior_turn_rad: standard deviation of the ring's own turn, before it is seen.
    """
    alignment, displacement = best.detection.alignment, track.seen_at
    shape = rotation_from_vector(alignment.turn) * np.exp(alignment.stretch)
    own = alignment.turn - track.rotation.between(track.home, displacement).vector
    axis = track.model.axis
    spin = float(axis @ own)
    spread = float(np.sqrt(axis @ alignment.turn_covariance @ axis))
    return replace(
        without_pose(track, pair, state, reason),
        loop=np.asarray(track.centre + displacement + track.model.arms @ shape.T),
        residual_px={
            plane: fit.residual_mm / pair.frames[plane].projection.millimetres_per_pixel(fit.centre)
            for plane, fit in best.detection.planes.items()
        },
        ring=RingMotion(
            tilt_rad=float(np.linalg.norm(own - spin * axis)),
            spin_rad=spin if spread < RESOLVED_SHARE * prior_turn_rad else None,
            size=float(np.exp(alignment.stretch)),
        ),
    )


def covariance_since_reference(track: Track, position: Array, best: Hypothesis | None) -> Array:
    """(3, 3) m² of the ring's displacement since the reference: all that makes it uncertain.

    Args:
        track: all that is known; its displacement is the ring's.
        position: (3, 3) m² of that displacement.
        best: the detection; None at the seed pair.
    """
    calibration = calibration_covariance(track.seen_at - track.reference, track.agreement.gap_mm)
    since_s = track.last_s - 1e-9 * (track.reference_ns - track.start_ns)
    position = position + track.reference_covariance + calibration + track.seat.covariance(since_s)
    if best is not None:
        position = position + pivot_covariance(best.detection.alignment.turn, best.detection.alignment.stretch)
    return position


def with_pose(result: TrackResult, track: Track, position: Array) -> TrackResult:
    """The same result with the motion since the reference, and its covariance.

    Args:
        result: of the pair.
        track: all that is known; its displacement is the ring's.
        position: (3, 3) m² of that displacement since the reference.
    """
    displacement = track.seen_at
    rotation = track.rotation.between(track.reference, displacement)
    motion = np.eye(4)
    motion[:3, :3] = rotation_from_vector(rotation.vector)
    # About the ring's centre at the reference, which goes where the ring's centre has gone.
    centre = track.centre + track.reference
    motion[:3, 3] = centre + displacement - track.reference - motion[:3, :3] @ centre
    covariance = at_world_origin(track.centre + displacement, position, rotation.covariance)
    return replace(result, motion=motion, covariance=covariance)
