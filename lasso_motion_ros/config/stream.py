"""Parameters of the stream around the tracker, which the tracker node and the offline command share."""

from __future__ import annotations

from dataclasses import dataclass

from lasso_motion_ros.config.parameters import group, parameter, tuning
from lasso_motion_ros.config.tracker import TrackerConfig


@dataclass(frozen=True)
class SyncConfig:
    """How the images of the two planes are paired, by their stamps."""

    jitter_s: float = parameter(
        0.005,
        "an image of B stamped up to this much before its A still belongs to it",
        unit="s",
        minimum=0.0,
        maximum=10.0,
    )
    plane_b_offset_s: float = parameter(
        -1.0,
        "time from A's to B's exposure where it is known; negative: unknown, B follows its A by at most half a period",
        unit="s",
        minimum=-10.0,
        maximum=10.0,
    )


@dataclass(frozen=True)
class PlaneConfig:
    """What a plane's source publishes beside its exposures; the same for tracker, overlay and page."""

    crop: str = parameter(
        "",
        "x y width height: the X-ray field in the published picture, which alone is tracked and shown; clicks stay in"
        " the published picture's pixels, and the calibration may be of the picture or of the field, as its size says;"
        " empty: all of it",
        unit="px",
    )
    stamp_offset_s: float = parameter(
        0.0,
        "by how much the stamps of images, calibrations and clicks are later than the exposures: it is subtracted, and"
        " results carry the exposures' time",
        unit="s",
        minimum=-10.0,
        maximum=10.0,
    )


@dataclass(frozen=True)
class HeartbeatConfig:
    """How the heartbeat is kept out of motion; motion_raw keeps it. A change begins anew with the next pair."""

    mode: str = tuning(
        "none",
        "none: motion is motion_raw; gate: motion is updated in one window of each beat, which needs R peaks; filter:"
        " the heartbeat is estimated and subtracted, with R peaks or, at enough pairs a second, without",
        choices=("none", "gate", "filter"),
    )
    window_start: float = tuning(
        0.45, "gate: the window opens at this fraction of the beat, counted from the R peak", minimum=0.0, maximum=1.0
    )
    window_end: float = tuning(
        0.8,
        "gate: the window closes at this fraction; if below window_start, it spans the R peak",
        minimum=0.0,
        maximum=1.0,
    )
    slowest_bpm: float = tuning(
        45.0, "filter without R peaks: slowest heart rate considered", unit="1/min", minimum=20.0, maximum=240.0
    )
    fastest_bpm: float = tuning(
        110.0,
        "filter without R peaks: fastest heart rate considered; needs more than twice as many pairs a minute",
        unit="1/min",
        minimum=20.0,
        maximum=240.0,
    )
    excursion_mm: float = tuning(
        0.8, "filter: rough size of the heartbeat's motion", unit="mm", minimum=0.05, maximum=10.0
    )


@dataclass(frozen=True)
class StreamConfig(TrackerConfig):
    """The tracker's parameters and those of the stream around it.

    What concerns the live node alone (how it starts, how it subscribes) stands here too, since one file serves the
    node and the offline command, which has no use for it.
    """

    world_frame: str = parameter("patient_table", "frame fixed to the table top, in which every pose is published")
    publish_tf: bool = parameter(
        True, "say on /tf where atrium_frame is, with each motion, and the standard views' cameras; needs tf2_msgs"
    )
    atrium_frame: str = parameter(
        "left_atrium", "frame on /tf that moves with the atrium: at the reference the world's"
    )
    seed_buffer_pairs: int = parameter(32, "past pairs kept for seeds that come late", minimum=1, maximum=1000)
    autostart: bool = parameter(True, "the node configures and activates itself")
    image_reliability: str = parameter(
        "auto",
        "reliability of the image subscriptions; auto: as the publisher offers",
        choices=("auto", "reliable", "best_effort"),
    )
    stamp_source: str = parameter(
        "header",
        "what counts as an image's time of exposure; arrival: the time it arrives, for sources whose stamps are zero"
        " or whose clocks disagree (each CameraInfo then holds until the next)",
        choices=("header", "arrival"),
    )
    seeds_file: str = parameter(
        "", "YAML file with the clicks of both planes, for unattended runs; see lasso-motion track --help"
    )
    automatic_initialisation: str = tuning(
        "propose",
        "the ring is looked for without clicks while there is no model, or it has been LOST or DISPLACED for 5 s;"
        " propose: published on proposal until ~/accept or clicks say so; start: tracked at once, where there is no"
        " model and no other ring fits nearly as well; off: clicks only",
        choices=("off", "propose", "start"),
    )
    image_depth: int = parameter(10, "queue depth of each image subscription", minimum=1, maximum=100)
    stream_timeout_s: float = tuning(
        0.0,
        "LOST, with the reason, where for so long no image of either plane has come, none could be used, or the tracker"
        " has not answered; 0: three frame periods, 1 to 10 s",
        unit="s",
        minimum=0.0,
        maximum=3600.0,
    )
    plane_a: PlaneConfig = group(PlaneConfig)
    plane_b: PlaneConfig = group(PlaneConfig)
    sync: SyncConfig = group(SyncConfig)
    heartbeat: HeartbeatConfig = group(HeartbeatConfig)
