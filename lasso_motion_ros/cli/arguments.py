"""Arguments common to the commands: an error is one plain line, and an option takes only its own values."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Mapping, Sequence
from typing import Any, NoReturn

from lasso_motion_ros.core.errors import LassoMotionError

# Whatever follows is not the command's to read.
_ENDS = ("--", "--ros-args")


class CommandParser(argparse.ArgumentParser):
    """A command's parser.

    An option that was added with `add_several` takes one value or more, and may be repeated, but leaves what cannot
    be one of its values to the arguments without a name: `--remap a:=b IN.mcap` means the same as
    `IN.mcap --remap a:=b`. argparse's own `nargs="+"` takes every word up to the next option.
    """

    def __init__(self, *args: Any, **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)
        self._several: dict[str, Callable[[str], bool]] = {}

    def add_several(self, option: str, fits: Callable[[str], bool], **settings: Any) -> None:
        """Declare an option with one value or more; a list, empty where it is not given.

        Args:
            option: its name, `--remap`.
            fits: whether a word can be one of its values.
            settings: of `add_argument`.
        """
        self._several[option] = fits
        self.add_argument(option, nargs="+", action="extend", default=[], **settings)

    def parse_known_args(self, args: Any = None, namespace: Any = None) -> tuple[Any, list[str]]:
        """As argparse does, after each value has been tied to its option."""
        return super().parse_known_args(args if args is None else tie_values(args, self._several), namespace)

    def error(self, message: str) -> NoReturn:
        """Say in one line what is wrong; `--help` shows the usage."""
        self.exit(2, f"{self.prog}: {message} (--help shows the usage)\n")


def tie_values(arguments: Sequence[str], several: Mapping[str, Callable[[str], bool]]) -> list[str]:
    """Arguments in which the values of some options are tied to them: `--remap a b` becomes `--remap=a --remap=b`.

    Args:
        arguments: as typed.
        several: by option, whether a word can be one of its values. The first word behind an option always is one,
            right or wrong.
    """
    tied: list[str] = []
    option, first = "", False
    for place, word in enumerate(arguments):
        if word in _ENDS:
            return [*tied, *arguments[place:]]
        if word.startswith("-"):
            option, first = (word, True) if word in several else ("", False)
            follower = arguments[place + 1] if place + 1 < len(arguments) else "-"
            if not option or follower.startswith("-"):
                tied.append(word)  # without a value it is for argparse to complain
        elif option and (first or several[option](word)):
            tied.append(f"{option}={word}")
            first = False
        else:
            tied.append(word)
            option = ""
    return tied


def add_remap(parser: CommandParser, meaning: str) -> None:
    """Declare `--remap`, whose values `parse_remap` takes.

    Args:
        parser: the command's.
        meaning: what a rule does in this command.
    """
    parser.add_several("--remap", lambda word: ":=" in word, metavar="FROM:=TO", help=meaning)


def parse_remap(rules: Sequence[str]) -> dict[str, str]:
    """Rules `from:=to` as a mapping.

    Raises:
        LassoMotionError: a rule of another form, or two for one topic.
    """
    remap: dict[str, str] = {}
    for rule in rules:
        old, separator, new = rule.partition(":=")
        if not (separator and old and new) or ":=" in new:
            raise LassoMotionError(f"--remap: expected FROM:=TO, found {rule!r}")
        if old in remap:
            raise LassoMotionError(f"--remap: {old} is given twice")
        remap[old] = new
    return remap


def positive(text: str) -> float:
    """An argument above zero."""
    value = float(text)
    if not value > 0.0:
        raise argparse.ArgumentTypeError(f"must be above zero, found {text}")
    return value


def not_negative(text: str) -> float:
    """An argument that is zero or more."""
    value = float(text)
    if not value >= 0.0:
        raise argparse.ArgumentTypeError(f"must not be negative, found {text}")
    return value


def port(text: str) -> int:
    """A TCP port, from an argument."""
    value = int(text)
    if not 0 <= value <= 65535:
        raise argparse.ArgumentTypeError(f"expected 0 to 65535, found {text}")
    return value
