"""What the pipeline gives out: messages to be published, and counts."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

from lasso_motion_ros.geometry.frames import Plane
from lasso_motion_ros.stream.heartbeat_separation import HeartbeatStatus
from lasso_motion_ros.tracking.tracker import Description, RingMotion, TrackerState
from msg_adapters.answer_bytes import answer_bytes
from msg_adapters.sync.calibrated_frames import CalibrationCounts
from msg_adapters.sync.pairing import PlaneCounts
from msg_adapters.topics import Topic


@dataclass(frozen=True, eq=False)
class Output:
    """A message to be published, made when it is asked for: a pose is out before the loop's message is made.

    Attributes:
        topic: where.
        make_fields: makes its fields.
        stamp_ns: plane A's stamp of the pair it answers; 0 where it answers none.
    """

    topic: Topic
    make_fields: Callable[[], Mapping[str, Any]]
    stamp_ns: int

    @cached_property
    def fields(self) -> Mapping[str, Any]:
        """The message's fields."""
        return self.make_fields()

    @cached_property
    def data(self) -> bytes:
        """The message as it goes over the wire (CDR)."""
        return answer_bytes(self.topic.type_name, self.fields)


@dataclass(frozen=True)
class SeedCounts:
    """What became of clicks since the start.

    Attributes:
        taken: how many times they made a model.
        refused: how many times they were refused, in one plane or both.
        refusal: why, the last time; empty before the first.
    """

    taken: int
    refused: int
    refusal: str


@dataclass(frozen=True, eq=False)
class PipelineStatistics:
    """Counts since the start, for diagnostics and summaries.

    Attributes:
        state: the state now.
        reason: why, in a few plain words.
        pairs: pairs answered.
        half_pairs: of those, with a plane missing.
        poses: of those, with a pose.
        states: pairs answered, by state.
        problems: problems, by topic.
        frames: per plane, what became of images and calibrations before pairing.
        pairing: per plane, what became of images in pairing.
        seeds: what became of clicks.
        remarks: per plane, what is to be known of its images; empty where there is nothing.
        residual_px: per plane, the last result's residual.
        ring: what the ring did by itself in the last pair.
        seed_gap_mm: by which the planes disagreed at the seed, mm; None without a seed, or where that is not judged.
        catheter: the last result's.
        temporal_filter: per plane, the last result's.
        offset_ns: time from A's to B's exposure, as the last pairs have it or as it is configured.
        calibrated: the planes whose last calibration is valid.
        heartbeat: how the heartbeat is kept out of `motion`; None where it is not to be.
        waiting_clicks: what clicks are kept and what they wait for, in words; empty where none are kept.
    """

    state: TrackerState
    reason: str
    pairs: int
    half_pairs: int
    poses: int
    states: dict[TrackerState, int]
    problems: dict[str, int]
    frames: dict[Plane, CalibrationCounts]
    pairing: dict[Plane, PlaneCounts]
    seeds: SeedCounts
    remarks: dict[Plane, str] = field(default_factory=dict)
    residual_px: dict[Plane, float] = field(default_factory=dict)
    ring: RingMotion | None = None
    seed_gap_mm: float | None = None
    catheter: Description | None = None
    temporal_filter: dict[Plane, float] = field(default_factory=dict)
    offset_ns: int = 0
    calibrated: tuple[Plane, ...] = ()
    heartbeat: HeartbeatStatus | None = None
    waiting_clicks: str = ""
