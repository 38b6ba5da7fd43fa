"""YAML written by hand is read; aliases, too much of it, and what is not YAML are refused in words."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from lasso_motion_ros.core.errors import ConfigurationError
from lasso_motion_ros.core.plain_yaml import MAX_CHARACTERS, parse_plain_yaml, read_plain_yaml


def test_values_are_read() -> None:
    assert parse_plain_yaml("a: [1.5, 2]\nb: &p x\nc: {d: x}\n") == {"a": [1.5, 2], "b": "x", "c": {"d": "x"}}
    assert parse_plain_yaml("") is None


@pytest.mark.parametrize(
    ("text", "value"),
    [("1e-3", 1e-3), ("-2E3", -2e3), ("5e+1", 50.0), (".5e1", 5.0), ("1.5e2", 150.0), ("1e", "1e"), ("1e3x", "1e3x")],
)
def test_a_number_is_one_for_the_commands_where_it_is_one_for_ros(text: str, value: float | str) -> None:
    """The same file serves the node, whose parser is another."""
    assert parse_plain_yaml(f"a: {text}") == {"a": value}


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("a: &p [1]\nb: *p\n", "line 2: the alias *p is not supported; write the value itself"),
        ("&a [*a]", "line 1: the alias *a"),  # it would hold itself
        ("a: &p {b: 1}\nc:\n  <<: *p\n", "line 3: the alias *p"),
        ("[" * 5000, "nested too deeply"),
        ("{b: " * 100_000, "nested too deeply"),  # at once, not after an hour
        ("- " * 5000, "nested too deeply"),
        ("a: 2001-99-99", "month must be in 1..12"),
        ("a: " + "1" * 5000, "integer string conversion"),
        ("a: [1", "expected ',' or ']'"),
        ("a: !!python/object/apply:os.system [ls]", "could not determine a constructor"),
        ("{[1]: 2}", "unhashable key"),
        (" " * MAX_CHARACTERS + "a", "characters of YAML"),
        ("a: \0", "special characters"),
        ("a: !!int ''", "cannot be read as YAML"),
        ("a: !!bool x", "cannot be read as YAML"),
        ("a: !!float []", "cannot be read as YAML"),
        ("a: !!timestamp x", "cannot be read as YAML"),
    ],
)
def test_what_is_not_is_refused(text: str, said: str) -> None:
    with pytest.raises(ConfigurationError, match=re.escape(said)):
        parse_plain_yaml(text)


def test_a_file_is_named(tmp_path: Path) -> None:
    path = tmp_path / "x.yaml"
    with pytest.raises(ConfigurationError, match=r"x\.yaml: cannot be read: No such file or directory$"):
        read_plain_yaml(path)
    path.write_bytes(b"a: \xff")
    with pytest.raises(ConfigurationError, match=r"x\.yaml: cannot be read"):
        read_plain_yaml(path)
    path.write_text("a: [", encoding="utf-8")
    with pytest.raises(ConfigurationError, match=r"x\.yaml: cannot be read as YAML"):
        read_plain_yaml(path)
