"""`lasso-motion suite`: many short random sequences of the phantom, rendered, tracked and scored in memory."""

from __future__ import annotations

import argparse
import json
from dataclasses import asdict
from pathlib import Path

from lasso_motion_ros.bench.suite.cache import SequenceCache
from lasso_motion_ros.bench.suite.run import SequenceResult, run_sequence
from lasso_motion_ros.bench.suite.sequences import DEFAULT_SEED, DEFAULT_SEQUENCES, suite_scenarios
from lasso_motion_ros.bench.suite.summary import Measures, format_report, format_sweep, measures, suite_report
from lasso_motion_ros.bench.suite.sweeps import SWEEPS, Sweep, capture_range, sweep_scenarios
from lasso_motion_ros.bench.suite.trap_summary import format_traps, trap_measures
from lasso_motion_ros.bench.suite.traps import TRAPS, Trap, trap_scenarios
from lasso_motion_ros.cli.main import EXIT_DONE
from lasso_motion_ros.config.parameters import load_configuration
from lasso_motion_ros.config.stream import StreamConfig
from lasso_motion_ros.core.errors import LassoMotionError, RecordingError
from lasso_motion_ros.core.progress import progress
from lasso_motion_ros.core.share import share_file
from lasso_motion_ros.evaluation.measures import PairScore
from lasso_motion_ros.phantom import Scenario

SWEEP_SEQUENCES = 4

HELP = """Track a suite of random phantom sequences (every orientation, dose, motion, calibration error, event) and
score it, per sequence and in all. The same seed gives the same sequences; each is rendered once for all
configurations."""

FOOTNOTE = """
mm; centre: of the ring in 3-D, mean and maximum; TRE: target registration error; 2-D: both planes, at its depth;
silent: poses more than 2 mm off or without a lasso in its place; missing: no pose though the lasso is in its place;
degr.: poses that were DEGRADED; in 68/95: centre errors inside that ellipsoid of the covariance; sigma: its size."""

ABLATION_NOTE = """Silent: poses more than 2 mm off or without a lasso in its place; missing: no pose though the
lasso is in its place; lengths in mm; TRE: target registration error; in 68 / 95: centre errors inside that ellipsoid
of the covariance, sigma: its size; ms: processor time a pair, one thread. Worse and better: what changed notably
against the first row. The columns of the traps and what names a trap are of its sequences (docs/suite.md), all others
of the random ones; unsaid: TRACKING where doubt is due."""

TRAP_NOTE = """
mm; silent: poses more than 2 mm off or without a lasso in its place; missing: no pose though one is due; unsaid:
TRACKING where doubt is due; false poses: among the pairs with the lasso hidden, gone or displaced; centre: of the
ring in 3-D, mean and maximum; TRE: target registration error; in 95: centre errors inside that ellipsoid of the
covariance; then pairs by state."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command's own arguments."""
    parser.add_argument("--sequences", type=int, metavar="N", help=f"default {DEFAULT_SEQUENCES}")
    parser.add_argument("--seed", type=int, default=DEFAULT_SEED, metavar="S", help="default %(default)s")
    parser.add_argument(
        "--only", type=int, nargs="+", action="extend", metavar="K", help="only these sequences, by number"
    )
    parser.add_argument(
        "--config",
        type=Path,
        nargs="+",
        action="extend",
        metavar="FILE",
        help="tracker parameters (default: config/tracker.yaml)",
    )
    parser.add_argument(
        "--sweep",
        nargs="+",
        action="extend",
        choices=(*SWEEPS, "all"),
        metavar="NAME",
        help=f"vary one property instead, with N sequences a value (default 4): {', '.join(SWEEPS)}, all",
    )
    parser.add_argument(
        "--ablation",
        nargs="*",
        action="extend",
        metavar="IDEA",
        help="track suite and traps with every idea of the tracker switched off in turn, or these: what does it cost?",
    )
    parser.add_argument(
        "--traps",
        nargs="*",
        action="extend",
        metavar="NAME",
        help=f"sequences made for one difficulty each instead, all or these: {', '.join(TRAPS)}",
    )
    parser.add_argument(
        "--cache",
        type=Path,
        metavar="DIR",
        help="keep what is rendered there (15 MB a sequence): an interrupted or a second run does not render it again",
    )
    parser.add_argument("--json", type=Path, metavar="FILE", help="write every measure, pair by pair")
    parser.add_argument("--report", type=Path, metavar="DIR", help="write tables and plots")


def run(args: argparse.Namespace) -> int:
    """Run the suite with every configuration."""
    if (args.sequences is not None and args.sequences < 1) or args.seed < 0:
        raise LassoMotionError("--sequences must be positive and --seed not negative")
    _refuse_contradictions(args)
    if args.sweep:
        return _sweep(args)
    if args.traps is not None and args.ablation is None:
        return _traps(args)
    scenarios = suite_scenarios(args.seed, args.sequences or DEFAULT_SEQUENCES)
    if args.only:
        beyond = [number for number in args.only if not 0 <= number < len(scenarios)]
        if beyond:
            raise LassoMotionError(f"--only: expected 0 to {len(scenarios) - 1}, found {beyond[0]}")
        scenarios = tuple(scenarios[number] for number in args.only)
    if args.ablation is not None:
        return _ablation(args, scenarios)
    configs = _configurations(args)
    rendered = _prepare(args)
    results: dict[str, list[SequenceResult]] = {name: [] for name in configs}
    for scenario in progress(scenarios, len(scenarios), "suite", args.quiet):
        sequence = rendered.sequence(scenario)
        for name, config in configs.items():
            results[name].append(run_sequence(sequence, config))
    for name, of_config in results.items():
        print(f"{Path(name).name}, seed {args.seed}\n{format_report(of_config)}\n")
    if not args.quiet:
        print(FOOTNOTE.lstrip())
    if args.json is not None:
        _write(args.json, json.dumps({Path(n).name: suite_report(r) for n, r in results.items()}, indent=1))
    if args.report is not None:
        _write_report(args.report, {Path(name).stem: of_config for name, of_config in results.items()})
    return EXIT_DONE


def _refuse_contradictions(args: argparse.Namespace) -> None:
    """Options that cannot both be meant."""
    if args.sweep and (args.ablation is not None or args.traps is not None):
        raise LassoMotionError("--sweep: not together with --ablation or --traps")
    if args.only and (args.sweep or (args.traps is not None and args.ablation is None)):
        raise LassoMotionError("--only: numbers of random sequences, of which sweeps and traps have none")
    unknown = [name for name in args.traps or () if name not in TRAPS]
    if unknown:
        raise LassoMotionError(f"--traps: expected some of {', '.join(TRAPS)}, found {unknown[0]}")


def _configurations(args: argparse.Namespace) -> dict[str, StreamConfig]:
    files = args.config or [share_file("config/tracker.yaml")]
    stems = [file.stem for file in files]
    if len(set(stems)) < len(stems):
        again = next(stem for number, stem in enumerate(stems) if stem in stems[:number])
        raise LassoMotionError(f"--config: two files are named {again}; results are told apart by these names")
    return {str(file): load_configuration(file, StreamConfig) for file in files}


def _sweep(args: argparse.Namespace) -> int:
    """Vary one property at a time; each sequence is rendered once for all configurations."""
    configs = _configurations(args)
    rendered = _prepare(args)
    found: dict[str, dict[str, dict[float, Measures]]] = {}
    for name in SWEEPS if "all" in args.sweep else dict.fromkeys(args.sweep):
        sweep = SWEEPS[name]
        scenarios = sweep_scenarios(sweep, args.seed, args.sequences or SWEEP_SEQUENCES)
        scores: dict[str, dict[float, list[PairScore]]] = {config: {} for config in configs}
        for value, scenario in progress(
            [(value, one) for value, many in scenarios.items() for one in many],
            sum(map(len, scenarios.values())),
            name,
            args.quiet,
        ):
            sequence = rendered.sequence(scenario)
            for config, parameters in configs.items():
                scores[config].setdefault(value, []).extend(run_sequence(sequence, parameters).scores)
        found[name] = {
            Path(config).stem: {value: measures(of_value) for value, of_value in by_value.items()}
            for config, by_value in scores.items()
        }
        print(f"{_sweep_text(sweep, found[name])}\n", flush=True)
    if args.json is not None:
        values = {
            name: {c: {str(v): asdict(m) for v, m in by.items()} for c, by in of.items()} for name, of in found.items()
        }
        _write(args.json, json.dumps(values, indent=1))
    if args.report is not None:
        from lasso_motion_ros.bench.suite.plots import sweeps_figure
        from lasso_motion_ros.reports.plots import save_figure

        _make(args.report)
        tables = [_sweep_text(SWEEPS[name], of_sweep) for name, of_sweep in found.items()]
        _write(args.report / "sweeps.txt", "\n\n".join(tables) + "\n")
        capture = [sweep.label for sweep in SWEEPS.values() if sweep.is_capture]
        figure = sweeps_figure({SWEEPS[name].label: one for name, one in found.items()}, capture)
        save_figure(figure, args.report / "sweeps.png")
    return EXIT_DONE


def _sweep_text(sweep: Sweep, found: dict[str, dict[float, Measures]]) -> str:
    """The table of a sweep, with the capture range where that is the question."""
    lines = [format_sweep(sweep.label, found)]
    for config, by_value in found.items() if sweep.is_capture else ():
        reached = capture_range(by_value)
        largest = " (the largest tried)" if reached == max(by_value) else ""
        words = "nowhere" if reached is None else f"up to {reached:g} mm{largest}"
        lines.append(f"{config}: a pose within 2 mm in 95 % of the trials {words}")
    return "\n".join(lines)


def _chosen_traps(args: argparse.Namespace) -> list[Trap]:
    return [TRAPS[name] for name in dict.fromkeys(args.traps or TRAPS)]


def _traps(args: argparse.Namespace) -> int:
    """Sequences made for one difficulty each; each is rendered once for all configurations."""
    configs = _configurations(args)
    rendered = _prepare(args)
    todo = [(trap, one) for trap in _chosen_traps(args) for one in trap_scenarios(trap, args.seed, args.sequences)]
    results: dict[str, dict[str, list[SequenceResult]]] = {}
    for trap, scenario in progress(todo, len(todo), "traps", args.quiet):
        sequence = rendered.sequence(scenario)
        for config, parameters in configs.items():
            by_config = results.setdefault(trap.name, {})
            by_config.setdefault(Path(config).stem, []).append(run_sequence(sequence, parameters))
    found = {
        name: {config: trap_measures(TRAPS[name], of_config) for config, of_config in by_config.items()}
        for name, by_config in results.items()
    }
    text = format_traps(found)
    print(f"traps, seed {args.seed}\n{text}")
    if not args.quiet:
        print(TRAP_NOTE)
    if args.json is not None:
        values = {name: {config: asdict(one) for config, one in by.items()} for name, by in found.items()}
        _write(args.json, json.dumps(values, indent=1))
    if args.report is not None:
        _write(args.report / "traps.txt", f"traps, seed {args.seed}\n{text}\n{TRAP_NOTE}\n")
    return EXIT_DONE


def _ablation(args: argparse.Namespace, scenarios: tuple[Scenario, ...]) -> int:
    """Suite and traps with every idea switched off in turn; on one thread, since the table has times."""
    from lasso_motion_ros.bench.one_thread import one_thread
    from lasso_motion_ros.bench.suite.ablation import format_ablation, run_ablation
    from lasso_motion_ros.bench.suite.ideas import IDEAS

    unknown = [name for name in args.ablation if name not in IDEAS]
    if unknown:
        raise LassoMotionError(f"--ablation: expected some of {', '.join(IDEAS)}, found {unknown[0]}")
    (config, *others) = _configurations(args).values()
    if others:
        raise LassoMotionError("--ablation: one --config only")
    rendered = _prepare(args)
    ideas = [IDEAS[name] for name in args.ablation or IDEAS]
    todo = [(trap, one) for trap in _chosen_traps(args) for one in trap_scenarios(trap, args.seed)]
    shown = progress(scenarios, len(scenarios), "ablation", args.quiet)
    trapped = progress(todo, len(todo), "traps", args.quiet)
    with one_thread():
        outcomes = run_ablation(
            config,
            (rendered.sequence(scenario) for scenario in shown),
            ideas,
            ((trap, rendered.sequence(scenario)) for trap, scenario in trapped),
        )
    text = format_ablation(outcomes)
    print(text)
    if args.json is not None:
        values = [
            {
                "without": outcome.idea and outcome.idea.without,
                "ms": outcome.ms,
                "measures": asdict(outcome.measures),
                "traps": {name: asdict(one) for name, one in outcome.traps.items()},
            }
            for outcome in outcomes
        ]
        _write(args.json, json.dumps(values, indent=1))
    if args.report is not None:
        title = f"{len(scenarios)} random sequences of seed {args.seed}, {outcomes[0].measures.pairs} pairs"
        title += f", and {len(todo)} traps, {sum(one.measures.pairs for one in outcomes[0].traps.values())} pairs"
        _write(args.report / "ablation.md", f"# Each idea switched off in turn\n\n{title}. {ABLATION_NOTE}\n\n{text}\n")
    return EXIT_DONE


def _prepare(args: argparse.Namespace) -> SequenceCache:
    """What cannot be written is said before minutes of work, not after them."""
    if args.report is not None:
        _make(args.report)
    if args.json is not None:
        _write(args.json, "")
    return SequenceCache(args.cache)


def _make(directory: Path) -> None:
    try:
        directory.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise RecordingError(f"{directory}: cannot be made: {error.strerror}") from error


def _write_report(directory: Path, results: dict[str, list[SequenceResult]]) -> None:
    from lasso_motion_ros.bench.suite.plots import suite_figure
    from lasso_motion_ros.reports.plots import save_figure

    _make(directory)
    for name, of_config in results.items():
        _write(directory / f"suite_{name}.txt", format_report(of_config) + "\n")
    save_figure(suite_figure(results), directory / "suite.png")


def _write(path: Path, text: str) -> None:
    try:
        path.write_text(text, encoding="utf-8")
    except OSError as error:
        raise RecordingError(f"{path}: cannot be written: {error.strerror}") from error
