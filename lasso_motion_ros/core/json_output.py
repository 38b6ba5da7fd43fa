"""Figures as JSON, for every command that computes some."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from lasso_motion_ros.core.errors import RecordingError


def write_json(path: Path, values: Any) -> None:
    """Write JSON values, overwriting.

    Raises:
        RecordingError: the file cannot be written.
    """
    try:
        path.write_text(json.dumps(values, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")
    except OSError as error:
        raise RecordingError(f"{path}: cannot be written: {error.strerror}") from error
