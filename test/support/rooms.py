"""The rooms of the package, their floors as docs/architecture.md has them, and the imports between them."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from functools import cache
from pathlib import Path

from support.paths import ROOT

PACKAGE, ADAPTERS = "lasso_motion_ros", "msg_adapters"


@cache
def files() -> dict[str, Path]:
    """Dotted module name → file."""
    paths = [path for top in (PACKAGE, ADAPTERS) for path in sorted((ROOT / top).rglob("*.py"))]
    return {".".join(path.relative_to(ROOT).with_suffix("").parts).removesuffix(".__init__"): path for path in paths}


@cache
def imports() -> dict[str, set[str]]:
    """Module → the modules of ours that it imports, at its top or anywhere in it."""
    return {module: set(_imported(module, path)) - {module} for module, path in files().items()}


def _imported(module: str, path: Path) -> Iterator[str]:
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            named = [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{module}: relative imports hide where they lead"
            # `from room import file` imports the file, `from room.file import name` the same file.
            named = [f"{node.module}.{alias.name}" for alias in node.names]
        else:
            continue
        for name in named:
            if name in files():
                yield name
            elif name.rpartition(".")[0] in files():
                yield name.rpartition(".")[0]


def room(module: str) -> str:
    top, _, rest = module.partition(".")
    return ADAPTERS if top == ADAPTERS else rest.partition(".")[0]


@cache
def floors() -> dict[str, int]:
    """Room → floor, as the table in docs/architecture.md has them."""
    text = (ROOT / "docs" / "architecture.md").read_text(encoding="utf-8")
    rows = re.findall(r"^\| (\d+) \| (`[^|]*`) \|", text, re.MULTILINE)
    return {name: int(number) for number, names in rows for name in re.findall(r"`(\w+)`", names)}


@cache
def arrows() -> dict[tuple[str, str], list[str]]:
    """(importing room, imported room) → the imports behind it."""
    found: dict[tuple[str, str], list[str]] = {}
    for module, targets in imports().items():
        for target in targets:
            ends = room(module), room(target)
            if ends[0] != ends[1] and all(ends):
                found.setdefault(ends, []).append(f"{module} imports {target}")
    return found
