"""Examines a recording as `examiner` does a live graph; and the facts found, in words."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from lasso_motion_ros.core.progress import progress
from lasso_motion_ros.geometry.frames import PLANES, Plane
from msg_adapters.checks.examination import Examination
from msg_adapters.checks.graph_checks import Endpoint, TopicFacts
from msg_adapters.recordings.reader import RecordingReader
from msg_adapters.sync.plane_source import PlaneSource


def examine_recording(
    recording: Path,
    remap: Mapping[str, str] | None = None,
    *,
    sources: Mapping[Plane, PlaneSource] | None = None,
    offset: bool = False,
    quiet: bool = True,
) -> tuple[Examination, dict[str, TopicFacts], str | None]:
    """Read all messages of a recording.

    Args:
        recording: MCAP file or bag directory.
        remap: recorded topic → the name it is read as.
        sources: per plane, which part of the pictures the tracker takes; None: all of them.
        offset: measure by how much one plane's pictures are later than the other's.
        quiet: no progress bar.

    Returns:
        The messages examined, the facts of all topics, and what is wrong with the recording as a file, or None.

    Raises:
        RecordingError: it cannot be read.
    """
    reader = RecordingReader(recording, remap=remap)
    examination = Examination(live=False, sources=sources, offset=offset)
    for message in progress(reader.raw_messages(), None, "looking", quiet):
        examination.add(message.topic, message.type_name, message.data, message.log_time_ns)
    latched, best_effort = reader.latched_topics, reader.best_effort_topics
    topics = {
        name: TopicFacts(
            type_name,
            publishers=(Endpoint("recorded", name not in best_effort, name in latched),),
            messages=examination.counts[name],
        )
        for name, type_name in reader.topics.items()
    }
    return examination, topics, reader.damage


def describe_facts(facts: Mapping[str, Any]) -> list[str]:
    """What was seen, a line a plane and one for the pairs."""
    lines = []
    for plane in PLANES:
        seen = facts[f"plane_{plane}"]
        rate = "" if seen["rate_hz"] is None else f" at {seen['rate_hz']:.3g}/s"
        kinds = ", ".join([*seen["sizes"], *seen["encodings"]]) or "none"
        lines.append(
            f"plane {plane}: {seen['images']} images{rate} ({kinds}),"
            f" {seen['calibrations']} calibrations, {seen['seeds']} sets of clicks"
        )
    offset = "" if facts["plane_b_offset_s"] is None else f", b {facts['plane_b_offset_s'] * 1e3:.1f} ms behind a"
    state = "" if facts["state"] is None else f"; the tracker's state: {facts['state']}"
    lines.append(f"pairs: {facts['pairs']}{offset}{state}")
    return lines


def describe_offset(facts: Mapping[str, Any]) -> str:
    """The measured offset between the planes' pictures, in a line that says what to do with it."""
    found = facts["film_offset"]
    if found is None:
        return "offset: the pictures do not tell which plane is later: too short, hardly any motion, or too regular"
    late, good_to = found["seconds"], 0.5 * found["frame_s"]
    by = f"by what moves in both films (correlation {found['correlation']:.2f}), good to {good_to:.3f} s"
    if abs(late) <= good_to:
        return f"offset: the stamps of both planes agree, {by}"
    plane = "b" if late > 0.0 else "a"
    cure = f"set plane_{plane}.stamp_offset_s to {abs(late):.3f}"
    return f"offset: plane {plane}'s stamps are {abs(late):.3f} s later than the other's {by}: {cure}"
