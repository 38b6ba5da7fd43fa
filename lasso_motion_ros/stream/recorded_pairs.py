"""The biplane pairs of a recording, one after another, by the rule by which the node pairs them."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator

from lasso_motion_ros.config.stream import StreamConfig
from lasso_motion_ros.geometry.frames import FramePair
from lasso_motion_ros.stream.clicked_pairs import PairTask
from lasso_motion_ros.stream.intake import recorded_intake
from lasso_motion_ros.stream.outputs import Problem
from lasso_motion_ros.stream.pipeline import TrackingPipeline
from msg_adapters.messages import RecordedMessages
from msg_adapters.recordings.reader import RecordingReader


def recorded_pairs(
    reader: RecordingReader, config: StreamConfig, problems: Counter[Problem] | None = None
) -> Iterator[FramePair]:
    """Read a recording's images and calibrations into pairs; only those under way are held in memory.

    Args:
        reader: the recording; its `damage` is known once the last pair was given.
        config: how pairs are made (`sync`); nothing is tracked.
        problems: what was wrong with messages is added to it, and is known once the last pair was given.
    """
    pipeline = TrackingPipeline(config, RecordedMessages())
    intake = recorded_intake(pipeline, reader.topics, seeds=False)
    ready: list[PairTask]
    for recorded in reader.messages(intake):
        ready = intake[recorded.topic](recorded.message)
        if problems is not None:
            problems.update(pipeline.take_problems())
        yield from (one.pair for one in ready)
    ready = pipeline.flush()
    if problems is not None:
        problems.update(pipeline.take_problems())
    yield from (one.pair for one in ready)
