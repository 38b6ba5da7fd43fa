"""Tracks a recording into a file: the node's own pipeline, without DDS and without a clock."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from lasso_motion_ros.config.parameters import load_configuration
from lasso_motion_ros.config.stream import StreamConfig
from lasso_motion_ros.core.errors import ConfigurationError, RecordingError
from lasso_motion_ros.core.progress import progress
from lasso_motion_ros.core.share import share_file
from lasso_motion_ros.geometry.frames import PLANES, FramePair
from lasso_motion_ros.stream.automatic_start import RingLookout, only_ring
from lasso_motion_ros.stream.outputs import Output, PipelineStatistics
from lasso_motion_ros.stream.pair_task import PairTask
from lasso_motion_ros.stream.pipeline import TrackingPipeline
from lasso_motion_ros.stream.problem_log import Problem, problem_lines
from lasso_motion_ros.stream.topic_handlers import topic_handlers
from lasso_motion_ros.tracking.tracker import Tracker, TrackerState
from msg_adapters.recorded_messages import RecordedMessages
from msg_adapters.recordings.reader import RecordingReader
from msg_adapters.recordings.tracking_topics import check_tracking_topics, unused_compressed_topics
from msg_adapters.recordings.writer import RecordingWriter
from msg_adapters.seeds import read_calibration_file, read_seeds_file
from msg_adapters.topics import camera_info_topic, seed_topic

Given = Mapping[str, Mapping[str, Any]]
"""Per plane, the fields of a message."""
DEFAULT_CONFIG = "config/tracker.yaml"


@dataclass(frozen=True, eq=False)
class TrackSummary:
    """The outcome.

    Attributes:
        statistics: the pipeline's counts.
        problems: what was wrong with messages, and how often.
        damage: what is wrong with the recording as a file, or None.
        remarks: what is to be known of the images, though nothing is wrong with them.
    """

    statistics: PipelineStatistics
    problems: Mapping[Problem, int]
    damage: str | None
    remarks: tuple[Problem, ...] = ()

    @property
    def problem_lines(self) -> list[str]:
        """The problems, one line each; a problem of both planes is one."""
        return problem_lines(self.problems)

    @property
    def remark_lines(self) -> list[str]:
        """The remarks, one line each; a remark on both planes is one."""
        return problem_lines(dict.fromkeys(self.remarks, 1))


def counts(summary: TrackSummary) -> dict[str, Any]:
    """The summary as JSON values."""
    statistics = summary.statistics
    return {
        "pairs": statistics.pairs,
        "half_pairs": statistics.half_pairs,
        "poses": statistics.poses,
        "states": {state.value: count for state, count in statistics.states.items()},
        "frames": {plane: asdict(frames) for plane, frames in statistics.frames.items()},
        "pairing": {plane: asdict(pairing) for plane, pairing in statistics.pairing.items()},
        "heartbeat": None if statistics.heartbeat is None else statistics.heartbeat.text,
        "catheter": None if statistics.catheter is None else statistics.catheter.text,
        "remarks": [{"topic": remark.topic, "text": remark.text} for remark in summary.remarks],
        "problems": [
            {"topic": problem.topic, "text": problem.text, "count": count}
            for problem, count in summary.problems.items()
        ],
        "damage": summary.damage,
    }


def why_nothing(summary: TrackSummary) -> str:
    """Why a recording gave nothing, in one line: the first problems, since the others often follow from them."""
    found = summary.problem_lines
    more = [f"and {len(found) - 3} more"] if len(found) > 3 else []
    damage = [] if summary.damage is None else [summary.damage]
    return "; ".join([*found[:3], *more, *damage]) or summary.statistics.reason


def describe(statistics: PipelineStatistics) -> str:
    """One line: pairs, poses, states, what became of the heartbeat, what the images show of the catheter."""
    states = ", ".join(f"{count} {state.value}" for state, count in statistics.states.items())
    half = f" ({statistics.half_pairs} with one plane missing)" if statistics.half_pairs else ""
    of_planes = [
        f"{frames.held} of {frames.images} of plane {plane.upper()}"
        for plane, frames in statistics.frames.items()
        if frames.held
    ]
    held = f"; held pictures left out: {', '.join(of_planes)}" if of_planes else ""
    heartbeat = "" if statistics.heartbeat is None else f"; heartbeat: {statistics.heartbeat.text}"
    catheter = "" if statistics.catheter is None else f"; catheter: {statistics.catheter.text}"
    return f"{statistics.pairs} pairs{half}, {statistics.poses} poses; {states}{held}{heartbeat}{catheter}"


def track_recording(
    recording: Path,
    output: Path,
    config: Path | StreamConfig | None = None,
    *,
    seeds: Path | None = None,
    calibration: Path | None = None,
    remap: Mapping[str, str] | None = None,
    overwrite: bool = False,
    quiet: bool = True,
    tracker: Tracker | None = None,
    without_poses: bool = False,
    automatic: bool = False,
) -> TrackSummary:
    """Track a recording into a file.

    Args:
        recording: MCAP file or bag directory.
        output: file to write; log time = plane A's stamp.
        config: parameter file, or the parameters; None: the default file.
        seeds: clicks from a file, in place of the recorded ones.
        calibration: projections from a file, in place of the recorded ones.
        remap: recorded topic → the name it is read as.
        overwrite: replace `output` if it exists.
        quiet: no progress bar.
        tracker: the method; by default the one that the configuration names.
        automatic: find the ring without clicks, and hear none.
        without_poses: whether a file in which no pair has a pose is written too; it is an error otherwise.

    Raises:
        LassoMotionError: nothing readable, missing topics, a bad file, no pair at all, or none with a pose. No output
            is left then, and one that was to be replaced is as it was.
    """
    if not isinstance(config, StreamConfig):
        config = load_configuration(config or share_file(DEFAULT_CONFIG), StreamConfig)
    if automatic and seeds is not None:
        raise ConfigurationError("clicks from a file and a ring that is found without them exclude each other")
    given_seeds = None if seeds is None else read_seeds_file(seeds)
    given_calibration = None if calibration is None else read_calibration_file(calibration)
    reader = RecordingReader(recording, remap)
    check_tracking_topics(reader.path, reader.topics, calibrated=calibration is not None)
    if given_seeds is None and not automatic:
        _check_seeds(reader)
    messages = RecordedMessages()
    pipeline = TrackingPipeline(config, tracker)
    for raw, compressed in unused_compressed_topics(reader.topics):
        pipeline.problems.remark(compressed, f"not used: {raw} is there, which has lost nothing")
    with RecordingWriter(output, overwrite=overwrite, whole=True) as writer:
        run = _Run(pipeline, writer, RingLookout(config) if automatic else None)
        run.write(pipeline.session.initial_outputs())
        run.take_given(messages, given_calibration, given_seeds)
        handlers = topic_handlers(
            pipeline.intake, reader.topics, seeds=seeds is None and not automatic, calibrations=calibration is None
        )
        for recorded in progress(reader.messages(handlers), None, "tracking (messages)", quiet):
            run.take(handlers[recorded.topic](recorded.message))
        run.take(pipeline.intake.flush())
        remarks = tuple(pipeline.problems.take_remarks())
        summary = TrackSummary(pipeline.statistics(), run.problems, reader.damage, remarks)
        lacking = "image pair could be made" if summary.statistics.pairs == 0 else "pair got a pose"
        if summary.statistics.pairs == 0 or (summary.statistics.poses == 0 and not without_poses):
            raise RecordingError(f"{recording}: no {lacking}: {why_nothing(summary)}")
    return summary


class _Run:
    """Answers tasks as they fall due, and writes what comes out."""

    def __init__(
        self,
        pipeline: TrackingPipeline,
        writer: RecordingWriter,
        lookout: RingLookout | None,
    ) -> None:
        self._pipeline = pipeline
        self._writer = writer
        self._lookout = lookout
        self._unstamped: list[Output] = []
        self._time_ns = 0
        self.problems: Counter[Problem] = Counter()

    def take_given(self, messages: RecordedMessages, calibration: Given | None, seeds: Given | None) -> None:
        """Take what files give in place of the recording."""
        intake = self._pipeline.intake
        for plane in PLANES:
            if calibration is not None:
                info = messages.make(camera_info_topic(plane).type_name, calibration[plane])
                self.take(intake.add_camera_info(plane, info))
            if seeds is not None:
                clicks = messages.make(seed_topic(plane).type_name, seeds[plane])
                self.take(intake.add_seed(plane, clicks))

    def take(self, tasks: list[PairTask]) -> None:
        self.write(self._pipeline.pending_outputs())
        for task in tasks:
            self._time_ns = task.pair.stamp_ns
            self.write(self._pipeline.session.process(task))
            if task.seed is None:  # else its pair is one of the past
                self._look(task.pair)
        self.problems.update(self._pipeline.problems.take())

    def _look(self, pair: FramePair) -> None:
        """Look for a ring while there is no model, and start with the only one."""
        if self._lookout is None:
            return
        if self._pipeline.session.state is not TrackerState.WAITING_FOR_SEED:
            self._lookout.forget()
            return
        pairs = self._lookout.add(pair)
        found = self._lookout.look(pairs) if pairs else []
        if not found:
            return
        ring = only_ring(found)
        if ring is None:
            self._pipeline.problems.report("", "more than one ring may be the lasso: not started with any, click it")
            return
        self.take([self._pipeline.intake.seed_pair(ring.pair, ring.seed)])

    def write(self, outputs: list[Output]) -> None:
        for output in outputs:
            if output.stamp_ns == 0 and self._time_ns == 0:
                self._unstamped.append(output)  # before the first pair there is no time to write it at
                continue
            waiting, self._unstamped = self._unstamped, []
            for one in [*waiting, output]:
                self._write_one(one)

    def _write_one(self, output: Output) -> None:
        topic = output.topic
        self._writer.write_raw(
            topic.recorded_name,
            topic.type_name,
            output.data,
            output.stamp_ns or self._time_ns,
            latched=topic.latched,
        )


def check_trackable(recording: Path, *, automatic: bool = False) -> None:
    """Whether a recording has all that tracking needs: images, calibrations, and clicks unless it is automatic.

    Raises:
        RecordingError: it has not, or cannot be read.
    """
    reader = RecordingReader(recording)
    check_tracking_topics(reader.path, reader.topics)
    if not automatic:
        _check_seeds(reader)


def _check_seeds(reader: RecordingReader) -> None:
    missing = [
        topic.recorded_name
        for topic in map(seed_topic, PLANES)
        if reader.topics.get(topic.recorded_name) != topic.type_name
    ]
    if missing:
        raise RecordingError(
            f"{reader.path} has no clicks ({', '.join(missing)}): give them with lasso-motion track --seeds FILE; the"
            " page makes such a file (lasso-motion web, or web --annotate: click in both planes, then F); or have the"
            " ring found with --automatic"
        )
