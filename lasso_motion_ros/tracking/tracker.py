"""The tracker: one object with `initialise` and `track`, configured by one dataclass."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from enum import Enum
from typing import Protocol

import numpy as np
import numpy.typing as npt

from lasso_motion_ros.config.tracker import TrackerConfig
from lasso_motion_ros.geometry.frames import Frame, FramePair, Plane, Seed

Array = npt.NDArray[np.float64]


class TrackerState(Enum):
    """What the node publishes on `state`.

    The node says INACTIVE, the stream says what is waited for, and the tracker decides the other four for each pair.

    Attributes:
        INACTIVE: the node is not active.
        WAITING_FOR_CALIBRATION: there is no valid calibration of both planes yet.
        WAITING_FOR_SEED: there is no model.
        TRACKING: both planes show the loop and agree, and its motion is breathing.
        DEGRADED: there is a pose, but with a doubt that the reason names and the covariance holds.
        LOST: the loop is not seen, or what is seen is not believed.
        DISPLACED: the loop is seen, but off its breathing: the lasso was moved, and no longer tells how the heart
            moves. Our method's belief decides it (`ring/track_state.py`).
    """

    INACTIVE = "INACTIVE"
    WAITING_FOR_CALIBRATION = "WAITING_FOR_CALIBRATION"
    WAITING_FOR_SEED = "WAITING_FOR_SEED"
    TRACKING = "TRACKING"
    DEGRADED = "DEGRADED"
    LOST = "LOST"
    DISPLACED = "DISPLACED"

    @property
    def has_pose(self) -> bool:
        """Whether `motion` is published in this state."""
        return self in (TrackerState.TRACKING, TrackerState.DEGRADED)

    @property
    def is_alarm(self) -> bool:
        """Whether there is a model and yet no pose."""
        return self in (TrackerState.LOST, TrackerState.DISPLACED)

    @property
    def has_model(self) -> bool:
        """Whether the tracker has something to follow."""
        return self.has_pose or self.is_alarm

    @classmethod
    def tells_of_pose(cls, published: str) -> bool:
        """Whether a word published on `state` tells of a pose; none that is unknown does, nor an empty one."""
        return any(published == state.value for state in cls if state.has_pose)


class Description(Protocol):
    """What is known of something, in words that are worked out when somebody asks for them."""

    @property
    def text(self) -> str:
        """A line for people; asking takes as long as working it out does."""

    @property
    def known(self) -> str | None:
        """The line, once it has been worked out."""

    def work(self) -> Iterator[None]:
        """Work it out, in steps of about a millisecond: whoever must not be kept waiting comes between two of them."""


@dataclass(frozen=True)
class RingMotion:
    """What the ring has done by itself since the seed pair, the atrium's rotation taken away.

    Attributes:
        tilt_rad: angle of its axis against then.
        spin_rad: turn about that axis, as the electrodes show it; None where they do not resolve it.
        size: relative to then.
    """

    tilt_rad: float
    spin_rad: float | None
    size: float


@dataclass(frozen=True, eq=False)
class TrackResult:
    """What one pair gave.

    Attributes:
        stamp_ns: plane A's stamp.
        state: TRACKING, DEGRADED, LOST or DISPLACED.
        reason: why, in a few plain words; empty in TRACKING.
        motion: (4, 4) T with p_now = T · p_reference, world metres; None where there is no pose.
        covariance: (6, 6) of `motion` in ROS order (x, y, z, rotation about the fixed axes x, y, z; m, rad) at
            the world origin; None where there is no pose.
        loop: (N, 3) the catheter's curve now, world metres, N ≥ 64; None where there is none.
        reference_stamp_ns: the pair whose phase is the reference.
        residual_px: per plane, mean distance of the projected model to the lines found; empty where none.
        ring: what the ring does by itself; None where it is not seen or not told apart.
        seed_gap_mm: by which the planes disagreed on the ring's place at the seed, mm; None where that is not judged.
        catheter: what the images show of its kind: poles, their distances, the loop's size; None where that is not
            looked at.
        temporal_filter: per plane, the share of the last image that the display's filter over time keeps in the next;
            empty where none is recognised.
    """

    stamp_ns: int
    state: TrackerState
    reason: str
    motion: Array | None
    covariance: Array | None
    loop: Array | None
    reference_stamp_ns: int
    residual_px: dict[Plane, float] = field(default_factory=dict)
    ring: RingMotion | None = None
    seed_gap_mm: float | None = None
    catheter: Description | None = None
    temporal_filter: dict[Plane, float] = field(default_factory=dict)

    def with_loop(self, loop: Array) -> TrackResult:
        """The same with the catheter's curve (N, 3), world metres."""
        return replace(self, loop=loop)


class Tracker(Protocol):
    """What both methods offer to the pipeline."""

    def initialise(self, pair: FramePair, seed: Seed) -> TrackResult:
        """Build the model from the clicks on `pair`; its motion is the identity, its phase the reference."""

    def track(self, pair: FramePair) -> TrackResult:
        """Find the catheter in the next pair."""

    def prepare(self, frame: Frame) -> None:
        """Work out ahead what the next pair asks of plane A's frame alone; its answer is the same without it.

        Where another pair comes, nothing is kept of it but what was learned from the last pair.
        """

    def learn(self) -> None:
        """Learn from the last pair what its answer did not wait for; the next pair does so otherwise."""

    def leave_out(self, pair: FramePair) -> None:
        """Take note of a pair for which there is no time: it has been shown, and what filters film over time saw it."""

    def reset(self) -> None:
        """Forget model and motion."""

    def set_reference(self) -> None:
        """Make the present phase the reference."""

    def reconfigure(self, config: TrackerConfig) -> None:
        """Go on with other tuning parameters (those that are not read-only); the model is kept."""
