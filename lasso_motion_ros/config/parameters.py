"""What makes a tree of dataclasses a table of ROS parameters: declaring, listing, checking, reading from YAML.

A parameter or group may belong to one tracking method only. Which method that is, the parameter `method` of the same
table says; a configuration has its own method's parameters and those of every method.
"""

from __future__ import annotations

import dataclasses
import logging
import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, TypeVar

from lasso_motion_ros.core.errors import ConfigurationError
from lasso_motion_ros.core.plain_yaml import read_plain_yaml
from lasso_motion_ros.core.suggestions import did_you_mean

Value = bool | int | float | str
Config = TypeVar("Config")

_LOG = logging.getLogger(__name__)

METHOD = "method"  # the parameter whose value selects the rows of the table that apply


def parameter(
    default: Value,
    description: str,
    *,
    unit: str = "",
    minimum: float | None = None,
    maximum: float | None = None,
    choices: tuple[str, ...] = (),
    read_only: bool = True,
    holds_from: str = "",
    method: str = "",
) -> Any:
    """A dataclass field that is a ROS parameter; the metadata is what declaration and documentation show.

    The arguments are the attributes of `ParameterSpec`.
    """
    return field(
        default=default,
        metadata={
            "description": description,
            "unit": unit,
            "minimum": minimum,
            "maximum": maximum,
            "choices": choices,
            "read_only": read_only,
            "holds_from": holds_from,
            "method": method,
        },
    )


def tuning(default: Value, description: str, **limits: Any) -> Any:
    """A `parameter` that can be changed while the node runs."""
    return parameter(default, description, read_only=False, **limits)


def group(config_type: type, *, method: str = "") -> Any:
    """A dataclass field that is a group of parameters, of every method or of one."""
    return field(default_factory=config_type, metadata={"method": method})


@dataclass(frozen=True)
class ParameterSpec:
    """One row of the parameter table.

    Attributes:
        name: full dotted name, as in ROS.
        default: default value; its type is the parameter's type.
        description: what it does.
        unit: unit of a number, or empty.
        minimum: smallest value allowed, or None.
        maximum: largest value allowed, or None.
        choices: the strings allowed, or empty.
        read_only: whether it is fixed once the node is up.
        holds_from: when a change holds, in words, where that is not at once.
        method: the tracking method that it belongs to, or empty for every method.
    """

    name: str
    default: Value
    description: str
    unit: str
    minimum: float | None
    maximum: float | None
    choices: tuple[str, ...]
    read_only: bool
    holds_from: str
    method: str

    def checked(self, value: Any) -> Value:
        """The value in the parameter's type.

        Raises:
            ConfigurationError: wrong type, out of range, or not one of the choices.
        """
        kind = type(self.default)
        if kind is float and isinstance(value, int) and not isinstance(value, bool):
            value = float(value)
        if type(value) is not kind:
            raise ConfigurationError(f"{self.name} must be a {kind.__name__}, found {value!r}")
        if isinstance(value, float) and not math.isfinite(value):
            raise ConfigurationError(f"{self.name} must be a finite number, found {value}")
        if isinstance(value, int | float):
            for limit, words, broken in (
                (self.minimum, "at least", self.minimum is not None and value < self.minimum),
                (self.maximum, "at most", self.maximum is not None and value > self.maximum),
            ):
                if broken:
                    allowed = f"{words} {limit} {self.unit}".rstrip()
                    raise ConfigurationError(f"{self.name} must be {allowed}, found {value}")
        if self.choices and value not in self.choices:
            raise ConfigurationError(f"{self.name} must be one of {', '.join(self.choices)}, found {value!r}")
        return value


def parameter_table(config_type: type, prefix: str = "", method: str = "") -> Iterator[ParameterSpec]:
    """The parameters of a configuration dataclass, of all methods, in the order declared.

    Args:
        config_type: the dataclass.
        prefix: what stands before each name; nested groups are joined by dots.
        method: the method that the whole dataclass belongs to, or empty.
    """
    defaults = config_type()
    for entry in dataclasses.fields(config_type):
        value = getattr(defaults, entry.name)
        of_method = entry.metadata["method"] or method
        if dataclasses.is_dataclass(value):
            yield from parameter_table(type(value), f"{prefix}{entry.name}.", of_method)
        else:
            metadata = {**entry.metadata, "method": of_method}
            yield ParameterSpec(name=prefix + entry.name, default=value, **metadata)


def applicable_parameters(config_type: type, values: Mapping[str, Any]) -> dict[str, ParameterSpec]:
    """The rows of the table that apply where these values are given, by name: without those of another method.

    Args:
        config_type: the configuration dataclass.
        values: by dotted name; `method` among them selects, or else its default.

    Raises:
        ConfigurationError: no such method, an unknown name, or a parameter of another method.
    """
    table = {spec.name: spec for spec in parameter_table(config_type)}
    method = _method(table, values)
    for name in values:
        if why := _why_inapplicable(name, table, method):
            raise ConfigurationError(why)
    return {name: spec for name, spec in table.items() if spec.method in ("", method)}


def inapplicable_parameters(config_type: type, values: Mapping[str, Any]) -> dict[str, str]:
    """Of these values, by dotted name, those that the table does not know or that are another method's, and why.

    Raises:
        ConfigurationError: no such method.
    """
    table = {spec.name: spec for spec in parameter_table(config_type)}
    method = _method(table, values)
    return {name: why for name in values if (why := _why_inapplicable(name, table, method))}


def _method(table: Mapping[str, ParameterSpec], values: Mapping[str, Any]) -> Value:
    selector = table.get(METHOD)
    return selector.checked(values.get(METHOD, selector.default)) if selector else ""


def _why_inapplicable(name: str, table: Mapping[str, ParameterSpec], method: Value) -> str:
    if name not in table:
        hint = did_you_mean(name, table)
        return f"unknown parameter {name!r}" + (f"; {hint}" if hint else "")
    if table[name].method not in ("", method):
        return f"{name} is a parameter of the method {table[name].method}, but {METHOD} is {method}"
    return ""


def configuration_from_values(config_type: type[Config], values: Mapping[str, Any]) -> Config:
    """A configuration from dotted parameter names; what is not named keeps its default.

    Raises:
        ConfigurationError: an unknown name, a parameter of another method, a wrong type, or a value out of range.
    """
    table = applicable_parameters(config_type, values)
    return _build(config_type, {name: table[name].checked(value) for name, value in values.items()}, "")


def load_configuration(path: str | Path, config_type: type[Config], node_name: str = "lasso_tracker") -> Config:
    """Read a ROS 2 parameter YAML file.

    Sections `/**` and the node's own name (with or without a leading `/`, `/**/`) apply, in the order written. What
    `/**` alone names and the table does not know is another node's, or mistyped: passed over, with a warning.

    Raises:
        ConfigurationError: unreadable file, not parameter YAML, or a value that is not allowed.
    """
    values: dict[str, Any] = {}
    own: set[str] = set()
    for section, parameters in parameter_sections(path):
        if section in {"/**", node_name, f"/{node_name}", f"/**/{node_name}"}:
            values.update(parameters)
            own.update(parameters if section != "/**" else ())
    try:
        for name, why in inapplicable_parameters(config_type, values).items():
            if name not in own:
                _LOG.warning("%s: passed over in section /**: %s", path, why)
                del values[name]
        return configuration_from_values(config_type, values)
    except ConfigurationError as error:
        raise ConfigurationError(f"{path}: {error}") from error


def parameter_sections(path: str | Path) -> list[tuple[str, dict[str, Any]]]:
    """The sections of a ROS 2 parameter YAML file: the node's name as written, and values by dotted name.

    Raises:
        ConfigurationError: unreadable file, or not parameter YAML.
    """
    document = read_plain_yaml(path)
    if not isinstance(document, dict):
        raise ConfigurationError(f"{path}: expected ROS parameter YAML (node name: ros__parameters: …)")
    sections = []
    for section, body in document.items():
        if not isinstance(body, dict) or not isinstance(body.get("ros__parameters"), dict):
            raise ConfigurationError(f"{path}: section {section!r} has no ros__parameters")
        sections.append((str(section), _flatten(body["ros__parameters"])))
    return sections


def configuration_values(config: Any) -> dict[str, Value]:
    """A configuration's parameters as dotted names and values; inverse of `configuration_from_values`.

    Those of another method than the configuration's have no say in it and are left out.
    """
    values = _values(config, "")
    method = values.get(METHOD, "")
    return {spec.name: values[spec.name] for spec in parameter_table(type(config)) if spec.method in ("", method)}


def _values(config: Any, prefix: str) -> dict[str, Value]:
    values: dict[str, Value] = {}
    for entry in dataclasses.fields(config):
        value = getattr(config, entry.name)
        if dataclasses.is_dataclass(value):
            values.update(_values(value, f"{prefix}{entry.name}."))
        else:
            values[prefix + entry.name] = value
    return values


def _flatten(tree: Mapping[str, Any], prefix: str = "") -> dict[str, Any]:
    flat: dict[str, Any] = {}
    for name, value in tree.items():
        if isinstance(value, dict):
            flat.update(_flatten(value, f"{prefix}{name}."))
        else:
            flat[f"{prefix}{name}"] = value
    return flat


def _build(config_type: type[Config], values: Mapping[str, Value], prefix: str) -> Config:
    defaults: Any = config_type()
    arguments: dict[str, Any] = {}
    for entry in dataclasses.fields(defaults):
        default = getattr(defaults, entry.name)
        if dataclasses.is_dataclass(default):
            arguments[entry.name] = _build(type(default), values, f"{prefix}{entry.name}.")
        elif prefix + entry.name in values:
            arguments[entry.name] = values[prefix + entry.name]
    return config_type(**arguments)
