"""The score of entries on a benchmark, counted as the clinic suite counts."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from lasso_motion_ros.bench.benchmark.entries import Entry, entry_files, read_entry
from lasso_motion_ros.bench.benchmark.manifest import Manifest, read_manifest
from lasso_motion_ros.bench.benchmark.truth_files import SequenceTruth, read_sequence_truth
from lasso_motion_ros.bench.suite.clinic_tables import ClassMeasures, class_measures
from lasso_motion_ros.bench.suite.judged_scores import JudgedScores
from lasso_motion_ros.core.progress import progress
from lasso_motion_ros.evaluation.measures import PairEstimate, PairScore, score_pairs


@dataclass(frozen=True, eq=False)
class EntryScore:
    """What an entry is worth.

    Attributes:
        entry: what was answered.
        sequences: the scores by sequence, in the benchmark's order; of one without answers every pair lacks a pose.
        classes: the measures by event class.
        unanswered: the sequences without a single answer.
    """

    entry: Entry
    sequences: dict[str, JudgedScores]
    classes: dict[str, ClassMeasures]
    unanswered: tuple[str, ...]


@dataclass(frozen=True, eq=False)
class BenchmarkScore:
    """Entries on one benchmark.

    Attributes:
        manifest: the benchmark's.
        entries: in the order given.
    """

    manifest: Manifest
    entries: tuple[EntryScore, ...]

    @property
    def complete(self) -> bool:
        """Whether every entry answered on every sequence, and all its files could be read to the end."""
        return not any(one.unanswered or one.entry.damage for one in self.entries)


def score_benchmark(directory: Path, results: Sequence[Path], *, quiet: bool = True) -> BenchmarkScore:
    """Score what trackers answered.

    Args:
        directory: an exported benchmark, with its truth.
        results: files and folders, see `entry_files`.
        quiet: no progress bar.

    Raises:
        LassoMotionError: a benchmark or a result that is not one, see `read_manifest`, `read_sequence_truth` and
            `read_entry`.
    """
    manifest = read_manifest(directory)
    files = entry_files(results, manifest)
    truths = {
        one.name: read_sequence_truth(directory, manifest, one)
        for one in progress(manifest.sequences, len(manifest.sequences), "truth", quiet)
    }
    entries = [read_entry(name, of_entry, manifest) for name, of_entry in files.items()]
    return BenchmarkScore(manifest, tuple(_scored(entry, manifest, truths) for entry in entries))


def _scored(entry: Entry, manifest: Manifest, truths: dict[str, SequenceTruth]) -> EntryScore:
    sequences = {}
    for one in manifest.sequences:
        truth, estimates = truths[one.name], entry.estimates.get(one.name, ())
        scores = _pair_scores(truth, estimates)
        refused = not any(score.has_pose for score in scores)
        sequences[one.name] = JudgedScores(one.since, scores, truth.plain, refused)
    return EntryScore(
        entry,
        sequences,
        class_measures(list(sequences.values())),
        tuple(one.name for one in manifest.sequences if one.name not in entry.estimates),
    )


def _pair_scores(truth: SequenceTruth, estimates: Sequence[PairEstimate]) -> tuple[PairScore, ...]:
    """Scores in which a pose is due from the second pair on, whenever the tracker began."""
    due = [score.expected for score in score_pairs(truth.truth, ())]
    scores = score_pairs(truth.truth, estimates)
    return tuple(
        dataclasses.replace(score, expected=expected and not score.is_reference)
        for score, expected in zip(scores, due, strict=True)
    )
