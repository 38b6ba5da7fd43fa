"""What a command leaves behind: whole or not at all; what cannot be written is one plain error.

Everything is written under another name and moved into place at the end. After an error, a full disk or Ctrl-C
nothing new is there, and what was to be replaced is as it was.
"""

from __future__ import annotations

import json
import os
import shutil
import weakref
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from fnmatch import fnmatchcase
from glob import escape
from pathlib import Path
from typing import Any

from lasso_motion_ros.core.errors import LassoMotionError, RecordingError

STAGED = ".files.*.unfinished"
"""Where the files of a directory are written, within it, until all of them are moved into place."""


class UnfinishedFile:
    """A file that is being written; if it is neither finished nor discarded it goes when nobody refers to it any more.

    Args:
        path: where it is to be in the end. A link is followed, and a device or a pipe is written directly.

    Attributes:
        path: where to write it. The name is the process's own: two commands with one output do not write into one
            file.
    """

    def __init__(self, path: Path) -> None:
        self._final = path
        self._place = None if is_device(path) else Path(os.path.realpath(path))
        self.path = path if self._place is None else _unfinished(self._place)
        if self._place is not None:
            _remove_abandoned(self._place)
        # An interrupt may come before whoever writes it could see to it.
        self._removal = weakref.finalize(self, _remove, self.path, os.getpid()) if self._place is not None else None

    def finish(self) -> None:
        """Put it where it belongs, with the access rights of a file that it replaces.

        Raises:
            RecordingError: it cannot be moved there; it is thrown away then.
        """
        if self._place is None or self._removal is None:
            return
        try:
            with self.path.open("rb") as file:
                os.fsync(file.fileno())
            if self._place.exists():
                shutil.copymode(self._place, self.path)
            self.path.replace(self._place)
            self._removal.detach()
        except OSError as error:
            self.discard()
            raise cannot_write(self._final, error) from error

    def discard(self) -> None:
        """Throw away what has been written."""
        if self._removal is not None:
            self._removal()


class EarlierFile:
    """A file that stands where one is to be written that must be there from its first byte on, as a recording must.

    It is out of the way meanwhile, under a hidden name beside its own, and comes back unless the new one is worth more.

    Args:
        path: where the new one goes; nothing need be there.

    Raises:
        RecordingError: it cannot be moved.
    """

    def __init__(self, path: Path) -> None:
        self._place = Path(os.path.realpath(path))
        self._aside: Path | None = None
        if self._place.is_file():
            self._aside = self._place.with_name(f".{self._place.name}.{os.getpid()}.earlier")
            try:
                self._place.replace(self._aside)
            except OSError as error:
                raise cannot_write(path, error) from error

    def bring_back(self) -> None:
        """Put it back in the new one's place; where nothing was there, nothing is there again."""
        with suppress(OSError):
            if self._aside is not None:
                self._aside.replace(self._place)
            elif self._place.is_file():
                self._place.unlink()

    def drop(self) -> None:
        """Delete it: the new one has taken its place."""
        if self._aside is not None:
            with suppress(OSError):
                self._aside.unlink()

    def keep(self) -> Path | None:
        """Keep it beside the new one; returns where, or None where there was none."""
        if self._aside is None:
            return None
        kept = self._place.with_name(f"{self._place.stem}.earlier{self._place.suffix}")
        if kept.exists():  # kept by a run before this one
            return self._aside
        with suppress(OSError):
            return self._aside.replace(kept)
        return self._aside


@contextmanager
def whole_file(path: Path) -> Iterator[Path]:
    """Write a file, overwriting, whole or not at all.

    Yields:
        Where to write it.

    Raises:
        RecordingError: it cannot be written (an OSError of the block counts as that).
    """
    unfinished = UnfinishedFile(path)
    try:
        yield unfinished.path
    except OSError as error:
        unfinished.discard()
        raise cannot_write(path, error) from error
    except BaseException:
        unfinished.discard()
        raise
    unfinished.finish()


@contextmanager
def whole_directory(path: Path, owned: Sequence[str] = ()) -> Iterator[Path]:
    """Write the files of a directory, all or none; a folder among them takes the place of one of its name.

    Args:
        path: the directory; made if need be, and taken away again after an error.
        owned: patterns of file names (`plane_a_*.png`). What an earlier run has left under such a name is removed;
            other files in the directory stay.

    Yields:
        An empty directory to write the files into.

    Raises:
        RecordingError: it cannot be written (an OSError of the block counts as that).
    """
    made: list[Path] = []
    staged = _unfinished(path / "files")
    _remove_abandoned(path / "files")
    try:
        made = [parent for parent in (path, *path.parents) if not parent.exists()]
        make_directory(path)
        shutil.rmtree(staged, ignore_errors=True)
        staged.mkdir()
        yield staged
        _move_all(staged, path, owned)
    except BaseException as error:
        shutil.rmtree(staged, ignore_errors=True)
        with suppress(OSError):  # refused where something is in it, as it should be
            for directory in made:
                directory.rmdir()
        if isinstance(error, OSError):
            raise cannot_write(path, error) from error
        if isinstance(error, LassoMotionError):  # named where it would have been
            raise type(error)(str(error).replace(str(staged), str(path))) from error
        raise


def write_text(path: Path, text: str) -> None:
    """Write a text file, overwriting.

    Raises:
        RecordingError: the file cannot be written.
    """
    with whole_file(path) as unfinished:
        unfinished.write_text(text, encoding="utf-8")


def write_json(path: Path, values: Any) -> None:
    """Write JSON values, overwriting.

    Raises:
        RecordingError: the file cannot be written.
    """
    write_text(path, json.dumps(values, indent=1, ensure_ascii=False) + "\n")


def make_directory(path: Path) -> None:
    """Make a directory, and those above it, where there is none.

    Raises:
        RecordingError: it cannot be made.
    """
    try:
        path.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise RecordingError(f"{path}: cannot be made: {error.strerror}") from error


def cannot_write(path: Path, error: OSError) -> RecordingError:
    """The error of a file that cannot be written."""
    return RecordingError(f"{path} cannot be written: {error.strerror or error}")


def is_device(path: Path) -> bool:
    """Whether a path names something that is written as it goes and cannot be replaced (/dev/stdout, a pipe)."""
    return path.exists() and not path.is_file() and not path.is_dir()


def _remove_abandoned(place: Path) -> None:
    """Take away what processes that were killed had begun to write in a place's stead."""
    for staged in place.parent.glob(f".{escape(place.name)}.*.unfinished"):
        try:
            os.kill(int(staged.name.split(".")[-2]), 0)
        except ProcessLookupError:
            if staged.is_dir():
                shutil.rmtree(staged, ignore_errors=True)
            else:
                with suppress(OSError):
                    staged.unlink()
        except (OSError, ValueError, OverflowError):
            continue


def _unfinished(place: Path) -> Path:
    return place.with_name(f".{place.name}.{os.getpid()}.unfinished")


def _remove(path: Path, owner: int) -> None:
    if os.getpid() == owner:  # not in a process that was forked meanwhile
        with suppress(OSError):
            path.unlink(missing_ok=True)


def _move_all(staged: Path, path: Path, owned: Sequence[str]) -> None:
    """Move files into a directory, all or none: what they replace, and what is owned, is out of the way meanwhile."""
    files = sorted(staged.iterdir())
    new = {file.name for file in files}
    folders = {file.name for file in files if file.is_dir()}
    earlier = [
        old
        for old in path.iterdir()
        if (old.is_file() and (old.name in new or any(fnmatchcase(old.name, pattern) for pattern in owned)))
        or (old.is_dir() and old.name in folders)
    ]
    aside = _unfinished(path / "earlier")
    moved: list[tuple[Path, Path]] = []
    try:
        aside.mkdir(exist_ok=True)
        for file, place in ((old, aside / old.name) for old in earlier):
            file.replace(place)
            moved.append((file, place))
        for file in files:
            file.replace(path / file.name)
            moved.append((file, path / file.name))
    except BaseException:
        for file, place in reversed(moved):
            with suppress(OSError):
                place.replace(file)
        with suppress(OSError):
            aside.rmdir()
        raise
    shutil.rmtree(aside, ignore_errors=True)
    staged.rmdir()
