"""A sequence's truth as files: a recording with the truth's topics, and beside it what is asked of each pair.

The recording is one that `lasso-motion evaluate` takes; what is asked (whether a pose is due, whether the ring is
displaced, whether both planes plainly show it) no topic tells.
"""

from __future__ import annotations

import dataclasses
import json
from dataclasses import dataclass
from pathlib import Path

from lasso_motion_ros.bench.benchmark.manifest import TRUTH, BenchmarkSequence, Manifest, file_digest
from lasso_motion_ros.bench.suite.judged_scores import is_plain
from lasso_motion_ros.bench.suite.sequence import RenderedSequence
from lasso_motion_ros.core.errors import RecordingError
from lasso_motion_ros.core.output_files import write_json
from lasso_motion_ros.evaluation.measures import Truth
from lasso_motion_ros.evaluation.recorded_input import read_truth
from lasso_motion_ros.tools.sequence_messages import (
    calibration_message,
    reference_truth_messages,
    truth_messages,
    write_messages,
)
from msg_adapters.recordings.writer import RecordingWriter


@dataclass(frozen=True, eq=False)
class SequenceTruth:
    """What a sequence is scored against.

    Attributes:
        truth: with what is asked of each pair.
        plain: per pair, whether both planes plainly show the ring.
    """

    truth: Truth
    plain: tuple[bool, ...]


def truth_paths(name: str) -> tuple[str, str]:
    """A sequence's truth below the benchmark's directory: the recording, and what is asked of each pair."""
    return f"{TRUTH}/{name}.mcap", f"{TRUTH}/{name}.json"


def write_truth(directory: Path, name: str, sequence: RenderedSequence) -> None:
    """Write a sequence's truth.

    Args:
        directory: the benchmark's.
        name: of the sequence.
        sequence: as rendered, with the stamps of its recording.

    Raises:
        RecordingError: a file cannot be written.
    """
    recording, asked = truth_paths(name)
    truth = sequence.truth
    if truth.loop is None or truth.targets is None:
        raise RecordingError(f"{name}: rendered without a loop or targets")
    with RecordingWriter(directory / recording) as writer:
        for pair, true in zip(sequence.pairs, truth.pairs, strict=True):
            if true.motion is None or true.respiratory is None:
                raise RecordingError(f"{name}: a pair was rendered without its motion")
            messages = [
                calibration_message(plane, frame.stamp_ns, frame.projection) for plane, frame in pair.frames.items()
            ]
            messages += truth_messages(true.stamp_ns, true.motion, true.respiratory, true.centrelines)
            if true is truth.pairs[0]:
                messages += reference_truth_messages(true.stamp_ns, truth.loop, truth.targets)
            write_messages(writer, messages)
    pairs = [
        {
            "stamp_ns": true.stamp_ns,
            "due": true.due is not False,
            "displaced": bool(true.displaced),
            "plain": is_plain(true),
        }
        for true in truth.pairs
    ]
    write_json(directory / asked, {"sequence": name, "pairs": pairs})


def read_sequence_truth(directory: Path, manifest: Manifest, sequence: BenchmarkSequence) -> SequenceTruth:
    """Read a sequence's truth.

    Args:
        directory: the benchmark's.
        manifest: its manifest.
        sequence: which.

    Raises:
        RecordingError: it is not there, or is not what was exported.
    """
    if not (directory / TRUTH).is_dir():
        raise RecordingError(f"{directory / TRUTH}: no such directory: the truth of {manifest.identity} belongs there")
    for name in truth_paths(sequence.name):
        path = directory / name
        if not path.is_file():
            raise RecordingError(f"{path}: missing: it is part of {manifest.identity}")
        if file_digest(path) != sequence.files.get(name):
            raise RecordingError(f"{path}: not the file that was exported: its SHA-256 differs from the manifest's")
    recording, asked = truth_paths(sequence.name)
    truth = read_truth(directory / recording).truth
    try:
        pairs = json.loads((directory / asked).read_text(encoding="utf-8"))["pairs"]
        judged = tuple(
            dataclasses.replace(true, due=bool(one["due"]), displaced=bool(one["displaced"]))
            for true, one in zip(truth.pairs, pairs, strict=True)
        )
        return SequenceTruth(dataclasses.replace(truth, pairs=judged), tuple(bool(one["plain"]) for one in pairs))
    except (KeyError, TypeError, ValueError) as error:
        raise RecordingError(f"{directory / asked}: damaged: {type(error).__name__}: {error}") from error
