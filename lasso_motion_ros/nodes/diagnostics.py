"""What the tracker node says on /diagnostics."""

from __future__ import annotations

import math
import time
from collections.abc import Mapping
from dataclasses import asdict
from typing import Any

from lasso_motion_ros.core.compiled import arithmetic
from lasso_motion_ros.geometry.frames import Plane
from lasso_motion_ros.nodes.state_words import state_words
from lasso_motion_ros.nodes.watch import StreamWatch
from lasso_motion_ros.stream.outputs import PipelineStatistics
from lasso_motion_ros.tracking.tracker import TrackerState
from msg_adapters.topics import CLICKS_REFUSED_KEY, CLICKS_TAKEN_KEY, LAST_REFUSAL_KEY, POSTURE_KEY

OK, WARN, ERROR = b"\x00", b"\x01", b"\x02"
PAIRS, HALF_PAIRS, DROPPED_PAIRS = "pairs answered", "of these with a plane missing", "pairs dropped"
_LEVELS = {
    TrackerState.TRACKING: OK,
    TrackerState.INACTIVE: OK,
    TrackerState.LOST: ERROR,
    TrackerState.DISPLACED: ERROR,
}


def tracker_status(
    node_name: str,
    state: TrackerState,
    statistics: PipelineStatistics | None = None,
    dropped_pairs: int = 0,
    latencies: Mapping[str, str] | None = None,
    pose_age_s: float | None = None,
    posture: str | None = None,
) -> dict[str, Any]:
    """Fields of the status `<node>: tracker`.

    Args:
        node_name: the node's full name.
        state: what it publishes on `state`.
        statistics: the pipeline's counts; None while the node is not active.
        dropped_pairs: pairs that were never worked on.
        latencies: percentiles, in words.
        pose_age_s: since the last pose was published, steady clock; None where none was.
        posture: how the patient lies, as the tracker was told; None while the node is not active.
    """
    values: dict[str, Any] = {}
    message = state.value
    if statistics is not None:
        message = state_words(state, statistics.reason, pose_age_s)
        values = {
            PAIRS: statistics.pairs,
            HALF_PAIRS: statistics.half_pairs,
            "poses": statistics.poses,
            DROPPED_PAIRS: dropped_pairs,
            CLICKS_TAKEN_KEY: statistics.seeds.taken,
            CLICKS_REFUSED_KEY: statistics.seeds.refused,
        }
        if statistics.seeds.refusal:
            values[LAST_REFUSAL_KEY] = statistics.seeds.refusal
        if pose_age_s is not None:
            values["age of the last pose (s)"] = f"{pose_age_s:.3f}"
        values |= latencies or {}
        values["arithmetic"] = arithmetic()
        if posture is not None:
            values[POSTURE_KEY] = posture
        if statistics.pairs > statistics.half_pairs:
            values["time from A's to B's exposure (s)"] = f"{1e-9 * statistics.offset_ns:.3f}"
        if statistics.seed_gap_mm is not None:
            values["planes' disagreement at the seed (mm)"] = f"{statistics.seed_gap_mm:.2f}"
        if statistics.catheter is not None:
            values["catheter"] = statistics.catheter.known or "being looked at"
        for plane, residual in statistics.residual_px.items():
            values[f"residual plane_{plane} (px)"] = f"{residual:.2f}"
        for plane, share in statistics.temporal_filter.items():
            values[f"temporal filter, plane {plane.upper()}"] = f"{share:.2f}"
        if (ring := statistics.ring) is not None:
            values["ring's own tilt (deg)"] = f"{math.degrees(ring.tilt_rad):.1f}"
            if ring.spin_rad is not None:
                values["ring's own spin (deg)"] = f"{math.degrees(ring.spin_rad):.1f}"
            values["ring's size, relative"] = f"{ring.size:.3f}"
    return _status(f"{node_name}: tracker", _LEVELS.get(state, WARN), message, values)


def plane_status(
    node_name: str, plane: Plane, statistics: PipelineStatistics, reliable: bool | None, watch: StreamWatch
) -> dict[str, Any]:
    """Fields of the status `<node>: plane_x`.

    Args:
        node_name: the node's full name.
        plane: `a` or `b`.
        statistics: the pipeline's counts.
        reliable: how the images are subscribed; None while no publisher is known.
        watch: knows what got lost on the way, and what the clocks say.
    """
    counts = asdict(statistics.frames[plane]) | asdict(statistics.pairing[plane])
    values: dict[str, Any] = {name.replace("_", " "): value for name, value in counts.items()}
    if remark := statistics.remarks.get(plane):
        values["remark"] = remark
    missing, expected = watch.missing(plane)
    values[f"missing of the last {expected}"] = missing
    offset_s = watch.clock_offset_s()
    if plane == "b" and offset_s is not None:
        values["stamps ahead of plane A's on arrival (s)"] = f"{offset_s:.3f}"
    name = f"{node_name}: plane_{plane}"
    if silent := watch.silence_words(plane, time.monotonic()):
        return _status(name, WARN, silent, values)
    if reliable is None:
        return _status(name, WARN, "nobody publishes images", values)
    return _status(name, OK, "images", {**values, "subscribed": "reliable" if reliable else "best effort"})


def heartbeat_status(node_name: str, statistics: PipelineStatistics) -> list[dict[str, Any]]:
    """Fields of the status `<node>: heartbeat`: how it is kept out of `motion`; nothing where it is not to be."""
    heartbeat = statistics.heartbeat
    if heartbeat is None:
        return []
    return [_status(f"{node_name}: heartbeat", OK if heartbeat.works else WARN, heartbeat.text, heartbeat.values)]


def _status(name: str, level: bytes, message: str, values: Mapping[str, Any]) -> dict[str, Any]:
    return {
        "name": name,
        "level": level,
        "message": message,
        "hardware_id": "",
        "values": [{"key": key, "value": str(value)} for key, value in values.items()],
    }
