"""Arguments common to the commands: an error is one plain line, and an option takes only its own values."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NoReturn

from lasso_motion_ros.core.errors import LassoMotionError
from lasso_motion_ros.core.output_checks import OutputPlace, check_outputs

# Whatever follows is not the command's to read.
_ENDS = ("--", "--ros-args")


@dataclass(frozen=True)
class OutputArgument:
    """An argument that names an output.

    Attributes:
        name: of its value.
        is_directory: whether that is a directory.
        owned: of a directory, patterns of the names that are written there.
        ignored: of a directory, names whose loss is none.
        unless: an argument that, where it is given, makes this one no output.
        many: of an archive's run, where it is a directory, patterns of the names that are written there.
    """

    name: str
    is_directory: Callable[[Path], bool]
    owned: Sequence[str]
    ignored: Sequence[str]
    unless: str
    many: Sequence[str]

    def place(self, options: argparse.Namespace) -> OutputPlace | None:
        """Where the command writes it, or None where it does not."""
        path = getattr(options, self.name)
        if path is None or (self.unless and getattr(options, self.unless)):
            return None
        if self.many and is_archive(options):
            return OutputPlace(path, True, self.many, resumed=True)
        return OutputPlace(path, self.is_directory(path), self.owned, self.ignored)


class CommandParser(argparse.ArgumentParser):
    """A command's parser, which knows what the command reads and writes.

    Arguments that name a file or a directory are added with `add_input` or `add_output`. That is all a command has to
    do so that no output replaces an input or another output, nor without `--overwrite` anything else: `check_files`
    looks at all of them before the command runs.

    An option that was added with `add_several` takes one value or more, and may be repeated, but leaves what cannot
    be one of its values to the arguments without a name: `--remap a:=b IN.mcap` means the same as
    `IN.mcap --remap a:=b`. argparse's own `nargs="+"` takes every word up to the next option.
    """

    def __init__(self, *args: Any, **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)
        self._several: dict[str, Callable[[str], bool]] = {}
        self._inputs: list[str] = []
        self._outputs: list[OutputArgument] = []

    def add_input(
        self, *names: str, fits: Callable[[str], bool] | None = None, group: Any = None, **settings: Any
    ) -> None:
        """Declare an argument that names what the command reads: a file, a directory, or something else.

        Args:
            names: of `add_argument`.
            fits: as in `add_several`, for an option with one value or more.
            group: argparse's group to which it belongs.
            settings: of `add_argument`; the type is `str` for what may be no path, else `Path`.
        """
        settings["type"] = named if settings.get("type") is str else path_named
        if fits is not None:
            self.add_several(names[0], fits, **settings)
            self._inputs.append(names[0].strip("-").replace("-", "_"))
        else:
            self._inputs.append((group or self).add_argument(*names, **settings).dest)

    def add_output(
        self,
        *names: str,
        directory: bool | Callable[[Path], bool] = False,
        owned: Sequence[str] = (),
        ignored: Sequence[str] = (),
        unless: str = "",
        many: Sequence[str] = (),
        group: Any = None,
        **settings: Any,
    ) -> None:
        """Declare an argument that names a file or a directory that the command writes; the first adds `--overwrite`.

        Args:
            names: of `add_argument`.
            directory: whether it is a directory, or what tells that of its value.
            owned: of a directory, patterns of the names that are written there.
            ignored: of a directory, names whose loss is none.
            unless: name of an argument that, where it is given, makes this one no output.
            many: of a command that takes an archive, patterns of what is then written into the directory that this is.
            group: argparse's group to which it belongs.
            settings: of `add_argument`.
        """
        if not self._outputs:
            self.add_argument("--overwrite", action="store_true", help="replace outputs that exist")
        added = (group or self).add_argument(*names, type=path_named, **settings)
        is_directory = directory if callable(directory) else lambda path: bool(directory)
        self._outputs.append(OutputArgument(added.dest, is_directory, owned, ignored, unless, many))

    def check_files(self, options: argparse.Namespace) -> None:
        """Check what the command is about to read and write.

        Raises:
            RecordingError: an output that may not be written, see `check_outputs`.
        """
        places = [place for one in self._outputs if (place := one.place(options)) is not None]
        given = [getattr(options, name) for name in self._inputs]
        files = [one for value in given for one in (value if isinstance(value, list) else [value]) if one]
        check_outputs(places, map(Path, files), bool(self._outputs) and options.overwrite)

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


def named(text: str) -> str:
    """A word of the command line that names something.

    Raises:
        ArgumentTypeError: it is empty, as where a shell's variable is not set.
    """
    if not text:
        raise argparse.ArgumentTypeError("expected a name, found an empty word")
    return text


def path_named(text: str) -> Path:
    """The path that a word of the command line names.

    Raises:
        ArgumentTypeError: it is empty, which for `Path` is the working directory.
    """
    return Path(named(text))


def is_archive(options: argparse.Namespace) -> bool:
    """Whether the command is to work on many recordings, into a directory."""
    return getattr(options, "workers", None) is not None or getattr(options, "scheduler", None) is not None


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
