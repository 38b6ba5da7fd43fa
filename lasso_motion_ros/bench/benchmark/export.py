"""Writes a benchmark: recordings without truth, the truth apart, licence, card and manifest."""

from __future__ import annotations

import dataclasses
import json
from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from lasso_motion_ros.bench.benchmark.card import LICENCE_TEXT, card
from lasso_motion_ros.bench.benchmark.manifest import (
    CARD_FILE,
    LICENCE_FILE,
    MANIFEST_FILE,
    OWNED,
    RECORDINGS,
    TRUTH,
    VERSION,
    BenchmarkSequence,
    Manifest,
    file_digest,
    start_ns,
)
from lasso_motion_ros.bench.benchmark.truth_files import truth_paths, write_truth
from lasso_motion_ros.bench.suite.cache import SequenceCache
from lasso_motion_ros.bench.suite.clinic_scenarios import ClinicScenario, clinic_scenario
from lasso_motion_ros.bench.suite.sequence import RenderedSequence
from lasso_motion_ros.core.errors import LassoMotionError, RecordingError
from lasso_motion_ros.core.output_files import whole_directory, write_json, write_text
from lasso_motion_ros.core.progress import progress
from lasso_motion_ros.core.worker_pool import in_order, processors
from lasso_motion_ros.geometry.frames import PLANES, FramePair
from lasso_motion_ros.phantom import Simulator
from lasso_motion_ros.tools.evaluation_runs import versions
from lasso_motion_ros.tools.sequence_messages import image_messages, r_peak_messages, seed_messages, write_messages
from msg_adapters.recordings.writer import RecordingWriter

DEFAULT_SEED = 61803
DEFAULT_SEQUENCES = 112
"""Four for each event class."""


@dataclass(frozen=True)
class _Exported:
    """One sequence to be exported: its number, and what is rendered."""

    index: int
    drawn: ClinicScenario


def export_benchmark(
    directory: Path,
    *,
    seed: int = DEFAULT_SEED,
    sequences: int = DEFAULT_SEQUENCES,
    cache: Path | None = None,
    workers: int | None = None,
    quiet: bool = True,
) -> Manifest:
    """Render a benchmark into a directory, whole or not at all; what is there of an earlier one is replaced.

    The same seed gives the same sequences, however many are exported, and the same bytes with the same versions of what
    renders them.

    Args:
        directory: where; made if need be.
        seed: from which the sequences are drawn.
        sequences: how many.
        cache: directory that keeps what is rendered: an interrupted run goes on where it stopped.
        workers: processes at a time; None: one a processor.
        quiet: no progress bar.

    Returns:
        What was written.

    Raises:
        LassoMotionError: a number that is not allowed, or a directory that cannot be written.
    """
    if sequences < 1 or seed < 0:
        raise LassoMotionError(
            f"expected one sequence or more and a seed that is not negative, found {sequences} and {seed}"
        )
    _check_replaceable(directory)
    tasks = [_Exported(index, clinic_scenario(seed, index)) for index in range(sequences)]
    with whole_directory(directory, OWNED) as staged:
        for folder in (RECORDINGS, TRUTH):
            (staged / folder).mkdir()
        done = in_order(processors(workers).run(partial(_export, directory=staged, seed=seed, cache=cache), tasks))
        written = tuple(progress(done, len(tasks), "rendering", quiet))
        manifest = Manifest(VERSION, seed, written, {}, versions())
        write_text(staged / LICENCE_FILE, LICENCE_TEXT)
        write_text(staged / CARD_FILE, card(manifest))
        manifest = dataclasses.replace(
            manifest, files={name: file_digest(staged / name) for name in (CARD_FILE, LICENCE_FILE)}
        )
        write_json(staged / MANIFEST_FILE, manifest.record())
    return manifest


def _check_replaceable(directory: Path) -> None:
    """Check that the folders which would be replaced hold what an earlier export has put there, and nothing else."""
    there = [file for folder in (RECORDINGS, TRUTH) for file in (directory / folder).glob("*")]
    if not there:
        return
    try:
        earlier = json.loads((directory / MANIFEST_FILE).read_text(encoding="utf-8"))
        ours = {name for one in earlier["sequences"] for name in one["files"]}
    except (OSError, ValueError, KeyError, TypeError):
        ours = set()
    for file in there:
        if file.relative_to(directory).as_posix() not in ours:
            raise RecordingError(f"{file} is not of an earlier benchmark: choose another directory, or move it away")


def _export(task: _Exported, directory: Path, seed: int, cache: Path | None) -> BenchmarkSequence:
    """Render one sequence and write its files; in a process of its own."""
    name = f"{task.index:03d}"
    scenario = task.drawn.scenario
    rendered = SequenceCache(cache).sequence(scenario)
    later_ns = start_ns(VERSION, seed, task.index) - rendered.pairs[0].stamp_ns
    sequence = _moved(rendered, later_ns)
    recording = f"{RECORDINGS}/{name}.mcap"
    peaks = [peak + later_ns for peak in Simulator(scenario).r_peaks_ns()]
    _write_recording(directory / recording, sequence, peaks)
    write_truth(directory, name, sequence)
    return BenchmarkSequence(
        name,
        scenario.description,
        task.drawn.since,
        scenario.rate_hz,
        tuple(pair.stamp_ns for pair in sequence.pairs),
        _digests(directory, (recording, *truth_paths(name))),
    )


def _moved(sequence: RenderedSequence, later_ns: int) -> RenderedSequence:
    """The sequence at another time."""

    def moved(pair: FramePair) -> FramePair:
        frames = {
            plane: dataclasses.replace(frame, stamp_ns=frame.stamp_ns + later_ns)
            for plane, frame in pair.frames.items()
        }
        return FramePair(pair.stamp_ns + later_ns, frames.get("a"), frames.get("b"))

    pairs = tuple(dataclasses.replace(true, stamp_ns=true.stamp_ns + later_ns) for true in sequence.truth.pairs)
    return dataclasses.replace(
        sequence,
        pairs=tuple(moved(pair) for pair in sequence.pairs),
        truth=dataclasses.replace(sequence.truth, pairs=pairs),
    )


def _write_recording(path: Path, sequence: RenderedSequence, peaks_ns: list[int]) -> None:
    """What a tracker gets: images, calibrations, clicks, R peaks."""
    clicks = {plane: sequence.seed.points(plane) for plane in PLANES}
    with RecordingWriter(path) as writer:
        for pair in sequence.pairs:
            messages = image_messages(pair)
            if pair is sequence.pairs[0]:
                messages += seed_messages(clicks, {plane: frame.stamp_ns for plane, frame in pair.frames.items()})
            before = [peak for peak in peaks_ns if peak <= pair.stamp_ns]
            peaks_ns = peaks_ns[len(before) :]
            write_messages(writer, messages + r_peak_messages(before))


def _digests(directory: Path, names: tuple[str, ...]) -> Mapping[str, str]:
    return {name: file_digest(directory / name) for name in names}
