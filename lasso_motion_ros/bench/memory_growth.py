"""`lasso-motion bench --memory`: whether memory and the cost of a pair stay flat over thousands of pairs."""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from lasso_motion_ros.bench.codecs import available_codec
from lasso_motion_ros.config.stream import StreamConfig
from lasso_motion_ros.core.errors import RecordingError
from lasso_motion_ros.core.progress import progress
from lasso_motion_ros.geometry.frames import PLANES
from lasso_motion_ros.stream.pipeline import TrackingPipeline
from lasso_motion_ros.stream.topic_handlers import topic_handlers
from msg_adapters.messages import ns_to_stamp, stamp_to_ns
from msg_adapters.recordings.reader import RawMessage
from msg_adapters.topics import MOTION_RAW, image_topic, seed_topic

JITTER_NS = 5_000_000
SAMPLES = 20
SETTLED_SHARE = 0.1  # of the pairs, in which caches and histories fill
STATM = Path("/proc/self/statm")


@dataclass(frozen=True)
class MemoryUse:
    """Resident memory over one long run of one tracker.

    Attributes:
        pairs: pairs processed.
        poses: of these, with a pose.
        at_pair: number of the pair of each sample.
        resident_mb: the process's resident memory then, megabytes.
        pair_ms: mean processor time of a pair since the sample before, milliseconds.
        growth_mb: from the first tenth of the run to its end.
    """

    pairs: int
    poses: int
    at_pair: tuple[int, ...]
    resident_mb: tuple[float, ...]
    pair_ms: tuple[float, ...]
    growth_mb: float


def measure_memory(
    config: StreamConfig, messages: Sequence[RawMessage], pairs: int, *, quiet: bool = True
) -> MemoryUse:
    """Play a recording back and forth to one pipeline, with stamps that keep increasing.

    Args:
        config: the tracker's parameters.
        messages: undecoded inputs, in order.
        pairs: how many pairs.
        quiet: True shows no progress.

    Raises:
        RecordingError: fewer than two pairs, or the system does not tell a process's memory.
    """
    if not STATM.is_file():
        raise RecordingError(f"{STATM}: not there; memory is measured on Linux only")
    codec = available_codec()
    pipeline = TrackingPipeline(config)
    handlers = topic_handlers(pipeline.intake, {raw.topic: raw.type_name for raw in messages})
    stamps = [stamp_to_ns(codec.decode(raw.data, raw.type_name).header.stamp) for raw in messages]
    at_pair, resident, spent = [], [], []
    done = poses = 0
    begin, since = time.process_time(), 0
    bar = progress(range(pairs), pairs, "memory", quiet)
    for raw, stamp_ns in _back_and_forth(messages, stamps):
        message = codec.decode(raw.data, raw.type_name)
        message.header.stamp = codec.factory.make("builtin_interfaces/msg/Time", ns_to_stamp(stamp_ns))
        for task in handlers[raw.topic](message):
            outputs = pipeline.session.process(task)
            poses += sum(bool(output.data) for output in outputs if output.topic is MOTION_RAW)
            done += 1
            next(bar, None)
            if done * SAMPLES // pairs > (done - 1) * SAMPLES // pairs:
                now = time.process_time()
                at_pair.append(done)
                resident.append(resident_mb())
                spent.append(1e3 * (now - begin) / (done - since))
                begin, since = now, done
        if done >= pairs:
            break
    settled = [use for number, use in zip(at_pair, resident, strict=True) if number >= SETTLED_SHARE * pairs]
    growth = settled[-1] - settled[0]
    return MemoryUse(done, poses, tuple(at_pair), tuple(resident), tuple(spent), growth)


def format_memory(use: MemoryUse) -> str:
    """The figures as text."""
    lines = [f"{'pair':>8}{'resident':>14}{'a pair':>14}"]
    lines += [
        f"{number:>8}{size:>11.1f} MB{spent:>11.2f} ms"
        for number, size, spent in zip(use.at_pair, use.resident_mb, use.pair_ms, strict=True)
    ]
    lines.append(f"{use.pairs} pairs, {use.poses} with a pose; after the first tenth {use.growth_mb:+.1f} MB")
    return "\n".join(lines)


def resident_mb() -> float:
    """The process's resident memory, megabytes."""
    import resource

    return int(STATM.read_text(encoding="ascii").split()[1]) * resource.getpagesize() / 1e6


def _back_and_forth(messages: Sequence[RawMessage], stamps: Sequence[int]) -> Iterator[tuple[RawMessage, int]]:
    """The messages with new stamps, endlessly; played back and forth, so that the motion never jumps."""
    first_plane = image_topic("a").recorded_name
    images = np.array([stamp for raw, stamp in zip(messages, stamps, strict=True) if raw.topic == first_plane])
    if len(images) < 2:
        raise RecordingError(f"{first_plane}: fewer than two images")
    period = round(float(np.median(np.diff(images))))
    steps: list[list[tuple[RawMessage, int]]] = [[] for _ in images]
    seeds = []
    for raw, stamp in zip(messages, stamps, strict=True):
        if any(raw.topic == seed_topic(plane).recorded_name for plane in PLANES):
            seeds.append((raw, stamp))
            continue
        step = max(int(np.searchsorted(images, stamp + JITTER_NS, side="right")) - 1, 0)
        steps[step].append((raw, stamp - int(images[step])))
    yield from seeds
    order = [*range(len(steps)), *range(len(steps) - 2, 0, -1)]
    number = 0
    while True:
        for step in order:
            for raw, offset in steps[step]:
                yield raw, int(images[0]) + number * period + offset
            number += 1
