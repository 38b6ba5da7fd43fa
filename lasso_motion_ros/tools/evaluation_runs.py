"""What `evaluate` scores: a result from a file, or one that is tracked now; and the pictures of its worst pairs."""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path

import numpy as np

from lasso_motion_ros.config.parameters import configuration_values, load_configuration
from lasso_motion_ros.config.stream import StreamConfig
from lasso_motion_ros.evaluation.evaluated import Evaluated, Timing
from lasso_motion_ros.evaluation.measures import SAME_PAIR_NS, PairEstimate, score_pairs
from lasso_motion_ros.evaluation.recorded_input import ReadTruth, read_estimates, read_latencies_ms
from lasso_motion_ros.reports.worst_frames import WorstFrame, worst_pairs, worst_picture
from lasso_motion_ros.stream.recorded_pairs import recorded_pairs
from lasso_motion_ros.tracking.wrapped_tracker import TimedTracker
from msg_adapters.recordings.reader import RecordingReader


def evaluated_file(name: str, recording: Path, read: ReadTruth, file: Path, result: str, sid_m: float) -> Evaluated:
    """Score what a file holds.

    Args:
        name: the recording's name.
        recording: its path.
        read: its truth.
        file: what a tracker published on it.
        result: what the result is called.
        sid_m: source–detector distance, metres.
    """
    estimates = read_estimates(file)
    latencies = read_latencies_ms(file)
    timing = None
    if len(latencies):
        timing = Timing("Live: from the receipt of a pair's last image to its publication, once a second.", latencies)
    scores = score_pairs(read.truth, estimates, source_detector_m=sid_m)
    return Evaluated(name, result, recording, read.truth, estimates, scores, timing)


def evaluated_tracking(
    name: str, recording: Path, read: ReadTruth, file: Path, result: str, sid_m: float, quiet: bool
) -> Evaluated:
    """Track a recording with the parameters in `file` and score that; otherwise as `evaluated_file`."""
    config = load_configuration(file, StreamConfig)
    estimates, timing = _tracked(recording, config, quiet)
    scores = score_pairs(read.truth, estimates, source_detector_m=sid_m)
    return Evaluated(name, result, recording, read.truth, estimates, scores, timing, configuration_values(config))


def worst_frames(one: Evaluated, count: int) -> list[WorstFrame]:
    """The result's worst pairs with their pictures, for which the recording is read again."""
    worst = worst_pairs(one.scores, count)
    shown: dict[int, WorstFrame] = {}
    if not worst:
        return []
    for pair in recorded_pairs(RecordingReader(one.path), StreamConfig()):
        score = next((s for s in worst if abs(s.stamp_ns - pair.stamp_ns) <= SAME_PAIR_NS), None)
        if score is not None:
            picture = worst_picture(pair, one.truth.pairs[score.index], one.estimate(score.stamp_ns))
            shown[score.index] = WorstFrame(score, picture)
            if len(shown) == len(worst):
                break
    return [shown[score.index] for score in worst if score.index in shown]


def _tracked(recording: Path, config: StreamConfig, quiet: bool) -> tuple[list[PairEstimate], Timing | None]:
    """What the offline tracker answers on a recording, by way of a file: what is scored is what gets written."""
    from lasso_motion_ros.stream.tracker_factory import create_tracker
    from lasso_motion_ros.tools.offline_tracking import track_recording, why_nothing

    tracker = TimedTracker(create_tracker(config))
    with tempfile.TemporaryDirectory(prefix="lasso_motion_") as directory:
        result = Path(directory) / "result.mcap"
        summary = track_recording(recording, result, config, quiet=quiet, tracker=tracker, without_poses=True)
        if summary.statistics.poses == 0:
            # A table of dashes would leave the reader to guess.
            print(f"lasso-motion evaluate: {recording}: no pair got a pose: {why_nothing(summary)}", file=sys.stderr)
        timing = None
        if tracker.milliseconds:
            timing = Timing("Offline: wall time of each pair in the tracker alone.", np.array(tracker.milliseconds))
        return read_estimates(result), timing
