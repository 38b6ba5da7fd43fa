"""Phantom scenarios in YAML: found, read, and checked strictly against the table of settings.

A scenario is a mapping of the groups in `settings.py`; what is not named keeps its default; `events` is a list.
"""

from __future__ import annotations

import dataclasses
import math
from pathlib import Path
from typing import Any, TypeVar, get_type_hints

from lasso_motion_ros.core.errors import ConfigurationError, ScenarioError
from lasso_motion_ros.core.plain_yaml import read_plain_yaml
from lasso_motion_ros.core.share import share_directory
from lasso_motion_ros.core.suggestions import did_you_mean
from lasso_motion_ros.phantom.lab_settings import Incident
from lasso_motion_ros.phantom.settings import Event, Scenario

Group = TypeVar("Group")

# Lists in a scenario: what they hold, and the keys that every entry must name.
LISTED: dict[str, tuple[type[Event] | type[Incident], tuple[str, ...]]] = {
    "events": (Event, ("kind", "first")),
    "incidents": (Incident, ("kind", "start_s")),
}


def scenario_directory() -> Path:
    """Where the scenarios that come with the package lie, in a checkout and in an installation."""
    return share_directory() / "bags"


def available_scenarios() -> dict[str, Path]:
    """The scenarios that come with the package: name to file, in order of name."""
    return {path.stem: path for path in sorted(scenario_directory().glob("*.yaml"))}


def load_scenario(name_or_path: str | Path) -> Scenario:
    """Read a scenario that comes with the package, by its name, or any scenario file.

    Raises:
        ScenarioError: no such scenario, unreadable YAML, an unknown key, a wrong type or a value out of range; the
            text names file, key and what was expected.
    """
    known = available_scenarios()
    path = known.get(str(name_or_path), Path(name_or_path))
    if not path.is_file():
        raise ScenarioError(
            f"{name_or_path}: no such file, nor one of the scenarios {', '.join(known) or '(none found)'}"
        )
    try:
        document = read_plain_yaml(path)
    except ConfigurationError as error:
        raise ScenarioError(str(error)) from error
    try:
        scenario = scenario_from_values({} if document is None else document)
    except ScenarioError as error:
        raise ScenarioError(f"{path}: {error}") from error
    return scenario if scenario.name != "unnamed" else dataclasses.replace(scenario, name=path.stem)


def scenario_from_values(values: Any) -> Scenario:
    """A scenario from nested plain values, as YAML gives them.

    Raises:
        ScenarioError: an unknown key, a wrong type, a value out of range, or settings that contradict each other.
    """
    scenario = _group(Scenario, values, "")
    for key, vector in (
        ("lasso.normal", scenario.lasso.normal),
        ("lasso.seat_direction", scenario.lasso.seat_direction),
        ("breathing.direction", scenario.breathing.direction),
        ("breathing.rotation_axis", scenario.breathing.rotation_axis),
        ("heart.direction", scenario.heart.direction),
    ):
        if not any(vector):
            raise ScenarioError(f"{key}: expected a vector that is not zero")
    geometry = scenario.geometry
    if geometry.source_object_mm >= geometry.source_detector_mm:
        raise ScenarioError("geometry.source_object_mm: expected less than geometry.source_detector_mm")
    collimator = scenario.imaging.collimator
    if collimator[0] + collimator[2] > 0.8 or collimator[1] + collimator[3] > 0.8:
        raise ScenarioError("imaging.collimator: expected at least a fifth of the field to be open")
    if scenario.clicks.most < scenario.clicks.fewest:
        raise ScenarioError(f"clicks.most: expected at least clicks.fewest ({scenario.clicks.fewest})")
    for index, event in enumerate(scenario.events):
        if event.last and event.last < event.first:
            raise ScenarioError(f"events[{index}].last: expected at least first ({event.first}), found {event.last}")
        if event.first >= scenario.pairs:
            raise ScenarioError(
                f"events[{index}].first: expected less than pairs ({scenario.pairs}), found {event.first}"
            )
    if scenario.ablation_work.farthest_mm < scenario.ablation_work.nearest_mm:
        raise ScenarioError("ablation_work.farthest_mm: expected at least ablation_work.nearest_mm")
    for index, incident in enumerate(scenario.incidents):
        if incident.kind == "shift" and not any(incident.direction):
            raise ScenarioError(f"incidents[{index}].direction: expected a vector that is not zero")
    return scenario


def _group(kind: type[Group], values: Any, prefix: str, base: Group | None = None) -> Group:
    """One dataclass from a mapping; `base` holds the defaults where they are not the class's own."""
    if not isinstance(values, dict):
        raise ScenarioError(f"{prefix.rstrip('.') or 'scenario'}: expected a mapping of settings, found {values!r}")
    defaults: Any = base if base is not None else kind()
    hints = get_type_hints(kind)
    entries = {entry.name: entry for entry in dataclasses.fields(defaults)}
    arguments: dict[str, Any] = {}
    for key, value in values.items():
        if key not in entries:
            hint = did_you_mean(str(key), entries) or f"expected one of {', '.join(entries)}"
            raise ScenarioError(f"{prefix}{key}: unknown key; {hint}")
        default = getattr(defaults, key)
        name = f"{prefix}{key}"
        if dataclasses.is_dataclass(default):
            arguments[key] = _group(hints[key], value, f"{name}.", default)
        elif key in LISTED:
            if not isinstance(value, list):
                raise ScenarioError(f"{name}: expected a list of {key}, found {value!r}")
            arguments[key] = tuple(_listed(key, entry, f"{name}[{index}].") for index, entry in enumerate(value))
        else:
            arguments[key] = _checked(name, value, default, entries[key].metadata)
    replaced: Group = dataclasses.replace(defaults, **arguments)
    return replaced


def _listed(key: str, values: Any, prefix: str) -> Event | Incident:
    """One entry of a list, with the keys that every one must have."""
    kind, required = LISTED[key]
    entry = _group(kind, values, prefix)
    for name in required:
        if name not in values:
            raise ScenarioError(f"{prefix}{name}: expected in every {key.removesuffix('s')}, found none")
    return entry


def _checked(name: str, value: Any, default: Any, metadata: Any) -> Any:
    if isinstance(default, tuple):
        if not isinstance(value, list) or len(value) != len(default):
            raise ScenarioError(f"{name}: expected a list of {len(default)} numbers, found {value!r}")
        return tuple(_checked(f"{name}[{index}]", item, 0.0, metadata) for index, item in enumerate(value))
    if isinstance(default, float) and isinstance(value, int) and not isinstance(value, bool):
        value = float(value)
    if type(value) is not type(default):
        words = {bool: "true or false", int: "a whole number", float: "a number", str: "a text"}
        raise ScenarioError(f"{name}: expected {words[type(default)]}, found {value!r}")
    if isinstance(value, float) and not math.isfinite(value):
        raise ScenarioError(f"{name}: expected a finite number, found {value!r}")
    unit = f" {metadata['unit']}" if metadata["unit"] else ""
    if metadata["choices"] and value not in metadata["choices"]:
        raise ScenarioError(f"{name}: expected one of {', '.join(map(str, metadata['choices']))}, found {value!r}")
    if metadata["minimum"] is not None and value < metadata["minimum"]:
        raise ScenarioError(f"{name}: expected at least {metadata['minimum']}{unit}, found {value!r}")
    if metadata["maximum"] is not None and value > metadata["maximum"]:
        raise ScenarioError(f"{name}: expected at most {metadata['maximum']}{unit}, found {value!r}")
    return value
