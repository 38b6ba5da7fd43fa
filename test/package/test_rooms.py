"""The rooms of the package: imports run down the floors of docs/architecture.md, and the picture shows what is so."""

from __future__ import annotations

import re
from graphlib import CycleError, TopologicalSorter

import pytest
from support.paths import ROOT
from support.rooms import PACKAGE, arrows, files, floors, imports, room

pytestmark = pytest.mark.slow

# Arrows between rooms: with more, the picture is none.
MOST_ARROWS = 106


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


def test_the_package_patches_itself_nowhere() -> None:
    patching = {
        str(path.relative_to(ROOT)) for path in files().values() if re.search(r"\bmock\b", path.read_text("utf-8"))
    }
    assert patching == set()
