"""The files of config/ and the reference are what the parameter table says."""

from __future__ import annotations

from pathlib import Path

import pytest
from support.paths import ROOT

from lasso_motion_ros.config.parameter_files import (
    COMMENT_WIDTH,
    PARAMETER_FILES,
    ParameterFile,
    parameter_reference,
    parameter_yaml,
)
from lasso_motion_ros.config.parameters import configuration_from_values, load_configuration, parameter_table
from lasso_motion_ros.config.stream import StreamConfig

by_name = pytest.mark.parametrize("file", PARAMETER_FILES, ids=lambda file: file.name)


@by_name
def test_the_file_is_up_to_date(file: ParameterFile) -> None:
    assert (ROOT / "config" / file.name).read_text(encoding="utf-8") == parameter_yaml(file), "run: make config"


@by_name
def test_what_is_written_is_what_is_loaded(file: ParameterFile, tmp_path: Path) -> None:
    written = tmp_path / file.name
    written.write_text(parameter_yaml(file), encoding="utf-8")
    config_type = StreamConfig if file.node == "lasso_tracker" else file.config_type
    expected = configuration_from_values(config_type, file.values)
    assert load_configuration(written, config_type, file.node) == expected


def test_the_reference_is_up_to_date_and_names_every_parameter() -> None:
    text = (ROOT / "docs" / "parameters.md").read_text(encoding="utf-8")
    assert text == parameter_reference(), "run: make config"
    for file in PARAMETER_FILES:
        for spec in parameter_table(file.config_type):
            method = f" {spec.method} |" if file.node == "lasso_tracker" else ""
            assert f"| `{spec.name}` |{method}" in text


def test_a_long_comment_is_broken_but_not_inside_its_limits() -> None:
    lines = parameter_yaml(PARAMETER_FILES[0]).splitlines()
    assert max(len(line) for line in lines) <= COMMENT_WIDTH
    for line in lines:
        assert line.count("(") == line.count(")"), line
