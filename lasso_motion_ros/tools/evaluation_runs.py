"""What `evaluate` scores: a result from a file, or one that is tracked now; and the pictures of its worst pairs."""

from __future__ import annotations

import platform
import tempfile
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from importlib.metadata import version as installed_version
from pathlib import Path

import cv2
import numpy as np

from lasso_motion_ros.config.parameters import configuration_values, load_configuration
from lasso_motion_ros.config.stream import StreamConfig
from lasso_motion_ros.core.errors import LassoMotionError
from lasso_motion_ros.core.output_files import whole_directory
from lasso_motion_ros.core.progress import progress
from lasso_motion_ros.core.share import version
from lasso_motion_ros.evaluation.evaluated import Evaluated, Timing
from lasso_motion_ros.evaluation.measures import PairEstimate, score_pairs
from lasso_motion_ros.evaluation.recorded_input import ReadTruth, read_estimates, read_latencies_ms, read_truth
from lasso_motion_ros.evaluation.same_pair import of_pair
from lasso_motion_ros.reports.worst_frames import WorstFrame, worst_pairs, worst_picture
from lasso_motion_ros.stream.recorded_pairs import recorded_pairs
from lasso_motion_ros.tools.offline_tracking import check_trackable, track_recording, why_nothing
from lasso_motion_ros.tracking.wrapped_tracker import TimedTracker
from msg_adapters.recordings.reader import RecordingReader


def evaluate_recordings(
    recordings: Sequence[Path],
    results: Sequence[Path],
    configurations: Sequence[Path],
    sid_m: float,
    say: Callable[[str], None],
    *,
    quiet: bool = True,
    automatic: bool = False,
) -> tuple[list[Evaluated], bool]:
    """Score what a tracker made of recordings with truth.

    All that can be seen to be wrong is looked at before anything is tracked. Of several recordings one that cannot be
    scored is said and left out.

    Args:
        recordings: MCAP files or bag directories.
        results: what a tracker published: several on one recording, or one on each; empty: each recording is tracked.
        configurations: parameter files to track with.
        sid_m: source–detector distance for millimetres on the detector, metres.
        say: takes a line for the user: what is wrong with a recording, or why it is left out.
        quiet: no progress bar.
        automatic: track without clicks.

    Returns:
        The results in order, and whether all recordings could be read and scored as a whole.

    Raises:
        LassoMotionError: a parameter file that cannot be read, or no recording that can be scored.
    """
    many = len(recordings) > 1
    configs = {file: load_configuration(file, StreamConfig) for file in configurations if not results}
    failures: list[LassoMotionError] = []
    truths: dict[int, ReadTruth] = {}
    for number, recording in enumerate(recordings):
        with _noted(failures):
            truths[number] = read_truth(recording)
            if not results:
                check_trackable(recording, automatic=automatic)
    found: list[Evaluated] = []
    for number, read in progress(truths.items(), len(truths), "evaluating", quiet or not many):
        recording = recordings[number]
        if read.damage is not None:
            say(read.damage)
        name = _unused_name(recording, {one.recording for one in found})
        files = list(configs) if not results else [results[number]] if many else results
        for file, result in zip(files, _distinct(files), strict=True):
            with _noted(failures):
                if results:
                    found.append(_evaluated_file(name, recording, read, file, result, sid_m))
                else:
                    given = configs[file]
                    found.append(
                        _evaluated_tracking(name, recording, read, given, result, sid_m, say, quiet or many, automatic)
                    )
    if not found:
        *before, failure = failures
        for error in before:
            say(str(error))
        raise failure
    for error in failures:
        say(f"left out: {error}")
    return found, not failures and all(read.damage is None for read in truths.values())


@contextmanager
def _noted(failures: list[LassoMotionError]) -> Iterator[None]:
    """Note what goes wrong with one recording, and go on."""
    try:
        yield
    except LassoMotionError as error:
        failures.append(error)


def write_evaluation_report(directory: Path, results: Sequence[Evaluated], worst: int, *, quiet: bool = True) -> Path:
    """Write the page with tables, plots and pictures, all or nothing.

    Args:
        directory: where; made if need be.
        results: what is shown.
        worst: how many of each result's worst pairs are shown.
        quiet: no progress bar.

    Returns:
        The page.

    Raises:
        LassoMotionError: a recording that cannot be read again, or a file that cannot be written.
    """
    from lasso_motion_ros.reports.evaluation_report import REPORT_FILES, write_report

    frames = [worst_frames(one, worst) for one in progress(results, len(results), "worst frames", quiet)]
    with whole_directory(directory, REPORT_FILES) as staged:
        page = write_report(
            staged, results, frames, versions(), lambda numbers: progress(numbers, len(numbers), "plots", quiet)
        )
    return directory / page.name


def versions() -> dict[str, str]:
    """Versions of what the figures were made with, by name."""
    return {
        "lasso_motion_ros": version(),
        "Python": platform.python_version(),
        "numpy": np.__version__,
        "SciPy": installed_version("scipy"),
        "OpenCV": cv2.__version__,
        "machine": f"{platform.system()} {platform.machine()}",
    }


def worst_frames(one: Evaluated, count: int) -> list[WorstFrame]:
    """The result's worst pairs with their pictures, for which the recording is read again."""
    worst = worst_pairs(one.scores, count)
    shown: dict[int, WorstFrame] = {}
    if not worst:
        return []
    for pair in recorded_pairs(RecordingReader(one.path), StreamConfig()):
        score = of_pair(worst, pair.stamp_ns)
        if score is not None:
            picture = worst_picture(pair, one.truth.pairs[score.index], one.estimate(score.stamp_ns))
            shown[score.index] = WorstFrame(score, picture)
            if len(shown) == len(worst):
                break
    return [shown[score.index] for score in worst if score.index in shown]


def _evaluated_file(name: str, recording: Path, read: ReadTruth, file: Path, result: str, sid_m: float) -> Evaluated:
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


def _evaluated_tracking(
    name: str,
    recording: Path,
    read: ReadTruth,
    config: StreamConfig,
    result: str,
    sid_m: float,
    say: Callable[[str], None],
    quiet: bool,
    automatic: bool,
) -> Evaluated:
    """Track a recording with some parameters and score that; otherwise as `_evaluated_file`."""
    estimates, timing = _tracked(recording, config, say, quiet, automatic)
    scores = score_pairs(read.truth, estimates, source_detector_m=sid_m)
    return Evaluated(name, result, recording, read.truth, estimates, scores, timing, configuration_values(config))


def _tracked(
    recording: Path, config: StreamConfig, say: Callable[[str], None], quiet: bool, automatic: bool
) -> tuple[list[PairEstimate], Timing | None]:
    """What the offline tracker answers on a recording, by way of a file: what is scored is what gets written."""
    from lasso_motion_ros.stream.tracker_factory import create_tracker

    tracker = TimedTracker(create_tracker(config))
    with tempfile.TemporaryDirectory(prefix="lasso_motion_") as directory:
        result = Path(directory) / "result.mcap"
        summary = track_recording(
            recording, result, config, quiet=quiet, tracker=tracker, without_poses=True, automatic=automatic
        )
        if summary.statistics.poses == 0:
            # A table of dashes would leave the reader to guess.
            say(f"{recording}: no pair got a pose: {why_nothing(summary)}")
        timing = None
        if tracker.milliseconds:
            timing = Timing("Offline: wall time of each pair in the tracker alone.", np.array(tracker.milliseconds))
        return read_estimates(result), timing


def _distinct(files: Sequence[Path]) -> list[str]:
    """A name for each file beside the others: its stem where that tells them apart, else its whole path."""
    stems = [file.stem for file in files]
    return stems if len(set(stems)) == len(stems) else [str(file) for file in files]


def _unused_name(recording: Path, taken: set[str]) -> str:
    """A recording's name: the file's, or the whole path where two files share it."""
    return str(recording) if recording.stem in taken else recording.stem
