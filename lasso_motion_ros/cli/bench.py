"""`lasso-motion bench`: how fast the tracker answers, from undecoded messages to serialised answers, on one thread."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from contextlib import nullcontext
from dataclasses import asdict
from pathlib import Path
from typing import Any

from lasso_motion_ros.bench.archive_rate import format_archive, measure_archive
from lasso_motion_ros.bench.memory_growth import format_memory, measure_memory
from lasso_motion_ros.bench.overlay_times import format_overlay, measure_overlay
from lasso_motion_ros.bench.scaling import format_scaling, measure_scaling
from lasso_motion_ros.bench.stage_times import format_benchmark, measure, summarise
from lasso_motion_ros.bench.undecoded import read_undecoded
from lasso_motion_ros.cli.archives import count
from lasso_motion_ros.cli.arguments import CommandParser
from lasso_motion_ros.cli.main import EXIT_DONE
from lasso_motion_ros.config.parameters import load_configuration
from lasso_motion_ros.config.stream import StreamConfig
from lasso_motion_ros.core.compiled import plain
from lasso_motion_ros.core.errors import LassoMotionError
from lasso_motion_ros.core.one_thread import one_thread
from lasso_motion_ros.core.output_files import write_json
from lasso_motion_ros.core.progress import busy
from lasso_motion_ros.core.share import bundled_recording, share_file
from lasso_motion_ros.nodes.ros_start import require_ros
from msg_adapters.recordings.reader import RawMessage

HELP = """Measure the tracker stage by stage on one thread, from the undecoded messages of a recording to the serialised
answers: all that the node does for a pair. Reading the file and building the model from the clicks are not in it. Then
the overlay: 20,000 triangles drawn over pictures of 1024², one plane."""

DEFAULT_PAIRS = 60
LIVE_RATE_LIMIT = 200.0
LIVE_SIDES = range(128, 4097)


def add_arguments(parser: CommandParser) -> None:
    """Declare the command's own arguments."""
    parser.add_input("--config", metavar="FILE", help="tracker parameters (default: config/tracker.yaml)")
    parser.add_input("--bag", metavar="FILE", help="recording to track (default: the bundled one)")
    parser.add_argument(
        "--pairs", type=int, default=DEFAULT_PAIRS, metavar="N", help="pairs to track (default %(default)s)"
    )
    parser.add_argument(
        "--plain", action="store_true", help="in plain numpy, though the extra `fast` is installed: to compare"
    )
    parser.add_output("--json", metavar="FILE", help="write the figures")
    parser.add_argument(
        "--scaling", action="store_true", help="instead: the cost as the region searched and the model's points grow"
    )
    parser.add_argument(
        "--memory", action="store_true", help="instead: resident memory of one tracker over the pairs (10000, say)"
    )
    parser.add_argument(
        "--archive",
        type=count,
        nargs="+",
        metavar="N",
        help="instead: copies of the recording as an archive, by N processes each: pairs a second, memory",
    )
    parser.add_argument(
        "--live", action="store_true", help="latency over DDS between processes, on a drawn ring, beside bare transport"
    )
    parser.add_argument(
        "--overlay", action="store_true", help="--live: the overlay beside the tracker too: its pictures' age, its cost"
    )
    parser.add_argument(
        "--rate", type=float, nargs="+", default=[15.0, 30.0], metavar="HZ", help="--live: pairs/s (default 15 30)"
    )
    parser.add_argument("--side", type=int, default=1024, metavar="PX", help="--live: side of the images")
    parser.add_argument(
        "--late", type=float, default=0.0, metavar="MS", help="--live: plane B's exposure after plane A's (default 0)"
    )


def run(args: argparse.Namespace) -> int:
    """Measure and print; returns the exit status."""
    if args.pairs < 1:
        raise LassoMotionError(f"--pairs must be at least 1, found {args.pairs}")
    configuration = args.config or share_file("config/tracker.yaml")
    if args.live:
        return _run_live(args, configuration)
    recording = args.bag or bundled_recording()
    config = load_configuration(configuration, StreamConfig)
    if args.archive is not None:
        return _run_archive(args, recording, config)
    messages = read_undecoded(recording)
    if args.scaling or args.memory:
        return _run_growth(args, config, messages)
    with one_thread(), plain() if args.plain else nullcontext():
        clock, codec = measure(config, messages, args.pairs, quiet=args.quiet)
        with busy("drawing overlays", args.quiet):
            overlay = measure_overlay()
        benchmark = summarise(clock, codec, recording.stem, configuration.name)
    print(format_benchmark(benchmark))
    print(format_overlay(overlay))
    if args.json is not None:
        write_json(args.json, asdict(benchmark) | {"overlay": asdict(overlay)})
    return EXIT_DONE


def _run_archive(args: argparse.Namespace, recording: Path, config: StreamConfig) -> int:
    """Whole recordings, by several processes."""
    rates = measure_archive(recording, config, args.archive, quiet=args.quiet)
    print(format_archive(rates))
    if args.json is not None:
        write_json(args.json, [asdict(one) | {"rate_hz": one.rate_hz} for one in rates])
    return EXIT_DONE


def _run_growth(args: argparse.Namespace, config: StreamConfig, messages: Sequence[RawMessage]) -> int:
    """Cost by size, and memory over time."""
    figures: dict[str, Any] = {}
    with one_thread():
        if args.scaling:
            costs = measure_scaling(config, messages, args.pairs)
            print(format_scaling(costs))
            figures["scaling"] = [asdict(cost) for cost in costs]
        if args.memory:
            use = measure_memory(config, messages, args.pairs, quiet=args.quiet)
            print(format_memory(use))
            figures["memory"] = asdict(use)
    if args.json is not None:
        write_json(args.json, figures)
    return EXIT_DONE


def _run_live(args: argparse.Namespace, configuration: Path) -> int:
    """Measure each rate in a new graph: a tracker's counts and caches outlast a stream."""
    require_ros()
    from lasso_motion_ros.bench.live_latency import format_disturbance, format_live, measure_live

    runs = []
    for rate in args.rate:
        if not 0.0 < rate <= LIVE_RATE_LIMIT or args.side not in LIVE_SIDES:
            raise LassoMotionError(f"--rate: up to {LIVE_RATE_LIMIT:g}; --side: {LIVE_SIDES[0]} to {LIVE_SIDES[-1]}")
        if not 0.0 <= 1e-3 * args.late <= 0.5 / rate:
            raise LassoMotionError(f"--late: up to half of the time between two pairs, found {args.late:g}")
        with busy(f"live at {rate:g} pairs/s", args.quiet):
            figures = measure_live(rate, args.pairs, args.side, configuration, late_ms=args.late)
        print(format_live(figures))
        runs.append(asdict(figures))
        if args.overlay:
            with busy(f"live at {rate:g} pairs/s, the overlay beside it", args.quiet):
                beside = measure_live(rate, args.pairs, args.side, configuration, overlay=True, late_ms=args.late)
            print(format_live(beside))
            print(format_disturbance(figures, beside))
            runs.append(asdict(beside))
    if args.json is not None:
        write_json(args.json, runs)
    return EXIT_DONE
