"""What prose names: words between backticks in documents, docstrings and comments, and whether the code has them."""

from __future__ import annotations

import ast
import io
import re
import tokenize
from functools import cache
from importlib import import_module
from pathlib import Path

from support.paths import ROOT

PACKAGES = ("lasso_motion_ros", "msg_adapters")
IDENTIFIER = re.compile(r"[A-Za-z_]\w*")
DOTTED = re.compile(r"[A-Za-z_]\w*(?:\.[A-Za-z_]\w*)+(?:\(\))?")
FILE = re.compile(r"\.(py|yaml|md|txt|xml|toml|mcap|rviz|json|png|html|stl|j2)$")


@cache
def sources() -> tuple[Path, ...]:
    """All Python files of the package."""
    return tuple(path for package in PACKAGES for path in sorted((ROOT / package).rglob("*.py")))


def module_parts(path: Path) -> tuple[str, ...]:
    """A file's folders and name, from the package on."""
    return path.relative_to(ROOT).with_suffix("").parts


@cache
def tree_of(path: Path) -> ast.Module:
    return ast.parse(path.read_text(encoding="utf-8"))


@cache
def parts_of(path: Path) -> tuple[str, frozenset[str]]:
    """A Python file's prose, docstrings and comments, and the words of its code, those in its strings included."""
    docstrings = {
        (statement.lineno, statement.col_offset): str(ast.literal_eval(statement.value))
        for node in ast.walk(tree_of(path))
        if isinstance(body := getattr(node, "body", None), list)
        for statement in body
        if isinstance(statement, ast.Expr)
        and isinstance(statement.value, ast.Constant)
        and isinstance(statement.value.value, str)
    }
    prose, words = list(docstrings.values()), set[str]()
    comment_line = -1
    for token in tokenize.generate_tokens(io.StringIO(path.read_text(encoding="utf-8")).readline):
        if token.type == tokenize.COMMENT:
            text = token.string.lstrip("#: ")
            if token.start[0] == comment_line + 1:
                prose[-1] += f" {text}"
            else:
                prose.append(text)
            comment_line = token.start[0]
        elif token.start not in docstrings:
            words.update(IDENTIFIER.findall(token.string))
    return "\n\n".join(prose), frozenset(words)


@cache
def all_words() -> frozenset[str]:
    """Every word of the code, and every module."""
    return frozenset().union(*(parts_of(path)[1].union(module_parts(path)) for path in sources()))


@cache
def members() -> dict[str, frozenset[str]]:
    """Class → its fields, methods, and what its methods put on `self`; those of its bases among ours included."""
    own: dict[str, set[str]] = {}
    bases: dict[str, set[str]] = {}
    for path in sources():
        for node in ast.walk(tree_of(path)):
            if isinstance(node, ast.ClassDef):
                own.setdefault(node.name, set()).update(_own_members(node))
                bases.setdefault(node.name, set()).update(base.id for base in node.bases if isinstance(base, ast.Name))

    def of(name: str) -> set[str]:
        return own.get(name, set()).union(*(of(base) for base in bases.get(name, set())))

    return {name: frozenset(of(name)) for name in own}


def _own_members(node: ast.ClassDef) -> set[str]:
    names: set[str] = set()
    for inner in ast.walk(node):
        if isinstance(inner, ast.FunctionDef | ast.AsyncFunctionDef):
            names.add(inner.name)
        elif isinstance(inner, ast.Attribute) and isinstance(inner.value, ast.Name) and inner.value.id == "self":
            names.add(inner.attr)
        elif isinstance(inner, ast.AnnAssign | ast.Assign):
            targets = inner.targets if isinstance(inner, ast.Assign) else [inner.target]
            names.update(target.id for target in targets if isinstance(target, ast.Name))
    return names


@cache
def groups() -> dict[str, frozenset[str]]:
    """Field → the members of the classes that such fields hold: parameters and scenarios are named `group.name`."""
    found: dict[str, set[str]] = {}
    for path in sources():
        for node in ast.walk(tree_of(path)):
            if isinstance(node, ast.AnnAssign) and isinstance(node.target, ast.Name):
                for held in ast.walk(node.annotation):
                    if isinstance(held, ast.Name):
                        found.setdefault(node.target.id, set()).update(members().get(held.id, ()))
    return {name: frozenset(names) for name, names in found.items()}


@cache
def words_within(name: str) -> frozenset[str]:
    """The words of all modules of a name, or in the folders of that name; none where there is neither."""
    named = [path for path in sources() if name in module_parts(path)]
    return frozenset().union(*(parts_of(path)[1].union(module_parts(path)) for path in named))


def is_known(name: str) -> bool:
    """Whether a dotted name leads somewhere: into a class, a module, a folder or a group, or a module that is used."""
    first, *rest = name.removesuffix("()").split(".")
    if first in members():
        return rest[0] in members()[first]
    if set(rest) <= words_within(first) or rest[0] in groups().get(first, ()):
        return True
    if first not in all_words():
        return False
    try:
        return hasattr(import_module({"np": "numpy"}.get(first, first)), rest[0])
    except ImportError:
        return False


def backticked(prose: str) -> list[str]:
    return re.findall(r"`([^`\n]+)`", prose)


def dotted_names(prose: str) -> list[str]:
    """The dotted names between backticks, files left out."""
    return [word for word in backticked(prose) if DOTTED.fullmatch(word) and not FILE.search(word)]


def wrong_names(prose: str) -> list[str]:
    """What looks like a name between backticks and is none."""
    unknown = [word for word in backticked(prose) if IDENTIFIER.fullmatch(word) and word not in all_words()]
    return unknown + [name for name in dotted_names(prose) if not is_known(name)]
