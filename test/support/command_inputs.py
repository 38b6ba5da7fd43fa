"""The parser of one command, as `lasso-motion` makes it, with what it has declared."""

from __future__ import annotations

import argparse
import importlib
from collections.abc import Mapping
from typing import Any

from lasso_motion_ros.cli.arguments import CommandParser, OutputArgument
from lasso_motion_ros.cli.main import COMMANDS


class DeclaredParser(CommandParser):
    """A command's parser whose declarations can be looked at."""

    @property
    def inputs(self) -> list[str]:
        return self._inputs

    @property
    def outputs(self) -> dict[str, OutputArgument]:
        return {one.name: one for one in self._outputs}

    def namespace(self, values: Mapping[str, Any]) -> argparse.Namespace:
        """Options with some values, all others as they are without arguments; whatever exists may be overwritten."""
        defaults = {action.dest: action.default for action in self._actions}
        return argparse.Namespace(**{**defaults, **values, "overwrite": True})


def command_names() -> list[str]:
    """Every command as it is typed: of one with parts, each part (`benchmark export`)."""
    names = []
    for command in COMMANDS:
        parts = _parts(_parser(command.name))
        names += [f"{command.name} {part}" for part in parts] or [command.name]
    return names


def command_parser(name: str) -> DeclaredParser:
    """The parser of a command, or of its part."""
    command, _, part = name.partition(" ")
    parser = _parser(command)
    return _parts(parser)[part] if part else parser


def _parser(command: str) -> DeclaredParser:
    module = next(one.module for one in COMMANDS if one.name == command)
    parser = DeclaredParser(prog=command)
    importlib.import_module(f"lasso_motion_ros.cli.{module}").add_arguments(parser)
    return parser


def _parts(parser: DeclaredParser) -> dict[str, DeclaredParser]:
    for action in parser._actions:
        if isinstance(action, argparse._SubParsersAction):
            return dict(action.choices)
    return {}
