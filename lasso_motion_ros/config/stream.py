"""Parameters of the stream around the tracker, which the tracker node and the offline command share."""

from __future__ import annotations

from dataclasses import dataclass, field

from lasso_motion_ros.config.parameters import parameter
from lasso_motion_ros.config.tracker import TrackerConfig


@dataclass(frozen=True)
class SyncConfig:
    """How images of the two planes are paired, by their stamps."""

    jitter_s: float = parameter(0.005, "a B this much earlier than its A still belongs to it", unit="s", minimum=0.0)
    plane_b_offset_s: float = parameter(
        -1.0, "known time from A's to B's exposure; negative: unknown, pair by the half-period rule", unit="s"
    )


@dataclass(frozen=True)
class HeartbeatConfig:
    """How the heartbeat is kept out of `motion`; `motion_raw` keeps it."""

    mode: str = parameter(
        "none",
        "none: motion is motion_raw; gate: motion is updated in a window of the beat only, by R peaks;"
        " filter: the heartbeat is estimated and taken away, by R peaks or, at enough pairs a second, without",
        choices=("none", "gate", "filter"),
    )
    window_start: float = parameter(
        0.45, "gate: the window opens at this part of the beat, counted from its R peak", minimum=0.0, maximum=1.0
    )
    window_end: float = parameter(
        0.8, "gate: it closes; below window_start it reaches over the R peak", minimum=0.0, maximum=1.0
    )
    slowest_bpm: float = parameter(
        45.0, "filter without R peaks: slowest heart looked for", unit="1/min", minimum=20.0, maximum=240.0
    )
    fastest_bpm: float = parameter(
        110.0,
        "filter without R peaks: fastest heart looked for; more than twice as many pairs a minute are needed",
        unit="1/min",
        minimum=20.0,
        maximum=240.0,
    )
    excursion_mm: float = parameter(
        0.8, "filter: size of the heartbeat's motion, roughly", unit="mm", minimum=0.05, maximum=10.0
    )


@dataclass(frozen=True)
class StreamConfig(TrackerConfig):
    """The tracker's parameters and those of the stream around it.

    What concerns the live node alone (how it starts, how it subscribes) stands here too, since one file serves the
    node and the offline command, which has no use for it.
    """

    world_frame: str = parameter("patient_table", "frame fixed to the table top; the frame of every pose published")
    seed_buffer_pairs: int = parameter(32, "past pairs kept for seeds with an older stamp", minimum=1, maximum=1000)
    autostart: bool = parameter(True, "the node configures and activates itself")
    image_reliability: str = parameter(
        "auto",
        "how the node subscribes to images; auto: as the publisher offers",
        choices=("auto", "reliable", "best_effort"),
    )
    stamp_source: str = parameter(
        "header",
        "what the node takes for an image's time of exposure; arrival: its receipt, for sources whose stamps are zero"
        " or whose clocks disagree (CameraInfo then holds until the next)",
        choices=("header", "arrival"),
    )
    seeds_file: str = parameter(
        "", "YAML file with the clicks of both planes, for unattended runs (see lasso-motion track --help)"
    )
    image_depth: int = parameter(10, "images a plane that may wait in the node's subscription", minimum=1, maximum=100)
    sync: SyncConfig = field(default_factory=SyncConfig)
    heartbeat: HeartbeatConfig = field(default_factory=HeartbeatConfig)
