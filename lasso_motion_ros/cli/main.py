"""The `lasso-motion` command: finds the command's module, runs it, and turns errors into one plain line."""

from __future__ import annotations

import argparse
import importlib
import io
import sys
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from types import ModuleType
from typing import cast

from lasso_motion_ros.cli.arguments import CommandParser
from lasso_motion_ros.core.errors import LassoMotionError
from lasso_motion_ros.core.share import version
from lasso_motion_ros.core.signals import Terminated, end_at_once, interruptible
from lasso_motion_ros.core.terminal import printable_streams

EXIT_DONE = 0
EXIT_BAD_INPUT = 2  # argparse's own too
EXIT_PART = 3  # done, with part of the input (a truncated recording, say)
EXIT_INTERRUPTED = 130
EXIT_TERMINATED = 143


@dataclass(frozen=True)
class Command:
    """One subcommand.

    Attributes:
        name: as typed.
        summary: one line for `lasso-motion --help`, kept here so that help imports no command.
        module: name of its module in `lasso_motion_ros.cli`, with HELP, add_arguments(parser) and run(args).
    """

    name: str
    summary: str
    module: str


COMMANDS = (
    Command("demo", "the whole graph, live: player, tracker and overlay; video, plots and a table", "demo"),
    Command("synth", "render a biplane recording with exact truth", "synth"),
    Command("import", "DICOM XA, one object a plane, into a recording", "import_dicom"),
    Command("track", "follow the lasso through a recording, offline", "track"),
    Command("play", "publish a recording on its topics in real time", "play"),
    Command("record", "capture a live graph's inputs and outputs, safe against a crash; repair a cut file", "record"),
    Command("check", "look at a live graph or a recording: what is wrong, and how to mend it", "check"),
    Command("web", "a page in the browser: see it live, click to start, draw centrelines", "web"),
    Command("igtl", "motion and state to an OpenIGTLink server: 3D Slicer, Plus", "igtl"),
    Command("evaluate", "tracking against truth: errors, losses, the share of the motion removed", "evaluate"),
    Command("render", "the overlay offline: a video or frames from a recording and a result", "render"),
    Command("suite", "many random phantom sequences: render, track, score", "suite"),
    Command("benchmark", "recordings and truth as files for any tracker to enter; score what it answers", "benchmark"),
    Command("bench", "speed of the tracker, stage by stage, on one thread", "bench"),
)


def main(argv: Sequence[str] | None = None) -> int:
    """Run one command.

    Args:
        argv: arguments without the program's name; None takes the process's own.

    Returns:
        The exit status: 0 done, 2 bad input, 3 done with part of the input, 130 interrupted, 143
        terminated.
    """
    arguments = list(sys.argv[1:] if argv is None else argv)
    _show_lines_at_once()
    named = next((command for command in COMMANDS if arguments and command.name == arguments[0]), None)
    with printable_streams():
        try:
            return _run(named, arguments)
        except KeyboardInterrupt as interrupt:
            # What was being written is thrown away by now.
            print(f"{_prog(named)}: interrupted", file=sys.stderr)
            return EXIT_TERMINATED if isinstance(interrupt, Terminated) else EXIT_INTERRUPTED
        except MemoryError:
            print(f"{_prog(named)}: there is not enough memory for this", file=sys.stderr)
            return EXIT_BAD_INPUT
        except BrokenPipeError:
            # The reader of our output has gone (`| head`); what it read is all it wanted.
            sys.stdout = None
            return EXIT_DONE
        except OSError as error:
            # What no command foresees: a disk that is full, a file that may not be read.
            what = f"{error.filename}: " if error.filename is not None else ""
            with suppress(OSError):
                print(f"{_prog(named)}: {what}{error.strerror or error}", file=sys.stderr)
            _give_up_unwritable_output()
            return EXIT_BAD_INPUT


def _run(named: Command | None, arguments: Sequence[str]) -> int:
    parser = _parser(named)
    try:
        options = parser.parse_args(arguments)
    except SystemExit as stop:  # argparse's own way out: 0 after --help, 2 after a usage error
        return int(stop.code or 0)
    if named is None:
        print("lasso-motion: name a command (--help lists them)", file=sys.stderr)
        return EXIT_BAD_INPUT
    try:
        with interruptible():
            options.parser.check_files(options)
            return cast(Callable[[argparse.Namespace], int], options.run)(options)
    except LassoMotionError as error:
        print(f"{_prog(named)}: {error}", file=sys.stderr)
        return EXIT_BAD_INPUT


def _give_up_unwritable_output() -> None:
    """Forget what standard output cannot take: Python would try again at its end, and complain."""
    try:
        if sys.stdout is not None:
            sys.stdout.flush()
    except OSError:
        sys.stdout = None


def _prog(named: Command | None) -> str:
    return "lasso-motion" if named is None else f"lasso-motion {named.name}"


def _show_lines_at_once() -> None:
    """Flush standard output at every line, also into a pipe (`| tee log`, a supervisor).

    Python would hold lines back until some kilobytes are there, and show them behind the errors that came after them.
    """
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(line_buffering=True)


def _parser(named: Command | None) -> CommandParser:
    """The parser; only the command that was named has its module imported, which keeps the others' cost away."""
    parser = CommandParser(
        prog="lasso-motion",
        description="Breathing motion from a lasso catheter in biplane X-ray. Research use only, not a medical device.",
    )
    parser.add_argument("--version", action="version", version=f"lasso-motion {version()}")
    commands = parser.add_subparsers(title="commands", metavar="COMMAND")
    for command in COMMANDS:
        if command is not named:
            commands.add_parser(command.name, help=command.summary)
            continue
        module: ModuleType = importlib.import_module(f"lasso_motion_ros.cli.{command.module}")
        subparser = commands.add_parser(command.name, help=command.summary, description=module.HELP)
        subparser.add_argument("--quiet", action="store_true", help="print results and errors only")
        module.add_arguments(subparser)
        subparser.set_defaults(run=module.run, parser=subparser)
    return parser


if __name__ == "__main__":
    end_at_once()
    sys.exit(main())
