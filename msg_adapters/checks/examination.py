"""Collects a stream's messages, live or recorded, and reports what is wrong with it."""

from __future__ import annotations

import contextlib
import struct
from collections import Counter
from collections.abc import Mapping
from dataclasses import asdict
from typing import Any

from lasso_motion_ros.geometry.frames import PLANES, Plane
from lasso_motion_ros.geometry.projection import Projection
from msg_adapters.checks.calibration_checks import CalibrationSamples, check_calibration, check_planes
from msg_adapters.checks.graph_checks import TopicFacts, check_graph
from msg_adapters.checks.image_checks import ImageSamples, check_images
from msg_adapters.checks.issue import SEVERITIES, Issue
from msg_adapters.checks.seed_checks import check_seeds
from msg_adapters.checks.stamp_checks import PlaneStamps, check_stamps, pairs_of
from msg_adapters.film_offset import FilmOffsetMeter
from msg_adapters.images import decode_image
from msg_adapters.messages import NANOSECONDS, stamp_to_ns
from msg_adapters.recorded_messages import jazzy_types
from msg_adapters.sync.plane_source import PlaneSource
from msg_adapters.topics import (
    STATE,
    camera_info_topic,
    compressed_image_topic,
    image_topic,
    seed_topic,
)

# How often an image is decoded (by arrival); of the others only the stamps are read, which costs nothing.
_SAMPLE_PERIOD_NS = NANOSECONDS
_MOST_SEEDS = 100
STATES_WITH_MODEL = ("TRACKING", "DEGRADED", "LOST", "DISPLACED")
"""On `state`: the tracker has a model of the lasso, which clicks began."""


class Examination:
    """The messages of one stream.

    Args:
        live: a running graph, not a recording.
        sources: per plane, which part of the pictures the tracker takes; None: all of them.
        offset: measure by how much one plane's pictures are later than the other's, which needs every picture.
    """

    def __init__(self, *, live: bool, sources: Mapping[Plane, PlaneSource] | None = None, offset: bool = False) -> None:
        self._offset = FilmOffsetMeter() if offset else None
        self._sources = sources or dict.fromkeys(PLANES, PlaneSource())
        self._live = live
        self.counts: Counter[str] = Counter()
        self._stamps: dict[Plane, PlaneStamps] = {plane: PlaneStamps() for plane in PLANES}
        self._images: dict[Plane, ImageSamples] = {plane: ImageSamples(self._sources[plane].crop) for plane in PLANES}
        self._calibrations: dict[Plane, CalibrationSamples] = {plane: CalibrationSamples() for plane in PLANES}
        self._seeds: dict[Plane, list[Any]] = {plane: [] for plane in PLANES}
        self._state: str | None = None
        self._undecodable: Counter[str] = Counter()
        self._raw: set[Plane] = set()
        self._sampled_ns: dict[str, int] = {}
        self._roles: dict[tuple[str, str], tuple[str, Plane]] = {
            (topic.recorded_name, topic.type_name): (role, plane)
            for plane in PLANES
            for role, topic in (
                ("image", image_topic(plane)),
                ("image", compressed_image_topic(plane)),
                ("calibration", camera_info_topic(plane)),
                ("seed", seed_topic(plane)),
                ("state", STATE),
            )
        }

    def add(self, topic: str, type_name: str, data: bytes, arrival_ns: int) -> None:
        """Take one message.

        Args:
            topic: its name in the contract, absolute.
            type_name: `package/msg/Name`.
            data: CDR bytes.
            arrival_ns: when it came, or its log time.
        """
        self.counts[topic] += 1
        if (topic, type_name) not in self._roles:
            return
        role, plane = self._roles[topic, type_name]
        if role == "image":
            if topic == image_topic(plane).recorded_name and plane not in self._raw:
                # Compressed ones, which came first, are not what the tracker takes.
                self._raw.add(plane)
                self._stamps[plane], self._images[plane] = PlaneStamps(), ImageSamples(self._sources[plane].crop)
            elif topic != image_topic(plane).recorded_name and plane in self._raw:
                return
            stamps = self._stamps[plane]
            stamps.stamps.append(_stamp_ns(data))
            stamps.arrivals.append(arrival_ns)
            if self._offset is not None:
                self._measure(self._offset, plane, type_name, data)
            if arrival_ns - self._sampled_ns.get(topic, -_SAMPLE_PERIOD_NS) < _SAMPLE_PERIOD_NS:
                return
            self._sampled_ns[topic] = arrival_ns
        elif role == "seed" and len(self._seeds[plane]) >= _MOST_SEEDS:
            return
        try:
            message: Any = jazzy_types().deserialize_cdr(data, type_name)
        except Exception:  # whatever the deserialiser raises: the bytes are not such a message
            self._undecodable[topic] += 1
            return
        if role == "image":
            self._images[plane].add(message)
        elif role == "calibration":
            self._calibrations[plane].add(message)
        elif role == "seed":
            self._seeds[plane].append(message)
        else:
            self._state = message.data

    def _measure(self, meter: FilmOffsetMeter, plane: Plane, type_name: str, data: bytes) -> None:
        with contextlib.suppress(Exception):  # what cannot be decoded is found where samples are looked at
            message: Any = jazzy_types().deserialize_cdr(data, type_name)
            stamp_ns = stamp_to_ns(message.header.stamp)
            meter.add(plane, stamp_ns, decode_image(message, self._sources[plane].crop))

    def issues(self, topics: Mapping[str, TopicFacts]) -> list[Issue]:
        """All issues, the worst first.

        Args:
            topics: contract name → facts, of all topics there are.
        """
        found = list(check_graph(topics, live=self._live))
        found += [
            Issue(
                "error", topic, f"{count} messages cannot be decoded", "see that publisher and type are ROS 2 Jazzy's"
            )
            for topic, count in self._undecodable.items()
        ]
        found += check_stamps(self._stamps, live=self._live)
        projections = {plane: self._projection(plane) for plane in PLANES}
        for plane in PLANES:
            info = topics.get(camera_info_topic(plane).recorded_name)
            found += check_images(image_topic(plane).recorded_name, self._images[plane])
            if self._calibrations[plane].stamps:
                found += check_calibration(
                    plane,
                    self._calibrations[plane],
                    self._stamps[plane].stamps,
                    {*self._images[plane].sizes, *self._images[plane].shapes},
                    latched=info is not None and any(publisher.latched for publisher in info.publishers),
                )
        found += check_planes(projections)
        pairs, _ = pairs_of(self._stamps)
        found += check_seeds(
            self._seeds, pairs, projections, live=self._live, has_model=self._state in STATES_WITH_MODEL
        )
        return sorted(found, key=lambda issue: SEVERITIES.index(issue.severity))

    def _measured(self) -> dict[str, float] | None:
        """How much later B's pictures are than A's; None where that was not to be measured, or is not to be told."""
        found = None if self._offset is None else self._offset.estimate()
        return None if found is None else asdict(found)

    def _projection(self, plane: Plane) -> Projection | None:
        """To the pixels of the published picture, in which clicks are."""
        projection, sizes = self._calibrations[plane].projection, self._images[plane].sizes
        if projection is None or not sizes:
            return projection
        return self._sources[plane].picture_projection(projection, next(iter(sizes)))

    def facts(self) -> dict[str, Any]:
        """What was seen, for a summary: per plane images, rate, size, encoding, calibrations; the pairs; the state."""
        pairs, _ = pairs_of(self._stamps)
        whole = [pair for pair in pairs if pair.is_whole]
        offsets = sorted(pair.b - pair.a for pair in whole if pair.a is not None and pair.b is not None)
        facts: dict[str, Any] = {
            "pairs": len(whole),
            "plane_b_offset_s": offsets[len(offsets) // 2] / NANOSECONDS if offsets else None,
            "state": self._state,
            "film_offset": self._measured(),
        }
        for plane in PLANES:
            images, stamps = self._images[plane], self._stamps[plane]
            facts[f"plane_{plane}"] = {
                "images": len(stamps.stamps),
                "rate_hz": stamps.rate_hz,
                "sizes": [f"{width}x{height}" for height, width in images.sizes],
                "encodings": list(images.encodings),
                "calibrations": len(self._calibrations[plane].stamps),
                "seeds": len(self._seeds[plane]),
            }
        return facts


def _stamp_ns(data: bytes) -> int:
    """The stamp of a message that begins with a header, straight from its CDR bytes; 0 where they are too few."""
    if len(data) < 12:
        return 0
    seconds, nanoseconds = struct.unpack_from("<iI" if data[1] & 1 else ">iI", data, 4)
    return int(seconds) * NANOSECONDS + int(nanoseconds)
