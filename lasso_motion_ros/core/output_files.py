"""Text, JSON and directories that a command leaves behind; what cannot be written is one plain error."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from lasso_motion_ros.core.errors import RecordingError


def write_text(path: Path, text: str) -> None:
    """Write a text file, overwriting.

    Raises:
        RecordingError: the file cannot be written.
    """
    try:
        path.write_text(text, encoding="utf-8")
    except OSError as error:
        raise RecordingError(f"{path}: cannot be written: {error.strerror}") from error


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
