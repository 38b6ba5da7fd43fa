"""YAML as people write it by hand: plain values, lists and mappings, no aliases, of a size that a hand can write."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import yaml

from lasso_motion_ros.core.errors import ConfigurationError

MAX_CHARACTERS = 1 << 20
MOST_NESTED = 64
"""Brackets within each other: PyYAML reads all that open before it looks at one, in a time of their number squared."""


class _PlainLoader(yaml.SafeLoader):
    """PyYAML's safe loader without aliases, which ROS refuses too: a few lines of them can exceed any memory."""

    def fetch_flow_collection_start(self, token: type[yaml.Token]) -> None:
        if self.flow_level >= MOST_NESTED:
            raise RecursionError
        super().fetch_flow_collection_start(token)

    def compose_node(self, parent: yaml.Node | None, index: int) -> yaml.Node | None:
        if self.check_event(yaml.AliasEvent):
            alias: Any = self.get_event()  # type: ignore[no-untyped-call]
            line = alias.start_mark.line + 1
            raise yaml.YAMLError(f"line {line}: the alias *{alias.anchor} is not supported; write the value itself")
        return super().compose_node(parent, index)


# 1e-3 is a number for ROS, as in YAML 1.2; to PyYAML, which asks for a point and a sign, it is text.
_PlainLoader.add_implicit_resolver(
    "tag:yaml.org,2002:float", re.compile(r"[-+]?([0-9]+\.?[0-9]*|\.[0-9]+)[eE][-+]?[0-9]+$"), list("-+.0123456789")
)


def parse_plain_yaml(text: str) -> Any:
    """The values in a YAML text.

    Raises:
        ConfigurationError: it is not YAML, longer than a million characters, or has aliases.
    """
    if len(text) > MAX_CHARACTERS:
        raise ConfigurationError(f"{len(text)} characters of YAML, at most {MAX_CHARACTERS} are read")
    try:
        return yaml.load(text, Loader=_PlainLoader)  # noqa: S506 - derived from the safe loader
    except RecursionError:
        raise ConfigurationError("cannot be read as YAML: nested too deeply") from None
    except Exception as error:  # PyYAML lets errors of its conversions through: a 13th month, a number of 10,000 digits
        raise ConfigurationError(f"cannot be read as YAML: {' '.join(str(error).split())}") from error


def read_plain_yaml(path: str | Path) -> Any:
    """The values in a YAML file.

    Raises:
        ConfigurationError: it cannot be read, or `parse_plain_yaml` refuses it; the text names the file.
    """
    try:
        with Path(path).open(encoding="utf-8") as file:
            text = file.read(MAX_CHARACTERS + 1)
    except (OSError, ValueError) as error:
        reason = error.strerror if isinstance(error, OSError) else error
        raise ConfigurationError(f"{path}: cannot be read: {reason}") from error
    try:
        return parse_plain_yaml(text)
    except ConfigurationError as error:
        raise ConfigurationError(f"{path}: {error}") from error
