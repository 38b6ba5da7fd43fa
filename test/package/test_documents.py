"""Documents, docstrings and comments name what is there: files, links, commands, states; so do citation and CI."""

from __future__ import annotations

import ast
import re
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import pytest
import yaml
from support.named import dotted_names, is_known, members, parts_of, sources, wrong_names
from support.paths import ROOT

from lasso_motion_ros.cli.main import COMMANDS
from lasso_motion_ros.tracking.tracker import TrackerState

pytestmark = pytest.mark.slow

PACKAGE = ROOT / "lasso_motion_ros"
DOCUMENTS = sorted([*ROOT.glob("*.md"), *(ROOT / "docs").glob("*.md"), *(ROOT / "docs" / "tutorials").glob("*.md")])
WRITTEN_BY_RUNS = {"demo_output"}  # named as what a command writes
STANDS_FOR = re.compile(r"[<>*…]|\bx\b|/path/to|YOUR|NAME|FILE|DIR")


def text_of(path: Path) -> str:
    return path.read_text(encoding="utf-8")


def prose_of(path: Path) -> str:
    """A document without its blocks of code; a Python file's docstrings and comments."""
    return parts_of(path)[0] if path.suffix == ".py" else re.sub(r"```.*?```", "", text_of(path), flags=re.DOTALL)


def found(name: str, document: Path) -> bool:
    """Whether a path that a document names exists, seen from itself, the root, or the package."""
    return any((base / name).exists() for base in (document.parent, ROOT, PACKAGE))


@pytest.mark.parametrize("document", DOCUMENTS, ids=lambda path: path.name)
def test_links_lead_somewhere(document: Path) -> None:
    for target in re.findall(r"\]\(([^)\s]+)\)", text_of(document)):
        if target.startswith("https://"):
            continue
        path, _, anchor = target.partition("#")
        linked = (document.parent / path).resolve() if path else document
        assert linked.exists(), target
        assert linked.is_relative_to(ROOT), target
        if anchor:
            titles = re.findall(r"^#+ (.*)$", text_of(linked), re.MULTILINE)
            assert anchor in {re.sub(r"[^\w\- ]", "", title.lower()).replace(" ", "-") for title in titles}, target


def missing_files(path: Path) -> list[str]:
    """The files and folders that a text names between backticks, in docstrings also without, and that are not there."""
    words = re.findall(r"`([\w./\-]+)`", prose_of(path))
    if path.suffix == ".py":
        words += re.findall(r"(?<![\w./`~<-])[\w\-]+(?:/[\w\-]+)+\.(?:py|md)\b", prose_of(path))
    missing = []
    for word in words:
        name = word.rstrip("/")
        is_path = "/" in name and (
            word.endswith("/") or re.search(r"\.(py|yaml|md|txt|xml|toml|mcap|rviz|json|png)$", name)
        )
        if is_path and not STANDS_FOR.search(name) and name.split("/")[0] not in WRITTEN_BY_RUNS | {"~", ""}:
            missing += [] if found(name, path) else [word]
    return missing


@pytest.mark.parametrize("document", DOCUMENTS, ids=lambda path: path.name)
def test_files_that_are_named_are_there(document: Path) -> None:
    assert missing_files(document) == []


@cache
def definitions(path: Path) -> frozenset[str]:
    """Functions, classes and methods (`Class.method`) of a file."""
    names: set[str] = set()
    for node in ast.parse(text_of(path)).body:
        if isinstance(node, ast.FunctionDef | ast.ClassDef):
            names.add(node.name)
        if isinstance(node, ast.ClassDef):
            names |= {f"{node.name}.{inner.name}" for inner in node.body if isinstance(inner, ast.FunctionDef)}
    return frozenset(names)


def missing_definitions(path: Path) -> list[str]:
    """What a text says to be in a file, as `path.py` (`name`, `Class.method`), and is not."""
    missing = []
    for file, names in re.findall(r"`([\w/]+\.py)`[,:]?\s\(?((?:`[\w.]+`(?:,\s)?)+)", prose_of(path)):
        (there,) = [base / file for base in (ROOT, PACKAGE) if (base / file).exists()]
        for name in re.findall(r"`([\w.]+)`", names):
            if "/" not in name and not name.endswith(".py") and name not in definitions(there):
                missing.append(f"{file}: {name}")
    return missing


@pytest.mark.parametrize("document", DOCUMENTS, ids=lambda path: path.name)
def test_what_is_said_to_be_in_a_file_is_there(document: Path) -> None:
    assert missing_definitions(document) == []


@pytest.mark.parametrize("document", DOCUMENTS, ids=lambda path: path.name)
def test_classes_have_the_members_that_are_named(document: Path) -> None:
    names = dotted_names(prose_of(document))
    ours = [name for name in names if name.split(".")[0] in members()]
    assert [name for name in ours if not is_known(name)] == []


def wrong_in_code(check: Callable[[Path], list[str]]) -> dict[str, list[str]]:
    """File → what is wrong in its docstrings and comments; without the files in which nothing is."""
    return {str(path.relative_to(ROOT)): wrong for path in sources() if (wrong := check(path))}


def test_docstrings_and_comments_name_files_that_are_there() -> None:
    assert wrong_in_code(missing_files) == {}


def test_docstrings_and_comments_name_what_is_in_a_file() -> None:
    assert wrong_in_code(missing_definitions) == {}


def test_docstrings_and_comments_name_what_the_code_has() -> None:
    assert wrong_in_code(lambda path: wrong_names(prose_of(path))) == {}


def test_a_rooms_docstring_names_its_modules() -> None:
    def strangers(path: Path) -> list[str]:
        words = re.findall(r"`([a-z_]+)`", prose_of(path)) if path.name == "__init__.py" else []
        return [word for word in words if not (path.parent / f"{word}.py").exists()]

    assert wrong_in_code(strangers) == {}


@pytest.mark.parametrize(
    "name", ["loop_finder", "OldTracker", "RingTracker.follow", "ring.loop_finder", "judgement.lost_gap_cm", "np.rad"]
)
def test_a_name_that_is_none_is_noticed(name: str) -> None:
    assert wrong_names(f"Done by `{name}`, as ever.") == [name]


def test_constants_that_are_explained_are_there() -> None:
    rows = re.findall(r"^\| (`.*?`) \| `(\S+)` \|", text_of(ROOT / "docs" / "constants.md"), re.MULTILINE)
    assert rows
    for names, path in rows:
        text = text_of(PACKAGE / path)
        assert all(re.search(rf"\b{name}\b.*=", text) for name in re.findall(r"`(\w+)`", names)), (path, names)


@pytest.mark.parametrize("document", DOCUMENTS, ids=lambda path: path.name)
def test_make_can_make_what_is_told(document: Path) -> None:
    targets = set(re.findall(r"^([a-z-]+):.*##", text_of(ROOT / "Makefile"), re.MULTILINE))
    told = set(re.findall(r"(?:^|`)make ([a-z-]+)", text_of(document), re.MULTILINE))
    assert told <= targets


def test_the_readme_has_every_command() -> None:
    told = set(re.findall(r"^\| `lasso-motion (\w+)", text_of(ROOT / "README.md"), re.MULTILINE))
    assert told == {command.name for command in COMMANDS}


def test_the_glossary_explains_every_state() -> None:
    rows = re.findall(r"^\| ([A-Z_]+) \|", text_of(ROOT / "docs" / "glossary.md"), re.MULTILINE)
    assert sorted(rows) == sorted(state.value for state in TrackerState)


def test_a_newcomer_finds_every_document() -> None:
    readme = text_of(ROOT / "README.md")
    reachable = readme + text_of(ROOT / "CONTRIBUTING.md")
    missing = [path.name for path in DOCUMENTS if path.name != "README.md" and f"{path.name})" not in reachable]
    assert missing == []
    assert "(CONTRIBUTING.md)" in readme
    assert "(QUALITY_DECLARATION.md)" in readme  # as REP-2004 asks


def test_setting_up_takes_two_commands() -> None:
    first = re.search(r"```sh\n(.*?)```", text_of(ROOT / "CONTRIBUTING.md"), re.DOTALL)
    assert first
    assert [line.split("#")[0].strip() for line in first[1].splitlines()] == ["make demo", "make test"]


def test_the_citation_is_that_of_this_package() -> None:
    citation = yaml.safe_load(text_of(ROOT / "CITATION.cff"))
    package = ElementTree.parse(ROOT / "package.xml").getroot()
    assert citation["cff-version"] == "1.2.0"
    assert {"message", "title", "authors"} <= citation.keys()
    assert citation["version"] == package.findtext("version")
    assert citation["license"] == package.findtext("license")
    (paper,) = citation["references"]
    assert [author["family-names"] for author in paper["authors"]] == ["Brost", "Liao", "Hornegger", "Strobel"]
    assert f"https://doi.org/{paper['doi']}" == package.findtext("url")


def hooks() -> list[dict[str, Any]]:
    document = yaml.safe_load(text_of(ROOT / ".pre-commit-config.yaml"))
    assert {one["repo"] for one in document["repos"]} == {
        "local"
    }  # nothing is fetched, nothing has a version of its own
    return [hook for one in document["repos"] for hook in one["hooks"]]


def test_hooks_run_the_pinned_tools_that_make_lint_runs() -> None:
    pins = set(re.findall(r"^([a-z-]+)==", text_of(ROOT / "requirements" / "dev.txt"), re.MULTILINE))
    assert {"pre-commit", "pre-commit-hooks", "ruff", "mypy"} <= pins
    entries = [hook["entry"] for hook in hooks()]
    assert all(entry.startswith(".venv/bin/") for entry in entries)
    linted = re.findall(r"\$\(VENV\)/bin/(ruff format|ruff check|mypy)", text_of(ROOT / "Makefile"))
    assert {"ruff format", "ruff check", "mypy"} <= set(linted)
    assert all(any(entry.startswith(f".venv/bin/{tool}") for entry in entries) for tool in linted)


def test_the_workflow_runs_what_a_contributor_runs() -> None:
    workflow = yaml.safe_load(text_of(ROOT / ".github" / "workflows" / "ci.yml"))
    (job,) = workflow["jobs"].values()
    assert job["runs-on"].startswith("ubuntu")
    assert job["strategy"]["matrix"]["python"] == ["3.11", "3.12"]
    assert job["steps"][-1]["run"].endswith(" .ci/run")
    assert (ROOT / ".ci" / "run").stat().st_mode & 0o111
