"""Poses in a CSV file, as any program can write them: one line a pair, columns by name."""

from __future__ import annotations

import csv
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from decimal import Decimal, InvalidOperation
from pathlib import Path

import numpy as np
import numpy.typing as npt

from lasso_motion_ros.core.bounded_files import read_bounded
from lasso_motion_ros.core.errors import RecordingError
from lasso_motion_ros.geometry.transforms import quaternion_from_rotation
from msg_adapters.poses import covariance_fault, transform_from

Array = npt.NDArray[np.float64]

POSE = ("x", "y", "z", "qx", "qy", "qz", "qw")
COVARIANCE = tuple(f"cov{number}" for number in range(36))
REQUIRED = ("stamp", *POSE)
OPTIONAL = (*COVARIANCE, "state", "latency_ms")
IDENTITY = "benchmark:"
"""Behind `#` in a line of its own: which benchmark the poses belong to."""

MAX_FILE_BYTES = 256 * 1024 * 1024

_LATEST_S = 1e11  # year 5138
_QUATERNION_LENGTHS = (0.99, 1.01)


@dataclass(frozen=True, eq=False)
class PoseRow:
    """One line.

    Attributes:
        stamp_ns: of plane A's image.
        transform: (4, 4) rigid, metres; None where the line tells of no pose.
        covariance: (6, 6) in ROS order (m, rad), or None.
        state: the tracker's own word, or empty.
        latency_ms: how long the answer took, or None.
        line: its number in the file it was read from, from 1.
    """

    stamp_ns: int
    transform: Array | None = None
    covariance: Array | None = None
    state: str = ""
    latency_ms: float | None = None
    line: int = 0


@dataclass(frozen=True, eq=False)
class PoseTable:
    """The lines of a file.

    Attributes:
        identity: which benchmark the file says that it belongs to, or empty.
        rows: in the order of the lines.
    """

    identity: str
    rows: tuple[PoseRow, ...]


def read_pose_table(path: Path) -> PoseTable:
    """Read a file of poses.

    Raises:
        RecordingError: it cannot be read, lacks a column or has one too many, or a value that is none; with the line.
    """
    try:
        lines = read_bounded(path, MAX_FILE_BYTES).decode("utf-8-sig").splitlines()
    except (OSError, UnicodeDecodeError) as error:
        raise RecordingError(f"{path}: not a table of poses: {error}") from error
    comments = [line.lstrip("# ").strip() for line in lines if line.startswith("#")]
    named = [one.removeprefix(IDENTITY).strip() for one in comments if one.startswith(IDENTITY)]
    # Comments stay as empty lines, so that the numbers of the lines are right.
    reader = csv.reader("" if line.startswith("#") else line for line in lines)
    try:
        numbered = [(reader.line_num, [cell.strip() for cell in cells]) for cells in reader if cells]
    except csv.Error as error:
        raise RecordingError(f"{path}: not a table of poses: {error}") from error
    if not numbered:
        raise RecordingError(f"{path}: empty: expected a first line with the columns' names: {','.join(REQUIRED)}")
    (_, names), *rest = numbered
    _check_columns(path, names)
    rows = tuple(_row(f"{path}: line {number}", number, names, cells) for number, cells in rest)
    lengths = [float(np.linalg.norm(row.transform[:3, 3])) for row in rows if row.transform is not None]
    if lengths and np.median(lengths) > 1.0:
        raise RecordingError(f"{path}: x, y, z: {np.median(lengths):.3g} m in the middle: looks like millimetres")
    return PoseTable(named[0] if named else "", rows)


def pose_table_lines(rows: Iterable[PoseRow], identity: str = "") -> Iterator[str]:
    """The lines of a file of poses.

    Args:
        rows: of poses.
        identity: which benchmark they belong to.
    """
    if identity:
        yield f"# {IDENTITY} {identity}"
    yield ",".join((*REQUIRED, *OPTIONAL))
    for row in rows:
        seconds, nanoseconds = divmod(row.stamp_ns, 1_000_000_000)
        pose: Sequence[float | str] = [""] * len(POSE)
        if row.transform is not None:
            pose = [*row.transform[:3, 3].tolist(), *quaternion_from_rotation(row.transform[:3, :3]).tolist()]
        covariance = [""] * len(COVARIANCE) if row.covariance is None else row.covariance.ravel().tolist()
        latency = "" if row.latency_ms is None else row.latency_ms
        yield ",".join(map(str, (f"{seconds}.{nanoseconds:09d}", *pose, *covariance, row.state, latency)))


def _check_columns(path: Path, names: Sequence[str]) -> None:
    missing = [name for name in REQUIRED if name not in names]
    if missing:
        raise RecordingError(f"{path}: no column {', '.join(missing)}: expected {','.join(REQUIRED)}")
    unknown = [name for name in names if name not in (*REQUIRED, *OPTIONAL)]
    if unknown:
        raise RecordingError(f"{path}: column {unknown[0]!r} is not known: expected {','.join(REQUIRED)} and, if need"
                             " be, cov0 to cov35, state, latency_ms")  # fmt: skip
    twice = [name for number, name in enumerate(names) if name in names[:number]]
    if twice:
        raise RecordingError(f"{path}: column {twice[0]!r} is there twice")
    covariance = [name for name in COVARIANCE if name in names]
    if covariance and len(covariance) != len(COVARIANCE):
        raise RecordingError(f"{path}: {len(covariance)} of the columns cov0 to cov35: expected all 36, or none")


def _row(where: str, line: int, names: Sequence[str], cells: Sequence[str]) -> PoseRow:
    if len(cells) != len(names):
        raise RecordingError(f"{where}: {len(cells)} values for {len(names)} columns")
    values = dict(zip(names, cells, strict=True))
    pose, covariance = _numbers(where, values, POSE), _numbers(where, values, COVARIANCE)
    if covariance is not None and (fault := covariance_fault(covariance.reshape(6, 6))):
        raise RecordingError(f"{where}: cov0 to cov35: {fault}")
    latency = _numbers(where, values, ("latency_ms",))
    if latency is not None and latency[0] < 0.0:
        raise RecordingError(f"{where}: latency_ms: expected none below zero, found {latency[0]:g}")
    return PoseRow(
        _stamp_ns(where, values["stamp"]),
        None if pose is None else _transform(where, pose),
        None if covariance is None or pose is None else covariance.reshape(6, 6),
        values.get("state", ""),
        None if latency is None else float(latency[0]),
        line,
    )


def _numbers(where: str, values: Mapping[str, str], names: Sequence[str]) -> Array | None:
    """The numbers in some columns; None where all of them are empty, or not there."""
    texts = {name: values[name] for name in names if values.get(name)}
    if not texts:
        return None
    missing = [name for name in names if name not in texts]
    if missing:
        raise RecordingError(f"{where}: {missing[0]} is empty though {next(iter(texts))} is not")
    found = []
    for name, text in texts.items():
        try:
            value = float(text)
        except ValueError:
            value = float("nan")
        if not np.isfinite(value):
            raise RecordingError(f"{where}: {name}: expected a finite number, found {text!r}")
        found.append(value)
    return np.array(found)


def _stamp_ns(where: str, text: str) -> int:
    try:
        seconds = Decimal(text)
    except InvalidOperation:
        seconds = Decimal("nan")
    if not seconds.is_finite() or seconds < 0:
        raise RecordingError(f"{where}: stamp: expected seconds since 1970, found {text!r}")
    if seconds > _LATEST_S:
        raise RecordingError(f"{where}: stamp: {text} looks like nanoseconds; expected seconds since 1970")
    return int((seconds * 1_000_000_000).to_integral_value())


def _transform(where: str, pose: Array) -> Array:
    shortest, longest = _QUATERNION_LENGTHS
    length = float(np.linalg.norm(pose[3:]))
    if not shortest <= length <= longest:
        raise RecordingError(f"{where}: qx, qy, qz, qw: expected a quaternion of length 1, found {length:g}")
    return transform_from(pose[:3], pose[3:])
