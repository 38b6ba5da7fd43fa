"""Which MCAP files a recording consists of: one, or those of a bag directory, with metadata or without."""

from __future__ import annotations

import re
import shlex
from pathlib import Path

from lasso_motion_ros.core.errors import ConfigurationError, RecordingError
from lasso_motion_ros.core.plain_yaml import read_plain_yaml

_DATABASE = b"SQLite format 3\0"
_ROS_1 = b"#ROSBAG V"


def recording_files(path: Path) -> list[Path]:
    """The MCAP files of a recording, in order.

    Raises:
        RecordingError: there is none, one that is listed is missing, or they are of another storage.
    """
    if path.is_file():
        _refuse_other_bags(path)
        return [path]
    if not path.is_dir():
        raise RecordingError(f"{path}: there is no such recording")
    listed = _listed_files(path)
    if not listed:
        listed = sorted(path.glob("*.mcap"), key=_natural_order)
    databases = sorted(path.glob("*.db3"))
    if not listed and databases:
        _refuse_other_bags(databases[0])
    if not listed:
        raise RecordingError(f"{path}: a directory without .mcap files is not a recording")
    for file in listed:
        if not file.is_file():
            raise RecordingError(f"{file} is missing, though metadata.yaml lists it")
    return listed


def _listed_files(directory: Path) -> list[Path]:
    """What `metadata.yaml` lists; nothing where it is missing or not readable (a recorder that crashed)."""
    metadata = directory / "metadata.yaml"
    if not metadata.is_file():
        return []
    try:
        information = read_plain_yaml(metadata)["rosbag2_bagfile_information"]
        storage, names = information["storage_identifier"], [str(name) for name in information["relative_file_paths"]]
        mode = str(information.get("compression_mode") or "").upper()
    except (ConfigurationError, KeyError, TypeError, AttributeError):
        return []
    if storage != "mcap":
        raise RecordingError(f"{directory}: a bag of storage {storage!r} is not read; {_conversion(directory)}")
    if mode not in ("", "NONE"):
        raise RecordingError(f"{directory}: rosbag2's own {mode} compression is not read; {_conversion(directory)}")
    return [directory / name for name in names]


def _refuse_other_bags(file: Path) -> None:
    """Raise a `RecordingError` with the cure for a file of rosbag2's database or of ROS 1."""
    try:
        with file.open("rb") as stream:
            begin = stream.read(len(_DATABASE))
    except OSError:
        return  # whoever reads it says so
    if begin.startswith(_ROS_1):
        raise RecordingError(f"{file} is a ROS 1 bag, which is not read; {_conversion(file)}")
    if begin == _DATABASE:
        directory = file.parent
        index = "" if (directory / "metadata.yaml").is_file() else f"ros2 bag reindex -s sqlite3 {_word(directory)}; "
        raise RecordingError(f"{file} is a db3 bag of rosbag2, which is not read; {_conversion(directory, index)}")


def _conversion(source: Path, before: str = "") -> str:
    """What to do with a bag of another kind, as a command to copy."""
    path = source.resolve() if source.name in ("", "..") else source
    target = path.with_name(f"{path.stem if path.is_file() else path.name}_mcap")
    types = "--dst-storage mcap --dst-typestore ros2_jazzy"
    return f"convert it: {before}rosbags-convert --src {_word(source)} --dst {_word(target)} {types}"


def _word(path: Path) -> str:
    return shlex.quote(str(path))


def _natural_order(path: Path) -> list[tuple[int, str]]:
    """Sorts `bag_10.mcap` behind `bag_9.mcap`."""
    return [(int(part), "") if part.isdigit() else (0, part) for part in re.split(r"(\d+)", path.name)]
