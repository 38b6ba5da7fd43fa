"""The recordings that folders, globs and single paths name, each with the name that its result is given."""

from __future__ import annotations

import glob
import os
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from lasso_motion_ros.core.errors import RecordingError


@dataclass(frozen=True)
class FoundRecording:
    """One recording of an archive.

    Attributes:
        path: MCAP file or bag directory, absolute.
        name: what its results are called, without suffix: its path below the folder that was named, or below the part
            of a glob that is no pattern; of a path named by itself the last part.
    """

    path: Path
    name: Path


def find_recordings(places: Sequence[Path], without: Sequence[Path] = ()) -> list[FoundRecording]:
    """The recordings of an archive, in the order of the places and by name within each.

    Of a folder all MCAP files and bag directories in it, at any depth; hidden ones are passed over. A bag directory is
    one recording: it has `metadata.yaml`, or its files are called as rosbag2 does, `NAME/NAME_0.mcap`.

    Args:
        places: folders, globs (`data/**/*.mcap`), MCAP files and bag directories.
        without: folders to pass over (where results go).

    Raises:
        RecordingError: a place with no recording, or two recordings whose results would have one name.
    """
    passed_over = {Path(os.path.realpath(one)) for one in without}
    found: dict[Path, FoundRecording] = {}
    for place in places:
        here = [
            FoundRecording(Path(os.path.abspath(path)), name)  # noqa: PTH100 - a link keeps its own name
            for path, name in _named(place, passed_over)
        ]
        if not here:
            raise RecordingError(f"{place}: expected recordings (.mcap files or bag directories), found none")
        for one in here:
            other = found.setdefault(one.name, one)
            if other.path != one.path:
                raise RecordingError(
                    f"{other.path} and {one.path}: both results would be called {one.name}; name the folder above both,"
                    " or quote the pattern"
                )
    return list(found.values())


def is_collection(path: Path) -> bool:
    """Whether a path is no recording but stands for several: a pattern, or a folder without an MCAP file of its own."""
    if path.is_dir():
        return not is_bag_directory(path) and not any(path.glob("*.mcap"))
    return not path.exists() and glob.has_magic(str(path))


def is_bag_directory(path: Path) -> bool:
    """Whether a folder is one recording, not a collection of some."""
    if not path.is_dir():
        return False
    if (path / "metadata.yaml").is_file():
        return True
    files = [file.name for file in path.glob("*.mcap")]
    return bool(files) and all(re.fullmatch(rf"{re.escape(path.name)}_\d+\.mcap", file) for file in files)


def _named(place: Path, passed_over: set[Path]) -> Iterator[tuple[Path, Path]]:
    """Recordings at a place, each with its name."""
    if place.is_file() or is_bag_directory(place):
        yield place, _without_suffix(Path(place.resolve().name if place.name in ("", "..") else place.name))
    elif place.is_dir():
        yield from ((path, _without_suffix(path.relative_to(place))) for path in _below(place, passed_over))
    elif glob.has_magic(str(place)):
        fixed = Path(*_fixed_parts(place))
        for match in sorted(glob.glob(str(place), recursive=True)):  # noqa: PTH207 - a path, absolute or not
            path = Path(match)
            inner = _below(path, passed_over) if path.is_dir() and not is_bag_directory(path) else [path]
            for one in inner:
                if one.suffix == ".mcap" or is_bag_directory(one):
                    yield one, _without_suffix(one.relative_to(fixed))
    else:
        raise RecordingError(f"{place}: there is no such recording")


def _below(folder: Path, passed_over: set[Path]) -> Iterator[Path]:
    """The recordings below a folder, by name."""
    if Path(os.path.realpath(folder)) in passed_over:
        return
    for path in sorted(folder.iterdir()):
        if path.name.startswith("."):
            continue
        if (path.is_file() and path.suffix == ".mcap") or is_bag_directory(path):
            yield path
        elif path.is_dir() and not path.is_symlink():
            yield from _below(path, passed_over)


def _fixed_parts(pattern: Path) -> Iterator[str]:
    for part in pattern.parts:
        if glob.has_magic(part):
            return
        yield part


def _without_suffix(path: Path) -> Path:
    return path.with_suffix("") if path.suffix == ".mcap" else path
