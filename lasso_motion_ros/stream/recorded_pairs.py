"""The biplane pairs of a recording, one after another, paired as the node pairs them."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator

from lasso_motion_ros.config.stream import StreamConfig
from lasso_motion_ros.geometry.frames import FramePair
from lasso_motion_ros.stream.intake import MessageIntake
from lasso_motion_ros.stream.problem_log import Problem, ProblemLog
from lasso_motion_ros.stream.topic_handlers import topic_handlers
from msg_adapters.recordings.reader import RecordingReader


def recorded_pairs(
    reader: RecordingReader, config: StreamConfig, problems: Counter[Problem] | None = None
) -> Iterator[FramePair]:
    """Read a recording's images and calibrations into pairs; only those under way are held in memory.

    Args:
        reader: the recording; its `damage` is known once the last pair was given.
        config: how pairs are made (`sync`).
        problems: what was wrong with messages is added to it, and is known once the last pair was given.
    """
    log = ProblemLog()
    intake = MessageIntake(config, log)
    handlers = topic_handlers(intake, reader.topics, seeds=False)
    for recorded in reader.messages(handlers):
        tasks = handlers[recorded.topic](recorded.message)
        if problems is not None:
            problems.update(log.take())
        yield from (task.pair for task in tasks)
    tasks = intake.flush()
    if problems is not None:
        problems.update(log.take())
    yield from (task.pair for task in tasks)
