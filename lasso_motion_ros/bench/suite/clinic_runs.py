"""Runs of the clinic suite: each sequence is rendered once and tracked with each configuration."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from lasso_motion_ros.bench.suite.cache import SequenceCache
from lasso_motion_ros.bench.suite.clinic_scenarios import ClinicScenario
from lasso_motion_ros.bench.suite.judged_scores import JudgedScores, is_plain
from lasso_motion_ros.bench.suite.sequence import SequenceResult, run_sequence
from lasso_motion_ros.config.stream import StreamConfig
from lasso_motion_ros.core.progress import progress
from lasso_motion_ros.core.worker_pool import Pool, ThisProcess, in_order
from lasso_motion_ros.stream.tracker_factory import create_tracker


@dataclass(frozen=True, eq=False)
class ClinicResult:
    """What a tracker made of one sequence.

    Attributes:
        drawn: the sequence with its event classes.
        result: its scores.
        plain: per pair, whether both planes plainly show the ring, by the simulator's truth.
    """

    drawn: ClinicScenario
    result: SequenceResult
    plain: tuple[bool, ...]

    @property
    def judged(self) -> JudgedScores:
        """What the table counts."""
        return JudgedScores(self.drawn.since, self.result.scores, self.plain, bool(self.result.refused))


def run_clinic(
    drawn: Sequence[ClinicScenario],
    configs: Mapping[str, StreamConfig],
    cache: Path | None = None,
    pool: Pool | None = None,
    quiet: bool = True,
) -> dict[str, list[ClinicResult]]:
    """Render, track and score sequences.

    Args:
        drawn: the sequences.
        configs: the trackers' parameters, by name.
        cache: directory that keeps what was rendered; None keeps nothing.
        pool: who does it; None: this process.
        quiet: no progress bar.

    Returns:
        By configuration, sequence by sequence.
    """
    results: dict[str, list[ClinicResult]] = {name: [] for name in configs}
    done = in_order((pool or ThisProcess()).run(partial(run_drawn, configs=configs, cache=cache), drawn))
    for of_sequence in progress(done, len(drawn), "clinic", quiet):
        for name, one in of_sequence.items():
            results[name].append(one)
    return results


def run_drawn(
    drawn: ClinicScenario, configs: Mapping[str, StreamConfig], cache: Path | None = None
) -> dict[str, ClinicResult]:
    """Render one sequence, or read it from the cache, and track it with every configuration."""
    sequence = SequenceCache(cache).sequence(drawn.scenario)
    plain = tuple(is_plain(true) for true in sequence.truth.pairs)
    return {
        name: ClinicResult(drawn, run_sequence(sequence, create_tracker(config)), plain)
        for name, config in configs.items()
    }
