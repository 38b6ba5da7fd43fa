"""The rooms of the package: imports run down the floors of docs/architecture.md, and the picture shows what is so."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from functools import cache
from graphlib import CycleError, TopologicalSorter
from pathlib import Path

from support.paths import ROOT

PACKAGE, ADAPTERS = "lasso_motion_ros", "msg_adapters"
# What still replaces parts of the package by name: the ablation, and the benchmark's clocks. It may only shrink.
MAY_PATCH = {f"{PACKAGE}/bench/{name}.py" for name in ("suite/ideas", "scaling", "stage_times")}
MOST_ARROWS = 100


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


def circle(graph: dict[str, set[str]]) -> list[str]:
    """Nodes that lead from one to the next and back, empty where there are none."""
    try:
        TopologicalSorter(graph).prepare()
    except CycleError as error:
        return list(error.args[1])
    return []


def test_every_room_has_its_floor() -> None:
    there = {room(module) for module in files()} - {""}
    assert {"core", "ring", "msg_adapters", "cli"} <= there
    assert there == floors().keys()


def test_no_import_climbs() -> None:
    climbing = [
        line for (above, below), lines in arrows().items() for line in lines if floors()[below] >= floors()[above]
    ]
    assert climbing == []


def test_no_two_files_import_each_other_not_even_by_way_of_others() -> None:
    assert circle({module: set(targets) for module, targets in imports().items()}) == []
    assert circle({"a": {"b"}, "b": {"c"}, "c": {"a"}}) != []


def test_rooms_know_few_others() -> None:
    assert len(arrows()) < MOST_ARROWS


def test_no_file_lies_between_the_rooms() -> None:
    assert [path.name for path in (ROOT / PACKAGE).glob("*.py")] == ["__init__.py"]


def test_the_picture_shows_the_rooms_and_arrows_that_are_there() -> None:
    text = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")
    (picture,) = re.findall(r"```mermaid\n(.*?)```", text, re.DOTALL)
    drawn_floors = re.findall(r"subgraph f(\d+)\b.*?\n(.*?)\n\s*end", picture, re.DOTALL)
    on_floors = {name: int(number) for number, body in drawn_floors for name in re.findall(r"(\w+)\[", body)}
    assert on_floors == floors()
    drawn = set(re.findall(r"^\s*(\w+) --> (\w+)", picture, re.MULTILINE))
    assert drawn
    assert drawn <= arrows().keys()


def test_nothing_shipped_patches_itself() -> None:
    patching = {
        str(path.relative_to(ROOT)) for path in files().values() if re.search(r"\bmock\b", path.read_text("utf-8"))
    }
    assert patching <= MAY_PATCH
