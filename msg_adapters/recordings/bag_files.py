"""Which MCAP files a recording consists of: one, or those of a bag directory, with metadata or without."""

from __future__ import annotations

import re
from pathlib import Path

from lasso_motion_ros.core.errors import ConfigurationError, RecordingError
from lasso_motion_ros.core.plain_yaml import read_plain_yaml


def recording_files(path: Path) -> list[Path]:
    """The MCAP files of a recording, in order.

    Raises:
        RecordingError: there is none, one that is listed is missing, or they are of another storage.
    """
    if path.is_file():
        return [path]
    if not path.is_dir():
        raise RecordingError(f"{path}: there is no such recording")
    listed = _listed_files(path)
    if not listed:
        listed = sorted(path.glob("*.mcap"), key=_natural_order)
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
        raise RecordingError(f"{directory}: storage {storage!r} is not read; convert it with: ros2 bag convert")
    if mode not in ("", "NONE"):
        raise RecordingError(f"{directory}: rosbag2's own {mode} compression is not read; convert it: ros2 bag convert")
    return [directory / name for name in names]


def _natural_order(path: Path) -> list[tuple[int, str]]:
    """Sorts `bag_10.mcap` behind `bag_9.mcap`."""
    return [(int(part), "") if part.isdigit() else (0, part) for part in re.split(r"(\d+)", path.name)]
