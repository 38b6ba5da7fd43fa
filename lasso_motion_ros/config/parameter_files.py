"""Writes config/*.yaml and docs/parameters.md from the parameter table, so that they cannot disagree with it.

`make config` runs it after a parameter was added or changed.
"""

from __future__ import annotations

import dataclasses
import sys
import textwrap
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

import yaml

from lasso_motion_ros.config.igtl import IgtlConfig
from lasso_motion_ros.config.overlay import OverlayConfig
from lasso_motion_ros.config.parameters import (
    ParameterSpec,
    Value,
    applicable_parameters,
    configuration_from_values,
    configuration_values,
    parameter_table,
)
from lasso_motion_ros.config.stream import StreamConfig
from lasso_motion_ros.config.tracker import BROST2009, TrackerConfig
from lasso_motion_ros.config.web import WebConfig

COMMENT_WIDTH = 110
_NO_BREAK = "\N{NO-BREAK SPACE}"


@dataclass(frozen=True)
class ParameterFile:
    """One file of `config/`.

    Attributes:
        name: the file's name.
        title: what it is for, and what else a reader should know; paragraphs.
        node: the node whose parameters it holds.
        config_type: the dataclass that declares the parameters it lists.
        values: what differs from the defaults, by full name.
    """

    name: str
    title: tuple[str, ...]
    node: str
    config_type: type
    values: Mapping[str, Value] = field(default_factory=dict)


PARAMETER_FILES = (
    ParameterFile("tracker.yaml", ("The tracker at its best: the defaults.",), "lasso_tracker", StreamConfig),
    ParameterFile(
        "brost2009.yaml",
        (
            "The published method: Brost, Liao, Hornegger and Strobel, MICCAI 2009. What differs: docs/brost2009.md",
            "What is not about the method (frames, pairing, heartbeat) is as in tracker.yaml and may be set here too.",
        ),
        "lasso_tracker",
        TrackerConfig,
        {"method": BROST2009},
    ),
    ParameterFile(
        "overlay.yaml",
        ("The overlay node. Set volume_file, units and registration.",),
        "lasso_overlay",
        OverlayConfig,
    ),
    ParameterFile("web.yaml", ("The node behind the page in the browser.",), "lasso_web", WebConfig),
    ParameterFile("igtl.yaml", ("The node that sends to an OpenIGTLink server. Set to.",), "lasso_igtl", IgtlConfig),
)


def parameter_yaml(file: ParameterFile) -> str:
    """The file's text: ROS 2 parameter YAML, each parameter with its meaning, unit and range."""
    values = configuration_values(configuration_from_values(file.config_type, file.values))
    titles = _group_titles(file.config_type)
    lines = [
        *(line for paragraph in file.title for line in _comment(paragraph, "")),
        "# ROS 2 parameters; the node and the lasso-motion commands read the same file.",
        f"/**/{file.node}:",
        "  ros__parameters:",
    ]
    group = ""
    for spec in applicable_parameters(file.config_type, file.values).values():
        new_group, _, name = spec.name.rpartition(".")
        if new_group not in ("", group):
            lines += [*_comment(titles[new_group], "    "), f"    {new_group}:"]
        group = new_group
        indent = "      " if group else "    "
        lines += [*_comment(_explained(spec), indent), f"{indent}{name}: {_scalar(values[spec.name])}"]
    return "\n".join(lines) + "\n"


def parameter_reference() -> str:
    """The documentation of all parameters, Markdown."""
    lines = ["# Parameters", "", "Written from the parameter table by `make config`; do not edit.", ""]
    for node, config_type in (
        ("lasso_tracker", StreamConfig),
        ("lasso_overlay", OverlayConfig),
        ("lasso_web", WebConfig),
        ("lasso_igtl", IgtlConfig),
    ):
        table = list(parameter_table(config_type))
        columns = ["parameter", "default", "unit", "allowed", "live", "meaning"]
        lines += [f"## {node}", ""]
        if any(spec.method for spec in table):
            columns.insert(1, "method")
            lines += ["A parameter that names a method belongs to it and is refused with the other.", ""]
        lines += [_row(columns), "|" + "---|" * len(columns)]
        for spec in table:
            cells = {
                "parameter": f"`{spec.name}`",
                "method": spec.method,
                "default": f"`{_scalar(spec.default)}`",
                "unit": spec.unit,
                "allowed": _allowed(spec),
                "live": "" if spec.read_only else spec.holds_from or "yes",
                "meaning": spec.description,
            }
            lines.append(_row([cells[column] for column in columns]))
        lines.append("")
    return "\n".join(lines)


def write_all(root: Path) -> None:
    """Write every file below a checkout."""
    for file in PARAMETER_FILES:
        (root / "config" / file.name).write_text(parameter_yaml(file), encoding="utf-8")
    (root / "docs" / "parameters.md").write_text(parameter_reference(), encoding="utf-8")


def _row(cells: list[str]) -> str:
    return f"| {' | '.join(cells)} |"


def _comment(text: str, indent: str) -> list[str]:
    start = f"{indent}# "
    lines = textwrap.wrap(text, COMMENT_WIDTH, initial_indent=start, subsequent_indent=start)
    return [line.replace(_NO_BREAK, " ") for line in lines]


def _group_titles(config_type: type) -> dict[str, str]:
    """The first line of each group's docstring, by the group's name; groups do not nest."""
    groups = {entry.name: getattr(config_type(), entry.name) for entry in dataclasses.fields(config_type)}
    return {
        name: (value.__doc__ or "").splitlines()[0] for name, value in groups.items() if dataclasses.is_dataclass(value)
    }


def _scalar(value: Value) -> str:
    # One document, one scalar: the first line without the document's end mark.
    return yaml.safe_dump(value, allow_unicode=True, width=10_000).splitlines()[0]


def _allowed(spec: ParameterSpec) -> str:
    if spec.choices:
        return ", ".join(choice or '""' for choice in spec.choices)
    if spec.minimum is not None and spec.maximum is not None:
        return f"{spec.minimum:g} to {spec.maximum:g}"
    if spec.minimum is not None:
        return f"at least {spec.minimum:g}"
    return "" if spec.maximum is None else f"at most {spec.maximum:g}"


def _explained(spec: ParameterSpec) -> str:
    limits = ", ".join(part for part in (spec.unit, _allowed(spec)) if part)
    # No line is broken inside the limits.
    return f"{spec.description} ({limits.replace(' ', _NO_BREAK)})" if limits else spec.description


if __name__ == "__main__":
    write_all(Path(sys.argv[1] if len(sys.argv) > 1 else "."))
