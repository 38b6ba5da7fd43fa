"""YAML written by hand is read; what takes memory or time without end, or is no YAML, is refused in words."""

from __future__ import annotations

from pathlib import Path

import pytest

from lasso_motion_ros.core.errors import ConfigurationError
from lasso_motion_ros.core.plain_yaml import MAX_CHARACTERS, parse_plain_yaml, read_plain_yaml

LAUGHS = "a: &a [1,1,1,1,1,1,1,1,1,1]\n" + "".join(
    f"{after}: &{after} [{', '.join([f'*{before}'] * 10)}]\n"
    for before, after in zip("abcdefgh", "bcdefghi", strict=True)
)


def test_values_and_aliases_are_read() -> None:
    assert parse_plain_yaml("a: &p [1.5, 2]\nb: *p\nc: {d: x}\n") == {"a": [1.5, 2], "b": [1.5, 2], "c": {"d": "x"}}
    assert parse_plain_yaml("") is None


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (LAUGHS, "more than 262144 values"),
        ("&a [*a]", "a value that holds itself"),
        ("[" * 5000, "nested too deeply"),
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
    with pytest.raises(ConfigurationError, match=said.replace("[", r"\[").replace("]", r"\]")):
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
