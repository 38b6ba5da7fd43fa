"""One field of a scenario: default, meaning, unit and range, which validation and documentation read."""

from __future__ import annotations

from dataclasses import field
from typing import Any

Vector = tuple[float, ...]


def setting(
    default: Any,
    description: str,
    *,
    unit: str = "",
    minimum: float | None = None,
    maximum: float | None = None,
    choices: tuple[Any, ...] = (),
) -> Any:
    """A dataclass field of a scenario; the metadata is what validation and documentation use."""
    metadata = {"description": description, "unit": unit, "minimum": minimum, "maximum": maximum, "choices": choices}
    return field(default=default, metadata=metadata)
