"""The catalogue of catheters, `config/catheters.yaml`: poles, distances and size as makers and papers state them."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

from lasso_motion_ros.core.errors import ConfigurationError
from lasso_motion_ros.core.plain_yaml import read_plain_yaml
from lasso_motion_ros.core.share import share_file
from lasso_motion_ros.core.suggestions import did_you_mean

AUTO = "auto"
KINDS = ("circular", "inner_lumen", "pulsed_field")
EDGE_TO_EDGE, CENTRE_TO_CENTRE, UNSTATED = MEASURES = ("edge_to_edge", "centre_to_centre", "unstated")
REQUIRED = ("title", "kind", "poles", "source")
OPTIONAL = ("spacing_mm", "spacing_is", "diameter_mm", "electrode_length_mm", "electrode_width_mm", "unverified")


@dataclass(frozen=True)
class Catheter:
    """One entry of the catalogue; what nobody verified is None.

    Attributes:
        name: as the parameter `catheter` takes it.
        title: as people call it.
        kind: circular, inner_lumen or pulsed_field.
        poles: electrodes on the loop.
        spacing_mm: the distances between neighbouring electrodes, the pattern that repeats; one where they are even.
        spacing_is: whether those are from edge to edge or from centre to centre, or the source does not say.
        diameter_mm: smallest and largest of the loop.
        electrode_length_mm: of a ring electrode, along the loop.
        electrode_width_mm: its outer diameter.
        source: where that is stated.
    """

    name: str
    title: str
    kind: str
    poles: int
    source: str
    spacing_mm: tuple[float, ...] | None = None
    spacing_is: str = UNSTATED
    diameter_mm: tuple[float, float] | None = None
    electrode_length_mm: float | None = None
    electrode_width_mm: float | None = None
    unverified: str = ""

    @property
    def share(self) -> float:
        """From the first to the second electrode of a pair, centre to centre, as a share of the pattern; 0 if even."""
        if self.spacing_mm is None or len(self.spacing_mm) < 2:
            return 0.0
        added = (self.electrode_length_mm or 0.0) if self.spacing_is == EDGE_TO_EDGE else 0.0
        return (self.spacing_mm[0] + added) / (sum(self.spacing_mm) + added * len(self.spacing_mm))

    @property
    def unit_mm(self) -> tuple[float, float] | None:
        """Shortest and longest that the repeating pattern may be from centre to centre; None without distances."""
        if self.spacing_mm is None:
            return None
        low = high = sum(self.spacing_mm)
        length = len(self.spacing_mm) * (self.electrode_length_mm or UNKNOWN_LENGTH_MM)
        if self.spacing_is != CENTRE_TO_CENTRE:
            high += length
        if self.spacing_is == EDGE_TO_EDGE and self.electrode_length_mm:
            low = high
        return low, high


UNKNOWN_LENGTH_MM = 1.5  # of an electrode at most, where nobody says: what edge to edge may add to a distance


def catalogue(path: Path | None = None) -> dict[str, Catheter]:
    """The entries by name.

    Args:
        path: of another file than the package's own.

    Raises:
        ConfigurationError: an unreadable file, or an entry that lacks a field, has an unknown one, or a value that no
            catheter has; the text names file, entry and field.
    """
    return _own() if path is None else _read(path)


def named(name: str) -> Catheter | None:
    """The entry of a name; None for `auto`.

    Raises:
        ConfigurationError: there is no such entry; the text lists those that there are.
    """
    if name == AUTO:
        return None
    entries = catalogue()
    if name not in entries:
        hint = did_you_mean(name, entries)
        raise ConfigurationError(
            f"catheter must be {AUTO} or a name of config/catheters.yaml ({', '.join(entries)}), found {name!r}"
            + (f"; {hint}" if hint else "")
        )
    return entries[name]


@cache
def _own() -> dict[str, Catheter]:
    return _read(share_file("config/catheters.yaml"))


def _read(path: Path) -> dict[str, Catheter]:
    document = read_plain_yaml(path)
    entries = document.get("catheters") if isinstance(document, dict) else None
    if not isinstance(entries, dict) or not entries:
        raise ConfigurationError(f"{path}: expected a mapping 'catheters' of names to entries")
    try:
        return {str(name): _entry(str(name), fields) for name, fields in entries.items()}
    except ConfigurationError as error:
        raise ConfigurationError(f"{path}: {error}") from error


def _entry(name: str, fields: Any) -> Catheter:
    if name == AUTO:
        raise ConfigurationError(f"{name}: the name means that none is named")
    if not isinstance(fields, dict):
        raise ConfigurationError(f"{name}: expected fields, found {fields!r}")
    for field in fields:
        if field not in (*REQUIRED, *OPTIONAL):
            hint = did_you_mean(str(field), (*REQUIRED, *OPTIONAL))
            raise ConfigurationError(f"{name}: unknown field {field!r}" + (f"; {hint}" if hint else ""))
    for field in REQUIRED:
        if field not in fields:
            raise ConfigurationError(f"{name}: {field} is missing")
    diameter = _numbers(name, fields, "diameter_mm", 5.0, 60.0, most=2)
    if diameter and diameter[0] > diameter[-1]:
        raise ConfigurationError(
            f"{name}: diameter_mm must go from the smallest to the largest, found {list(diameter)}"
        )
    length = _numbers(name, fields, "electrode_length_mm", 0.2, 10.0, most=1)
    width = _numbers(name, fields, "electrode_width_mm", 0.2, 5.0, most=1)
    return Catheter(
        name=name,
        title=_text(name, fields, "title"),
        kind=_choice(name, fields, "kind", KINDS),
        poles=_poles(name, fields["poles"]),
        source=_text(name, fields, "source"),
        spacing_mm=_numbers(name, fields, "spacing_mm", 0.5, 30.0, most=2),
        spacing_is=_choice(name, {"spacing_is": UNSTATED} | fields, "spacing_is", MEASURES),
        diameter_mm=(diameter[0], diameter[-1]) if diameter else None,
        electrode_length_mm=length[0] if length else None,
        electrode_width_mm=width[0] if width else None,
        unverified=_text(name, fields, "unverified") if "unverified" in fields else "",
    )


def _text(name: str, fields: Mapping[str, Any], field: str) -> str:
    if not isinstance(fields[field], str) or not fields[field].strip():
        raise ConfigurationError(f"{name}: {field} must be a text, found {fields[field]!r}")
    return str(fields[field]).strip()


def _choice(name: str, fields: Mapping[str, Any], field: str, choices: tuple[str, ...]) -> str:
    if fields[field] not in choices:
        raise ConfigurationError(f"{name}: {field} must be one of {', '.join(choices)}, found {fields[field]!r}")
    return str(fields[field])


def _poles(name: str, value: Any) -> int:
    if type(value) is not int or not 2 <= value <= 64:
        raise ConfigurationError(f"{name}: poles must be a whole number from 2 to 64, found {value!r}")
    return value


def _numbers(
    name: str, fields: Mapping[str, Any], field: str, low: float, high: float, *, most: int
) -> tuple[float, ...] | None:
    """One number, or a list of at most so many; None where the field is not there."""
    if field not in fields:
        return None
    value = fields[field]
    values = value if isinstance(value, list) else [value]
    good = [type(v) in (int, float) and math.isfinite(v) and low <= v <= high for v in values]
    if not (1 <= len(values) <= most and all(good)):
        words = "a number" if most == 1 else f"a number or a list of up to {most}"
        raise ConfigurationError(f"{name}: {field} must be {words} from {low:g} to {high:g} (mm), found {value!r}")
    return tuple(float(v) for v in values)
