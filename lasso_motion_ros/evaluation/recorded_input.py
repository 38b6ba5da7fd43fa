"""From recordings to what is evaluated: the truth beside the images, and what the tracker published."""

from __future__ import annotations

from bisect import bisect_left, bisect_right
from collections import defaultdict
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from lasso_motion_ros.core.errors import MessageError, RecordingError
from lasso_motion_ros.evaluation.measures import PairEstimate, PairTruth, Truth
from lasso_motion_ros.geometry.frames import PLANES, Plane
from lasso_motion_ros.geometry.projection import Projection
from msg_adapters.calibrations import decode_camera_info
from msg_adapters.markers import DELETE, decode_points
from msg_adapters.messages import stamp_to_ns
from msg_adapters.poses import decode_pose
from msg_adapters.recordings.reader import RecordingReader
from msg_adapters.seeds import decode_polygon
from msg_adapters.sync.partner import PartnerRule
from msg_adapters.topics import (
    CATHETER,
    DIAGNOSTICS,
    LAST_LATENCY_KEY,
    MOTION,
    MOTION_RAW,
    MOTION_WITH_COVARIANCE,
    REFERENCE,
    STATE,
    TRUE_CATHETER,
    TRUE_MOTION,
    TRUE_RESPIRATORY_MOTION,
    TRUE_TARGETS,
    camera_info_topic,
    true_centreline_topic,
)

Array = npt.NDArray[np.float64]

_NO_PAIR = 0  # stamp of what a tracker says while no pair comes


@dataclass(frozen=True, eq=False)
class ReadTruth:
    """The truth of a recording, as far as it could be read.

    Attributes:
        truth: what is known.
        damage: why the rest could not be read, or None.
    """

    truth: Truth
    damage: str | None


def read_truth(path: str | Path, remap: Mapping[str, str] | None = None) -> ReadTruth:
    """Read a recording's truth and published geometry; no image is decoded.

    The pairs are those of `/ground_truth/motion`; in a recording with centrelines only, those of the centrelines.

    Raises:
        RecordingError: it cannot be read at all, or holds no truth.
        MessageError: a calibration or pose in it breaks the contract.
    """
    motion: dict[int, Array] = {}
    respiratory: dict[int, Array] = {}
    centrelines: dict[int, dict[Plane, Array]] = defaultdict(dict)
    calibrations: dict[Plane, dict[int, Projection]] = {plane: {} for plane in PLANES}
    curves: dict[str, Array] = {}
    plane_of_centreline = {true_centreline_topic(plane).recorded_name: plane for plane in PLANES}
    plane_of_calibration = {camera_info_topic(plane).recorded_name: plane for plane in PLANES}
    single = (TRUE_CATHETER.recorded_name, TRUE_TARGETS.recorded_name)
    poses = {TRUE_MOTION.recorded_name: motion, TRUE_RESPIRATORY_MOTION.recorded_name: respiratory}
    reader = RecordingReader(path, remap)
    for recorded in reader.messages([*poses, *single, *plane_of_centreline, *plane_of_calibration]):
        topic, message = recorded.topic, recorded.message
        stamp_ns = stamp_to_ns(message.header.stamp)
        if topic in poses:
            poses[topic][stamp_ns] = decode_pose(message)
        elif topic in single:
            curves[topic] = decode_points(message)
        elif topic in plane_of_centreline:
            centreline = decode_polygon(message)
            if len(centreline) > 1:
                centrelines[stamp_ns][plane_of_centreline[topic]] = centreline
        else:
            try:
                calibrations[plane_of_calibration[topic]][stamp_ns] = decode_camera_info(message)
            except MessageError as error:
                raise MessageError(f"{path}: {topic}: {error}") from error
    if not motion and not centrelines:
        raise RecordingError(f"{path}: no {TRUE_MOTION.name} and no {next(iter(plane_of_centreline))}: no truth")
    stamps = sorted(motion or centrelines)
    period_ns = int(np.median(np.diff(stamps))) if len(stamps) > 1 else None
    window_ns = PartnerRule().window_ns(period_ns, period_ns)
    choosers = {plane: _Calibrations(infos) for plane, infos in calibrations.items() if infos}
    pairs = [
        PairTruth(
            stamp_ns,
            motion.get(stamp_ns),
            respiratory.get(stamp_ns),
            centrelines.get(stamp_ns, {}),
            {plane: chooser.at(stamp_ns, window_ns) for plane, chooser in choosers.items()},
        )
        for stamp_ns in stamps
    ]
    return ReadTruth(Truth(pairs, curves.get(single[0]), curves.get(single[1])), reader.damage)


class _Calibrations:
    """One plane's calibrations, by stamp; one that was latched holds until the next."""

    def __init__(self, by_stamp: Mapping[int, Projection]) -> None:
        self._stamps = sorted(by_stamp)
        self._projections = [by_stamp[stamp] for stamp in self._stamps]

    def at(self, stamp_ns: int, window_ns: tuple[int, int]) -> Projection:
        """That of the pair's own exposure, else the last one before it (or the first of all).

        Args:
            stamp_ns: plane A's exposure.
            window_ns: how long after it, from and to, an exposure still belongs to the pair (plane B's).
        """
        earliest, latest = window_ns
        after = bisect_left(self._stamps, stamp_ns + earliest)
        if after < len(self._stamps) and (after == 0 or self._stamps[after] <= stamp_ns + latest):
            return self._projections[after]
        return self._projections[after - 1]


def read_estimates(path: str | Path, remap: Mapping[str, str] | None = None) -> list[PairEstimate]:
    """Read what a tracker published, offline or recorded from a live graph, in order of time.

    State and reference carry no stamp of the pair: those in force when the pose was logged are its own. A file without
    `motion_raw` is another tracker's: its `motion` is scored, or else the pose of `motion_with_covariance`.

    Raises:
        RecordingError: it cannot be read, or holds none of the tracker's topics.
        MessageError: a pose that is not one.
    """
    fields: dict[int, dict[str, Any]] = defaultdict(dict)
    logged: dict[int, int] = {}
    states: list[tuple[int, str]] = []
    references: list[tuple[int, int]] = []
    topics = {t.recorded_name for t in (MOTION_RAW, MOTION, MOTION_WITH_COVARIANCE, CATHETER, REFERENCE, STATE)}
    reader = RecordingReader(path, remap)
    if not topics & set(reader.topics):
        raise RecordingError(f"{path}: not a result of the tracker: none of {', '.join(sorted(topics))}")
    for recorded in reader.messages(sorted(topics)):
        topic, message = recorded.topic, recorded.message
        if topic == STATE.recorded_name:
            states.append((recorded.log_time_ns, message.data))
            continue
        if topic == REFERENCE.recorded_name:
            references.append((recorded.log_time_ns, stamp_to_ns(message.stamp)))
            continue
        stamp_ns = stamp_to_ns(message.header.stamp)
        if stamp_ns == _NO_PAIR:
            continue
        logged.setdefault(stamp_ns, recorded.log_time_ns)
        pair = fields[stamp_ns]
        if topic == MOTION_RAW.recorded_name:
            pair["motion_raw"] = decode_pose(message)
            logged[stamp_ns] = recorded.log_time_ns
        elif topic == MOTION.recorded_name:
            pair["motion"] = decode_pose(message)
        elif topic == MOTION_WITH_COVARIANCE.recorded_name:
            pair["covariance"] = np.array(message.pose.covariance, dtype=np.float64).reshape(6, 6)
            if MOTION.recorded_name not in reader.topics:
                pair["motion"] = decode_pose(message)
        elif message.action != DELETE:
            pair["loop"] = decode_points(message)
    if MOTION_RAW.recorded_name not in reader.topics:
        for pair in fields.values():
            pair["motion_raw"] = pair.get("motion")
    return [
        PairEstimate(
            stamp_ns,
            state=_in_force(states, logged[stamp_ns]) or "",
            reference_ns=_in_force(references, logged[stamp_ns]),
            **pair,
        )
        for stamp_ns, pair in sorted(fields.items())
    ]


def read_latencies_ms(path: str | Path) -> Array:
    """(N,) latencies in milliseconds that a live tracker told on /diagnostics; empty where none was recorded."""
    latencies = []
    reader = RecordingReader(path)
    if reader.topics.get(DIAGNOSTICS.recorded_name) != DIAGNOSTICS.type_name:
        return np.zeros(0)
    for recorded in reader.messages([DIAGNOSTICS.recorded_name]):
        for status in recorded.message.status:
            latencies += [float(entry.value) for entry in status.values if entry.key == LAST_LATENCY_KEY]
    return np.array(latencies)


def _in_force(history: list[tuple[int, Any]], log_time_ns: int) -> Any:
    """The last value logged up to a time, or None."""
    known = bisect_right(history, log_time_ns, key=lambda entry: entry[0])
    return history[known - 1][1] if known else None
