"""The table of an archive: one row a recording, kept as a file each beside the results, and all of them as CSV."""

from __future__ import annotations

import csv
import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field, fields
from pathlib import Path

from lasso_motion_ros.core.errors import RecordingError
from lasso_motion_ros.core.output_files import make_directory, whole_file, write_json

Figure = int | float | str | None
DONE, FAILED = "done", "failed"
TABLE = "archive.csv"
ROWS = "rows"
"""Folder of the rows' files in that of the results."""


@dataclass(frozen=True)
class ArchiveRow:
    """What became of one recording.

    Attributes:
        recording: its path, or the paths of what it is made of.
        result: the result, relative to the folder of all results.
        status: `done` or `failed`.
        reason: why it failed; of a done one what is to be known, such as a recording that is cut short.
        seconds: wall time it took.
        processor_s: processor time it took: other programs on the machine do not count.
        peak_memory_mb: largest memory of its process until then, megabytes.
        host: on which machine.
        key: hash of input, configuration and version.
        digest: of the result; empty where there is none.
        figures: what the command tells of it, by column.
    """

    recording: str
    result: str
    status: str
    reason: str = ""
    seconds: float = 0.0
    processor_s: float = 0.0
    peak_memory_mb: float = 0.0
    host: str = ""
    key: str = ""
    digest: str = ""
    figures: Mapping[str, Figure] = field(default_factory=dict)

    def cells(self) -> dict[str, Figure]:
        """Its cells by column, the figures' last."""
        return {entry.name: getattr(self, entry.name) for entry in fields(self)[:-1]} | dict(self.figures)


def row_file(folder: Path, result: str) -> Path:
    """Where a result's row is kept."""
    return folder / ROWS / f"{result}.json"


def write_row(path: Path, row: ArchiveRow) -> None:
    """Write one row.

    Raises:
        RecordingError: it cannot be written.
    """
    make_directory(path.parent)
    write_json(path, asdict(row))


def read_row(path: Path) -> ArchiveRow | None:
    """A row that was written, or None where there is none that can be read."""
    try:
        return ArchiveRow(**json.loads(path.read_text(encoding="utf-8")))
    except (OSError, ValueError, TypeError):
        return None


def read_rows(folder: Path) -> list[ArchiveRow]:
    """All rows of an archive, by the names of their results; empty where the folder is none."""
    found = (read_row(path) for path in sorted((folder / ROWS).rglob("*.json")))
    return sorted((row for row in found if row is not None), key=lambda row: row.result)


def write_table(path: Path, rows: Sequence[Mapping[str, Figure]]) -> None:
    """Write a table as CSV (RFC 4180, UTF-8); a column for each name that any row has.

    Raises:
        RecordingError: it cannot be written.
    """
    columns = list(dict.fromkeys(name for row in rows for name in row))
    with whole_file(path) as unfinished, unfinished.open("w", encoding="utf-8", newline="") as file:
        writer = csv.DictWriter(file, columns, restval="")
        writer.writeheader()
        writer.writerows(rows)


def needed_rows(folder: Path) -> list[ArchiveRow]:
    """The rows of a folder that must be an archive's.

    Raises:
        RecordingError: it is none.
    """
    rows = read_rows(folder)
    if not rows:
        raise RecordingError(f"{folder}: expected the results of an archive, with {ROWS}/, found no row there")
    return rows
