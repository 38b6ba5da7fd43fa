"""Runs of the suite: every sequence is rendered once and tracked with each configuration.

Results are by the configuration's name, as the caller names it.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from functools import partial
from pathlib import Path

from lasso_motion_ros.bench.suite.ablation import Outcome, Variant, track_variants
from lasso_motion_ros.bench.suite.cache import SequenceCache
from lasso_motion_ros.bench.suite.ideas import Idea
from lasso_motion_ros.bench.suite.sequence import SequenceResult, run_sequence
from lasso_motion_ros.bench.suite.suite_measures import Measures, measures
from lasso_motion_ros.bench.suite.sweeps import Sweep, sweep_scenarios
from lasso_motion_ros.bench.suite.trap_measures import TrapMeasures, trap_measures
from lasso_motion_ros.bench.suite.traps import TRAPS, Trap, trap_scenarios
from lasso_motion_ros.config.stream import StreamConfig
from lasso_motion_ros.core.progress import progress
from lasso_motion_ros.core.worker_pool import Pool, ThisProcess, in_order
from lasso_motion_ros.evaluation.measures import PairScore
from lasso_motion_ros.phantom import Scenario
from lasso_motion_ros.stream.tracker_factory import create_tracker

Configurations = Mapping[str, StreamConfig]


def run_suite(
    scenarios: Sequence[Scenario],
    configs: Configurations,
    cache: Path | None = None,
    pool: Pool | None = None,
    quiet: bool = True,
) -> dict[str, list[SequenceResult]]:
    """Track random sequences.

    Args:
        scenarios: what is rendered.
        configs: the trackers' parameters, by name.
        cache: directory that keeps what was rendered; None keeps nothing.
        pool: who does it; None: this process.
        quiet: no progress bar.

    Returns:
        By configuration, sequence by sequence.
    """
    results: dict[str, list[SequenceResult]] = {name: [] for name in configs}
    for of_sequence in _tracked(scenarios, configs, cache, pool, "suite", quiet):
        for name, one in of_sequence.items():
            results[name].append(one)
    return results


def run_scenario(scenario: Scenario, configs: Configurations, cache: Path | None = None) -> dict[str, SequenceResult]:
    """Render one sequence, or read it from the cache, and track it with every configuration."""
    sequence = SequenceCache(cache).sequence(scenario)
    return {name: run_sequence(sequence, create_tracker(config)) for name, config in configs.items()}


def run_sweep(
    sweep: Sweep,
    seed: int,
    sequences: int,
    configs: Configurations,
    cache: Path | None = None,
    pool: Pool | None = None,
    quiet: bool = True,
) -> dict[str, dict[float, Measures]]:
    """Vary one property.

    Args:
        sweep: what is varied.
        seed: of the suite that the sequences are taken from.
        sequences: how many for each value.
        configs: the trackers' parameters, by name.
        cache: directory that keeps what was rendered; None keeps nothing.
        pool: who does it; None: this process.
        quiet: no progress bar.

    Returns:
        By configuration and value.
    """
    todo = [(value, one) for value, many in sweep_scenarios(sweep, seed, sequences).items() for one in many]
    done = _tracked([scenario for _, scenario in todo], configs, cache, pool, sweep.name, quiet)
    scores: dict[str, dict[float, list[PairScore]]] = {name: {} for name in configs}
    for (value, _), of_sequence in zip(todo, done, strict=True):
        for name, result in of_sequence.items():
            scores[name].setdefault(value, []).extend(result.scores)
    return {
        name: {value: measures(of_value) for value, of_value in by_value.items()} for name, by_value in scores.items()
    }


def run_traps(
    traps: Iterable[Trap],
    seed: int,
    sequences: int | None,
    configs: Configurations,
    cache: Path | None = None,
    pool: Pool | None = None,
    quiet: bool = True,
) -> dict[str, dict[str, TrapMeasures]]:
    """Track sequences that were made for one difficulty each.

    Args:
        traps: which.
        seed: of the suite that the sequences are taken from.
        sequences: how many of each; None: as many as each has variants.
        configs: the trackers' parameters, by name.
        cache: directory that keeps what was rendered; None keeps nothing.
        pool: who does it; None: this process.
        quiet: no progress bar.

    Returns:
        By trap and configuration.
    """
    todo = [(trap, one) for trap in traps for one in trap_scenarios(trap, seed, sequences)]
    done = _tracked([scenario for _, scenario in todo], configs, cache, pool, "traps", quiet)
    results: dict[str, dict[str, list[SequenceResult]]] = {}
    for (trap, _), of_sequence in zip(todo, done, strict=True):
        by_config = results.setdefault(trap.name, {name: [] for name in configs})
        for name, result in of_sequence.items():
            by_config[name].append(result)
    return {
        trap: {name: trap_measures(TRAPS[trap], of_config) for name, of_config in by_config.items()}
        for trap, by_config in results.items()
    }


def run_ablations(
    ideas: Sequence[Idea],
    scenarios: Sequence[Scenario],
    trapped: Sequence[tuple[Trap, Scenario]],
    config: StreamConfig,
    cache: Path | None = None,
    pool: Pool | None = None,
    quiet: bool = True,
) -> list[Outcome]:
    """Track everything with all ideas, then with each switched off; on one thread, because times are compared.

    Args:
        ideas: those to be switched off.
        scenarios: random sequences.
        trapped: the traps' sequences.
        config: the whole tracker's parameters.
        cache: directory that keeps what was rendered; None keeps nothing.
        pool: who does it; None: this process.
        quiet: no progress bar.

    Returns:
        The whole tracker's outcome, then each idea's.
    """
    every = [*scenarios, *(scenario for _, scenario in trapped)]
    task = partial(run_variants, ideas=ideas, config=config, cache=cache)
    outcomes = [Outcome(None), *(Outcome(idea) for idea in ideas)]
    done = progress(in_order((pool or ThisProcess()).run(task, every)), len(every), "ablation", quiet)
    traps = [None] * len(scenarios) + [trap for trap, _ in trapped]
    for trap, variants in zip(traps, done, strict=True):
        for outcome, variant in zip(outcomes, variants, strict=True):
            outcome.add(variant, trap)
    return outcomes


def run_variants(
    scenario: Scenario, ideas: Sequence[Idea], config: StreamConfig, cache: Path | None = None
) -> list[Variant]:
    """Render one sequence, or read it from the cache, and track it with all ideas and without each."""
    return track_variants(SequenceCache(cache).sequence(scenario), ideas, config)


def _tracked(
    scenarios: Sequence[Scenario],
    configs: Configurations,
    cache: Path | None,
    pool: Pool | None,
    label: str,
    quiet: bool,
) -> Iterator[dict[str, SequenceResult]]:
    """What every configuration makes of each sequence, in their order, by whoever does it."""
    done = in_order((pool or ThisProcess()).run(partial(run_scenario, configs=configs, cache=cache), scenarios))
    return progress(done, len(scenarios), label, quiet)
