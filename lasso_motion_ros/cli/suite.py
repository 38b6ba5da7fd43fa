"""`lasso-motion suite`: many short random sequences of the phantom, rendered, tracked and scored in memory."""

from __future__ import annotations

import argparse
from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path

from lasso_motion_ros.bench.model_experiment import DEFAULT_TRIALS, format_experiment, run_model_experiment
from lasso_motion_ros.bench.suite.ablation import ablation_record, format_ablation
from lasso_motion_ros.bench.suite.clinic_runs import run_clinic
from lasso_motion_ros.bench.suite.clinic_scenarios import CLINIC_SEQUENCES, ClinicScenario, clinic_scenarios
from lasso_motion_ros.bench.suite.clinic_tables import CLINIC_NOTE, class_measures, clinic_record, format_clinic
from lasso_motion_ros.bench.suite.ideas import IDEAS
from lasso_motion_ros.bench.suite.random_scenarios import DEFAULT_SEED, DEFAULT_SEQUENCES, suite_scenarios
from lasso_motion_ros.bench.suite.suite_report import write_suite_report, write_sweeps_report
from lasso_motion_ros.bench.suite.suite_runs import run_ablations, run_suite, run_sweep, run_traps
from lasso_motion_ros.bench.suite.suite_tables import format_suite, format_sweep, suite_record, sweeps_record
from lasso_motion_ros.bench.suite.sweeps import SWEEPS
from lasso_motion_ros.bench.suite.trap_measures import format_traps, traps_record
from lasso_motion_ros.bench.suite.traps import TRAPS, Trap, trap_scenarios
from lasso_motion_ros.cli.archives import add_workers, worker_pool
from lasso_motion_ros.cli.arguments import CommandParser, is_archive
from lasso_motion_ros.cli.main import EXIT_DONE
from lasso_motion_ros.config.parameters import load_configuration
from lasso_motion_ros.config.stream import StreamConfig
from lasso_motion_ros.core.errors import LassoMotionError
from lasso_motion_ros.core.output_files import whole_directory, write_json, write_text
from lasso_motion_ros.core.share import share_file
from lasso_motion_ros.core.worker_pool import processors

SWEEP_SEQUENCES = 4
SUITE_FILES = ("suite_*.txt", "suite.png")
REPORT_FILES = (*SUITE_FILES, "sweeps.txt", "sweeps.png", "clinic.txt", "traps.txt", "ablation.md")
"""What --report writes, without further options, and in all."""

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


def add_arguments(parser: CommandParser) -> None:
    """Declare the command's own arguments."""
    parser.add_argument("--sequences", type=int, metavar="N", help=f"default {DEFAULT_SEQUENCES}")
    parser.add_argument("--seed", type=int, default=DEFAULT_SEED, metavar="S", help="default %(default)s")
    parser.add_argument(
        "--only", type=int, nargs="+", action="extend", metavar="K", help="only these sequences, by number"
    )
    parser.add_input(
        "--config",
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
        help="track suite (or --clinic) and traps with every idea of the tracker switched off in turn, or these: what"
        " does it cost?",
    )
    parser.add_argument(
        "--traps",
        nargs="*",
        action="extend",
        metavar="NAME",
        help=f"sequences made for one difficulty each instead, all or these: {', '.join(TRAPS)}",
    )
    parser.add_argument(
        "--clinic",
        action="store_true",
        help=f"sequences as wide as a lab instead (default {CLINIC_SEQUENCES}), told per event class; all processors",
    )
    add_workers(parser, "sequences")
    parser.add_argument(
        "--model-experiment",
        type=int,
        nargs="?",
        const=DEFAULT_TRIALS,
        metavar="N",
        help="the paper's experiment instead: how far N rings (default %(const)s) reconstructed from noisy outlines are"
        " from the truth",
    )
    parser.add_input(
        "--cache",
        metavar="DIR",
        help="keep what is rendered there (15 MB a sequence): an interrupted or a second run does not render it again",
    )
    parser.add_output("--json", metavar="FILE", help="write every measure, pair by pair")
    parser.add_output("--report", directory=True, owned=REPORT_FILES, metavar="DIR", help="write tables and plots")


def run(args: argparse.Namespace) -> int:
    """Run what was asked for, and say what came of it; returns the exit status."""
    _refuse_contradictions(args)
    files = args.config or [share_file("config/tracker.yaml")]
    configs = {file.stem: load_configuration(file, StreamConfig) for file in files}
    if args.model_experiment is not None:
        _model_experiment(args)
    elif args.ablation is not None:
        _ablation(args, *configs.values())
    elif args.clinic:
        _clinic(args, configs)
    elif args.sweep:
        _sweeps(args, configs)
    elif args.traps is not None:
        _traps(args, configs)
    else:
        _random(args, configs, {file.stem: file.name for file in files})
    return EXIT_DONE


def _random(args: argparse.Namespace, configs: Mapping[str, StreamConfig], files: Mapping[str, str]) -> None:
    scenarios = suite_scenarios(args.seed, args.sequences or DEFAULT_SEQUENCES, args.only)
    results = run_suite(scenarios, configs, args.cache, worker_pool(args), args.quiet)
    for name, of_config in results.items():
        print(f"{files[name]}, seed {args.seed}\n{format_suite(of_config)}\n")
    if not args.quiet:
        print(FOOTNOTE.lstrip())
    if args.json is not None:
        write_json(args.json, {files[name]: suite_record(of_config) for name, of_config in results.items()})
    if args.report is not None:
        with whole_directory(args.report, SUITE_FILES) as report:
            write_suite_report(report, results)


def _clinic(args: argparse.Namespace, configs: Mapping[str, StreamConfig]) -> None:
    drawn = _clinic_scenarios(args)
    pool = worker_pool(args) if is_archive(args) else processors()
    results = run_clinic(drawn, configs, args.cache, pool, args.quiet)
    found = {name: class_measures([one.judged for one in of_config]) for name, of_config in results.items()}
    text = f"clinic, seed {args.seed}\n{format_clinic(found)}"
    print(text)
    if not args.quiet:
        print(CLINIC_NOTE)
    if args.json is not None:
        write_json(args.json, {name: clinic_record(of_config) for name, of_config in results.items()})
    if args.report is not None:
        _write_page(args.report, "clinic.txt", f"{text}\n{CLINIC_NOTE}\n")


def _clinic_scenarios(args: argparse.Namespace) -> tuple[ClinicScenario, ...]:
    """The clinic suite's, or those of it that were asked for."""
    drawn = clinic_scenarios(args.seed, args.sequences or CLINIC_SEQUENCES)
    return tuple(drawn[number] for number in args.only) if args.only else tuple(drawn)


def _sweeps(args: argparse.Namespace, configs: Mapping[str, StreamConfig]) -> None:
    found = {}
    for name in SWEEPS if "all" in args.sweep else dict.fromkeys(args.sweep):
        sequences, pool = args.sequences or SWEEP_SEQUENCES, worker_pool(args)  # a cluster serves one run
        found[name] = run_sweep(SWEEPS[name], args.seed, sequences, configs, args.cache, pool, args.quiet)
        print(f"{format_sweep(SWEEPS[name], found[name])}\n", flush=True)
    if args.json is not None:
        write_json(args.json, sweeps_record(found))
    if args.report is not None:
        with whole_directory(args.report) as report:
            write_sweeps_report(report, found)


def _traps(args: argparse.Namespace, configs: Mapping[str, StreamConfig]) -> None:
    chosen, pool = _chosen_traps(args), worker_pool(args)
    found = run_traps(chosen, args.seed, args.sequences, configs, args.cache, pool, args.quiet)
    text = f"traps, seed {args.seed}\n{format_traps(found)}"
    print(text)
    if not args.quiet:
        print(TRAP_NOTE)
    if args.json is not None:
        write_json(args.json, traps_record(found))
    if args.report is not None:
        _write_page(args.report, "traps.txt", f"{text}\n{TRAP_NOTE}\n")


def _ablation(args: argparse.Namespace, config: StreamConfig) -> None:
    if args.clinic:
        scenarios = tuple(one.scenario for one in _clinic_scenarios(args))
    else:
        scenarios = suite_scenarios(args.seed, args.sequences or DEFAULT_SEQUENCES, args.only)
    trapped = [(trap, one) for trap in _chosen_traps(args) for one in trap_scenarios(trap, args.seed)]
    ideas = [IDEAS[name] for name in args.ablation or IDEAS]
    outcomes = run_ablations(ideas, scenarios, trapped, config, args.cache, worker_pool(args), args.quiet)
    text = format_ablation(outcomes)
    print(text)
    if args.json is not None:
        write_json(args.json, ablation_record(outcomes))
    if args.report is not None:
        kind = "clinic" if args.clinic else "random"
        title = f"{len(scenarios)} {kind} sequences of seed {args.seed}, {outcomes[0].measures.pairs} pairs"
        title += f", and {len(trapped)} traps, {sum(one.measures.pairs for one in outcomes[0].traps.values())} pairs"
        page = f"# Each idea switched off in turn\n\n{title}. {ABLATION_NOTE}\n\n{text}\n"
        _write_page(args.report, "ablation.md", page)


def _model_experiment(args: argparse.Namespace) -> None:
    found = run_model_experiment(args.model_experiment, random_seed=args.seed)
    print(format_experiment(found))
    if args.json is not None:
        write_json(args.json, asdict(found))


def _refuse_contradictions(args: argparse.Namespace) -> None:
    """Options that cannot both be meant, and values that are not allowed."""
    if (args.sequences is not None and args.sequences < 1) or args.seed < 0:
        raise LassoMotionError("--sequences must be positive and --seed not negative")
    elsewhere = (args.sweep, None if args.ablation is not None else args.traps, args.model_experiment)
    if args.clinic and any(option is not None for option in elsewhere):
        raise LassoMotionError(
            "--clinic: not together with --sweep, --model-experiment or, but for --ablation, --traps"
        )
    if args.sweep and (args.ablation is not None or args.traps is not None):
        raise LassoMotionError("--sweep: not together with --ablation or --traps")
    if args.only and (args.sweep or (args.traps is not None and args.ablation is None)):
        raise LassoMotionError("--only: numbers of random sequences, of which sweeps and traps have none")
    last = (args.sequences or (CLINIC_SEQUENCES if args.clinic else DEFAULT_SEQUENCES)) - 1
    beyond = [number for number in args.only or () if not 0 <= number <= last]
    if beyond:
        raise LassoMotionError(f"--only: expected 0 to {last}, found {beyond[0]}")
    for option, given, known in (("--traps", args.traps, TRAPS), ("--ablation", args.ablation, IDEAS)):
        unknown = [name for name in given or () if name not in known]
        if unknown:
            raise LassoMotionError(f"{option}: expected some of {', '.join(known)}, found {unknown[0]}")
    stems = [file.stem for file in args.config or ()]
    again = [stem for number, stem in enumerate(stems) if stem in stems[:number]]
    if again:
        raise LassoMotionError(f"--config: two files are named {again[0]}; results are told apart by these names")
    if args.ablation is not None and len(stems) > 1:
        raise LassoMotionError("--ablation: one --config only")
    if args.model_experiment is not None:
        if args.model_experiment < 1:
            raise LassoMotionError(f"--model-experiment must be at least 1, found {args.model_experiment}")
        others = (
            "sequences",
            "only",
            "config",
            "sweep",
            "ablation",
            "traps",
            "cache",
            "report",
            "workers",
            "scheduler",
        )
        if any(getattr(args, other) is not None for other in others):
            raise LassoMotionError("--model-experiment: with --seed and --json only")


def _write_page(directory: Path, name: str, text: str) -> None:
    with whole_directory(directory) as report:
        write_text(report / name, text)


def _chosen_traps(args: argparse.Namespace) -> list[Trap]:
    return [TRAPS[name] for name in dict.fromkeys(args.traps or TRAPS)]
