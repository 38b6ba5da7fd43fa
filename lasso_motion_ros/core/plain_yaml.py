"""YAML as people write it by hand: plain values, lists and mappings, of a size that a hand can write."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import yaml

from lasso_motion_ros.core.errors import ConfigurationError

MAX_CHARACTERS = 1 << 20
MAX_VALUES = 1 << 18


class _BoundedLoader(yaml.SafeLoader):
    """PyYAML's safe loader with a bound on what aliases unfold to: a few lines of them can exceed any memory."""

    def __init__(self, stream: str) -> None:
        super().__init__(stream)
        self._sizes: dict[int, int] = {}

    def compose_node(self, parent: yaml.Node | None, index: int) -> yaml.Node | None:
        node = super().compose_node(parent, index)
        if node is None or id(node) in self._sizes:
            return node
        if not self._is_complete(node):
            raise yaml.YAMLError(f"a value that holds itself, line {node.start_mark.line + 1}")
        children = [child for entry in _entries(node) for child in entry]
        size = 1 + sum(self._sizes[id(child)] for child in children)
        if size > MAX_VALUES:
            raise yaml.YAMLError(f"more than {MAX_VALUES} values")
        self._sizes[id(node)] = size
        return node

    def _is_complete(self, node: yaml.Node) -> bool:
        """Whether it is not the alias of a collection that is still being read."""
        return isinstance(node, yaml.ScalarNode) or node.end_mark is not None


def _entries(node: yaml.Node) -> list[tuple[yaml.Node, ...]]:
    if isinstance(node, yaml.MappingNode):
        return list(node.value)
    return [(child,) for child in node.value] if isinstance(node, yaml.SequenceNode) else []


def parse_plain_yaml(text: str) -> Any:
    """The values in a YAML text.

    Raises:
        ConfigurationError: it is no YAML, longer than a million characters, or its aliases unfold to too much.
    """
    if len(text) > MAX_CHARACTERS:
        raise ConfigurationError(f"{len(text)} characters of YAML, at most {MAX_CHARACTERS} are read")
    try:
        return yaml.load(text, Loader=_BoundedLoader)  # noqa: S506 - derived from the safe loader
    except RecursionError:
        raise ConfigurationError("cannot be read as YAML: nested too deeply") from None
    except Exception as error:  # PyYAML lets its conversions' errors through: a 13th month, a number of 10,000 digits
        raise ConfigurationError(f"cannot be read as YAML: {' '.join(str(error).split())}") from error


def read_plain_yaml(path: str | Path) -> Any:
    """The values in a YAML file.

    Raises:
        ConfigurationError: names the file; not readable, or as `parse_plain_yaml` has it.
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
