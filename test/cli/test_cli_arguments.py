"""Options with several values: they take their own, and leave what is not theirs."""

from __future__ import annotations

import argparse
from pathlib import Path

import pytest

from lasso_motion_ros.cli import check, evaluate, record, track
from lasso_motion_ros.cli.arguments import CommandParser, parse_remap, tie_values
from lasso_motion_ros.cli.main import main

RULES = ["/x/a:=/a", "/x/b:=/b"]


def parsed(command: object, *words: str) -> argparse.Namespace:
    parser = CommandParser(prog="command")
    command.add_arguments(parser)  # type: ignore[attr-defined]
    return parser.parse_args(words)


@pytest.mark.parametrize(
    "words",
    [
        ["IN", "-o", "OUT", "--remap", *RULES],
        ["IN", "--remap", *RULES, "-o", "OUT"],
        ["--remap", *RULES, "IN", "-o", "OUT"],
        ["-o", "OUT", "--remap", RULES[0], "IN", "--remap", RULES[1]],
        ["--remap", RULES[0], "--remap=" + RULES[1], "IN", "-o", "OUT"],
        ["-o", "OUT", "--remap", *RULES, "--", "IN"],
    ],
)
def test_a_recording_behind_remap_is_the_recording(words: list[str]) -> None:
    options = parsed(track, *words)
    assert (options.recordings, options.output, options.remap) == ([Path("IN")], Path("OUT"), RULES)


def test_without_the_option_there_are_no_values() -> None:
    assert parsed(track, "IN", "-o", "OUT").remap == []


def test_a_recording_that_may_be_left_out_is_found_behind_an_option() -> None:
    options = parsed(check, "--remap", *RULES, "IN.mcap", "--json", "F")
    assert (options.recording, options.remap) == ("IN.mcap", RULES)
    options = parsed(record, "--topics", "/one", "two", "OUT.mcap", "--overwrite")
    assert (options.output, options.topics, options.overwrite) == (Path("OUT.mcap"), ["/one", "two"], True)


def test_configurations_end_where_a_recording_comes(tmp_path: Path) -> None:
    bag = tmp_path / "bag"
    bag.mkdir()
    options = parsed(evaluate, "--config", "a.yaml", "b.yaml", str(bag), "one.mcap")
    assert (options.config, options.recordings) == ([Path("a.yaml"), Path("b.yaml")], [bag, Path("one.mcap")])
    options = parsed(evaluate, "one.mcap", "two.mcap", "--result", "1.mcap", "2.mcap", "--result", "3.mcap")
    assert (options.recordings, options.result) == (
        [Path("one.mcap"), Path("two.mcap")],
        [Path("1.mcap"), Path("2.mcap"), Path("3.mcap")],
    )


def test_results_take_all_that_follows_and_that_is_said(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["evaluate", "--result", "out.mcap", "in.mcap"]) == 2
    assert capsys.readouterr().err == (
        "lasso-motion evaluate: no recording: name IN.mcap, and before --result, which takes every file behind it\n"
    )


def test_the_first_word_behind_an_option_is_its_value_right_or_wrong() -> None:
    """So that a misspelt rule is called one, and not an unknown argument."""
    options = parsed(track, "--remap", "a=b", "c:=d", "IN", "-o", "OUT")
    assert (options.remap, options.recordings) == (["a=b", "c:=d"], [Path("IN")])


@pytest.mark.parametrize("words", [["--remap"], ["IN", "--remap", "-o", "OUT"]])
def test_an_option_without_a_value_is_one_line(words: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["track", *words]) == 2
    error = capsys.readouterr().err
    assert "--remap: expected at least one argument" in error
    assert error.count("\n") == 1


@pytest.mark.parametrize("end", ["--", "--ros-args"])
def test_what_is_not_the_commands_is_left_as_it_is(end: str) -> None:
    words = ["--remap", "a:=b", end, "--remap", "c:=d", "e"]
    assert tie_values(words, {"--remap": lambda word: ":=" in word}) == ["--remap=a:=b", *words[2:]]


def test_rules_become_a_mapping() -> None:
    assert parse_remap(RULES) == {"/x/a": "/a", "/x/b": "/b"}


@pytest.mark.parametrize(
    "words",
    [["track", "", "-o", "OUT"], ["track", "IN", "-o", ""], ["evaluate", "IN", "--config", ""], ["check", ""]],
    ids=" ".join,
)
def test_an_empty_word_names_no_file(words: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    """A shell's variable that is not set would be the working directory, or a live graph."""
    assert main(words) == 2
    assert capsys.readouterr().err.endswith("expected a name, found an empty word (--help shows the usage)\n")
