"""Whether a command's outputs may be written, asked before its work: nothing is lost, nothing read is replaced."""

from __future__ import annotations

import os
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from fnmatch import fnmatchcase
from itertools import combinations
from pathlib import Path

from lasso_motion_ros.core.errors import RecordingError
from lasso_motion_ros.core.output_files import STAGED, cannot_write, is_device

FileId = tuple[int, int]


@dataclass(frozen=True)
class OutputPlace:
    """Where a command is to write.

    Attributes:
        path: the file or the directory.
        is_directory: which of the two.
        owned: of a directory, patterns of the names that are written there.
        ignored: of a directory, names whose loss is none (logs).
        resumed: of a directory, whether what is there is gone on with: whoever writes looks at each file itself.
    """

    path: Path
    is_directory: bool = False
    owned: Sequence[str] = ()
    ignored: Sequence[str] = ()
    resumed: bool = False

    def replaced_files(self) -> list[Path]:
        """The files that are there now and would be replaced."""
        if not self.is_directory:
            return [self.path]
        return [file for file in _files(self.path) if self.owns(file.name)]

    def owns(self, name: str) -> bool:
        """Whether a name in the directory is one that is written."""
        return any(fnmatchcase(name, pattern) for pattern in self.owned)


def check_outputs(outputs: Sequence[OutputPlace], inputs: Iterable[Path], overwrite: bool) -> None:
    """Check that all outputs of a command may be written.

    Args:
        outputs: all of them.
        inputs: what the command reads: files, and directories whose files it reads. What is not there is left out.
        overwrite: whether outputs that exist are replaced.

    Raises:
        RecordingError: an output exists and is not to be replaced, is an input (by whatever path, link or hard link)
            or another output, or is in a place that cannot be written to.
    """
    read = _identities(file for given in inputs for file in (_files(given) if os.path.isdir(given) else [given]))  # noqa: PTH112 - a matrix is no path, and too long for one
    for output in outputs:
        try:
            _check_kind(output)
            for path in output.replaced_files():
                if (known := _identity(path)) is not None and known in read and not is_device(path):
                    raise RecordingError(f"{path} is an input, and no input is overwritten: choose another name")
            check_free(output.path, overwrite or output.resumed, output.ignored)
            _check_place(output, outputs)
        except OSError as error:
            raise cannot_write(output.path, error) from error
    for one, other in combinations(outputs, 2):
        if _is_within(one, other) or _is_within(other, one):
            raise RecordingError(f"{one.path} and {other.path} would be one file: choose another name")


def check_free(path: Path, overwrite: bool, ignored: Sequence[str] = ()) -> None:
    """Check that an output file or directory does not exist, is empty, or may be replaced.

    Raises:
        RecordingError: it exists, and is not to be overwritten.
    """
    if overwrite or not path.exists() or is_device(path):
        return
    if path.is_dir() and all(one.name in ignored or fnmatchcase(one.name, STAGED) for one in path.iterdir()):
        return
    raise RecordingError(f"{path} exists: choose another name or add --overwrite")


def _check_kind(output: OutputPlace) -> None:
    path = output.path
    if output.is_directory and path.exists() and not path.is_dir():
        raise RecordingError(f"{path} exists and is a file: expected the name of a directory to write into")
    if not output.is_directory and path.is_dir():
        raise RecordingError(f"{path} is a directory: expected the name of a file to write")


def _check_place(output: OutputPlace, outputs: Sequence[OutputPlace]) -> None:
    """Whether a new file can be put there."""
    path = output.path
    if is_device(path):
        return
    if path.exists() and not os.access(path, os.W_OK):
        raise RecordingError(f"{path} cannot be written: it is protected against writing")
    if output.is_directory:
        parent = next(one for one in (_real(path), *_real(path).parents) if one.exists())
    else:
        parent = _real(path).parent
        if any(other.is_directory and _real(other.path) == parent for other in outputs):
            return  # it is made, where need be
    if not parent.exists():
        raise RecordingError(f"{path} cannot be written: there is no directory {parent}")
    if not parent.is_dir():
        raise RecordingError(f"{path} cannot be written: {parent} is no directory")
    if not os.access(parent, os.W_OK | os.X_OK):
        raise RecordingError(f"{path} cannot be written: {parent} is protected against writing")


def _is_within(one: OutputPlace, other: OutputPlace) -> bool:
    """Whether two outputs are one, or the first is a file that the second, a directory, writes itself."""
    place = _real(one.path)
    same = place == _real(other.path) or (_identity(place) is not None and _identity(place) == _identity(other.path))
    if same:
        return not is_device(place)
    return other.is_directory and place.parent == _real(other.path) and other.owns(place.name)


def _identities(paths: Iterable[Path]) -> set[FileId]:
    return {known for path in paths if (known := _identity(path)) is not None}


def _identity(path: Path) -> FileId | None:
    """What two names of one file have in common; None where there is no such file."""
    try:
        status = path.stat()
    except OSError:
        return None
    return status.st_dev, status.st_ino


def _files(directory: Path) -> list[Path]:
    return [file for file in directory.iterdir() if file.is_file()] if directory.is_dir() else []


def _real(path: Path) -> Path:
    return Path(os.path.realpath(path))
