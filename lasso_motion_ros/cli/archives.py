"""Commands on many recordings: their arguments, who does the work, and what is said of it."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterable, Sequence
from dataclasses import asdict
from pathlib import Path

from lasso_motion_ros.cli.arguments import CommandParser
from lasso_motion_ros.cli.main import EXIT_BAD_INPUT, EXIT_DONE, EXIT_PART
from lasso_motion_ros.core.errors import LassoMotionError
from lasso_motion_ros.core.output_files import write_json
from lasso_motion_ros.core.worker_pool import DaskCluster, LocalPool, Pool, ThisProcess
from lasso_motion_ros.tools.archive import run_archive
from lasso_motion_ros.tools.archive_job import Work
from lasso_motion_ros.tools.archive_rows import TABLE
from msg_adapters.recordings.recording_search import is_collection

ARCHIVE_HELP = """
Many recordings: name folders, patterns ('data/**/*.mcap', quoted) and files, add --workers N or --scheduler ADDRESS,
and -o is a folder: a result for each, under its path below the folder that was named, and a row for each in
archive.csv. What is finished already (same input, configuration and version) is left as it is; a recording that fails
is a row with its reason."""


def add_workers(parser: CommandParser, what: str = "recordings") -> None:
    """Declare `--workers` and `--scheduler`; where a command declares an output for many, that is a folder with them.

    Args:
        parser: the command's.
        what: of what there are many.
    """
    group = parser.add_mutually_exclusive_group()
    group.add_argument("--workers", type=count, metavar="N", help=f"many {what}, by N processes of this machine")
    group.add_argument("--scheduler", metavar="ADDRESS", help=f"many {what}, by a Dask cluster (tcp://host:8786)")


def archive_files(suffix: str) -> tuple[str, ...]:
    """Patterns of the files that an archive's run writes into its folder."""
    return (f"*{suffix}", TABLE)


def worker_pool(args: argparse.Namespace) -> Pool:
    """Who does the work, as the arguments say; this process, where they say nothing."""
    if args.scheduler is not None:
        return DaskCluster(args.scheduler, lambda line: _say(args, line))
    return ThisProcess() if args.workers is None else LocalPool(args.workers)


def only_recording(paths: Sequence[Path]) -> Path:
    """The recording of a command that is not on an archive.

    Raises:
        LassoMotionError: there are several, or a folder or a pattern that stands for several.
    """
    several = "--workers N takes several, and -o is a folder then"
    if len(paths) > 1:
        raise LassoMotionError(f"found {len(paths)} recordings: {several}")
    if is_collection(paths[0]):
        raise LassoMotionError(f"{paths[0]} is no recording: {several}")
    return paths[0]


def run_over_archive(args: argparse.Namespace, named: Iterable[tuple[Work, str, str]], label: str) -> int:
    """Do something with every recording; returns the exit status.

    Args:
        args: the command's, with `output`, `overwrite`, `quiet`, `json`, `workers` and `scheduler`.
        named: as `run_archive` takes it.
        label: what is being done, a word or two.
    """
    summary = run_archive(
        named,
        args.output,
        worker_pool(args),
        lambda line: _say(args, line),
        label=label,
        overwrite=args.overwrite,
        quiet=args.quiet,
    )
    if not args.quiet:
        print(summary.line(args.output))
    if args.json is not None:
        write_json(args.json, [asdict(row) for row in summary.rows])
    if summary.failed == len(summary.rows):
        return EXIT_BAD_INPUT
    return EXIT_DONE if summary.complete else EXIT_PART


def count(text: str) -> int:
    """An argument that counts something, from 1 on."""
    value = int(text)
    if value < 1:
        raise argparse.ArgumentTypeError(f"must be at least 1, found {text}")
    return value


def _say(args: argparse.Namespace, line: str) -> None:
    print(f"{args.parser.prog}: {line}", file=sys.stderr)
