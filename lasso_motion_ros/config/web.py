"""Parameters of the node behind the page."""

from __future__ import annotations

from dataclasses import dataclass

from lasso_motion_ros.config.parameters import group, parameter
from lasso_motion_ros.config.stream import PlaneConfig, SyncConfig

AUTO_AXES, UNKNOWN_AXES = "auto", "unknown"


@dataclass(frozen=True)
class RoundsConfig:
    """A recording that is played over and over with later stamps, as one long stream."""

    first_ns: int = parameter(0, "a time between two of its rounds, just before the first one's images", unit="ns")
    period_ns: int = parameter(
        0, "how much later each round's stamps are; clicks are saved under the recorded ones; 0: no rounds", unit="ns",
        minimum=0,
    )  # fmt: skip


@dataclass(frozen=True)
class WebConfig:
    """All parameters of the node behind the page."""

    host: str = parameter("127.0.0.1", "address to serve the page on; the default lets in this machine only")
    port: int = parameter(8080, "TCP port of the page; 0: any free one", minimum=0, maximum=65535)
    allowed_hosts: str = parameter(
        "", "further host names under which browsers may ask for the page, separated by blanks"
    )
    tracker: str = parameter("lasso_tracker", "name of the tracker node, whose services the page calls")
    overlay: str = parameter("lasso_overlay", "name of the overlay node, whose style the page changes")
    answer_wait_s: float = parameter(
        0.15,
        "longest time for which a pair waits for the tracker's answer before it is shown",
        unit="s",
        minimum=0.0,
        maximum=5.0,
    )
    world_frame: str = parameter(
        "patient_table", "frame fixed to the table top, in which motion and catheter are given"
    )
    axes: str = parameter(
        AUTO_AXES,
        "where in the patient the world's x, y and z point, a letter each of R, L, A, P, S, I, by which directions and"
        " the planes' angles are named; auto: LPS where posture is supine and both calibrations look like it;"
        " unknown: x, y, z, and no angles",
    )
    plane_a: PlaneConfig = group(PlaneConfig)
    plane_b: PlaneConfig = group(PlaneConfig)
    sync: SyncConfig = group(SyncConfig)
    rounds: RoundsConfig = group(RoundsConfig)
