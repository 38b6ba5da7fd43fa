"""Writes config/*.yaml and docs/parameters.md from the parameter table, so that they cannot disagree with it.

`make config` runs it after a parameter was added or changed.
"""

from __future__ import annotations

import sys
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

import yaml

from lasso_motion_ros.config.overlay import OverlayConfig
from lasso_motion_ros.config.parameters import (
    ParameterSpec,
    Value,
    configuration_from_values,
    configuration_values,
    parameter_table,
)
from lasso_motion_ros.config.stream import StreamConfig
from lasso_motion_ros.config.web import WebConfig


@dataclass(frozen=True)
class ParameterFile:
    """One file of `config/`.

    Attributes:
        name: the file's name.
        title: what it is for, one line.
        node: the node whose parameters it holds.
        config_type: the dataclass that declares them.
        values: what differs from the defaults, by full name.
    """

    name: str
    title: str
    node: str
    config_type: type
    values: Mapping[str, Value] = field(default_factory=dict)


PARAMETER_FILES = (
    ParameterFile("tracker.yaml", "The tracker as it is best: the defaults.", "lasso_tracker", StreamConfig),
    ParameterFile(
        "brost2009.yaml",
        "The published method, faithfully: Brost, Liao, Hornegger and Strobel, MICCAI 2009.",
        "lasso_tracker",
        StreamConfig,
        {"method": "brost2009"},
    ),
    ParameterFile(
        "overlay.yaml", "The overlay node: give volume_file, units and registration.", "lasso_overlay", OverlayConfig
    ),
    ParameterFile("web.yaml", "The node behind the page in the browser.", "lasso_web", WebConfig),
)


def parameter_yaml(file: ParameterFile) -> str:
    """The file's text: ROS 2 parameter YAML, every parameter with its meaning, unit and range."""
    values = configuration_values(configuration_from_values(file.config_type, file.values))
    lines = [
        f"# {file.title}",
        "# ROS 2 parameters; the same file serves the node and the lasso-motion command.",
        f"/**/{file.node}:",
        "  ros__parameters:",
    ]
    group: list[str] = []
    for spec in parameter_table(file.config_type):
        *path, name = spec.name.split(".")
        common = next((at for at, (old, new) in enumerate(zip(group, path, strict=False)) if old != new), None)
        common = min(len(group), len(path)) if common is None else common
        lines += [f"{'  ' * (at + 2)}{path[at]}:" for at in range(common, len(path))]
        group = path
        indent = "  " * (len(path) + 2)
        lines.append(f"{indent}# {_explained(spec)}")
        lines.append(f"{indent}{name}: {_scalar(values[spec.name])}")
    return "\n".join(lines) + "\n"


def parameter_reference() -> str:
    """The documentation of all parameters, Markdown."""
    lines = ["# Parameters", "", "Written from the parameter table by `make config`; do not edit.", ""]
    for node, config_type in (
        ("lasso_tracker", StreamConfig),
        ("lasso_overlay", OverlayConfig),
        ("lasso_web", WebConfig),
    ):
        lines += [
            f"## {node}",
            "",
            "| parameter | default | unit | allowed | live | meaning |",
            "|---|---|---|---|---|---|",
        ]
        for spec in parameter_table(config_type):
            live = "" if spec.read_only else "yes"
            default = f"`{_scalar(spec.default)}`"
            lines.append(
                f"| `{spec.name}` | {default} | {spec.unit} | {_allowed(spec)} | {live} | {spec.description} |"
            )
        lines.append("")
    return "\n".join(lines)


def write_all(root: Path) -> None:
    """Write every file below a checkout."""
    for file in PARAMETER_FILES:
        (root / "config" / file.name).write_text(parameter_yaml(file), encoding="utf-8")
    (root / "docs" / "parameters.md").write_text(parameter_reference(), encoding="utf-8")


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
    return f"{spec.description} ({limits})" if limits else spec.description


if __name__ == "__main__":
    write_all(Path(sys.argv[1] if len(sys.argv) > 1 else "."))
