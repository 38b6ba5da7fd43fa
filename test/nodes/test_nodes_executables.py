"""The executables by name, as setup.py installs them and as `python -m` runs them."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from lasso_motion_ros.nodes import executables
from lasso_motion_ros.nodes.executables import EXECUTABLES, main


def test_an_unknown_name_is_one_line(capsys: pytest.CaptureFixture[str]) -> None:
    for arguments, found in ((["lasso"], "lasso"), ([], "nothing")):
        assert main(arguments) == 2
        assert (
            capsys.readouterr().err
            == f"expected one of lasso_tracker, lasso_overlay, lasso_web, lasso_igtl, found {found}\n"
        )


def test_the_name_is_taken_off_the_arguments(monkeypatch: pytest.MonkeyPatch) -> None:
    given = []
    monkeypatch.setattr(executables, "run_node", lambda make, arguments: given.append(arguments) or 7)
    assert main(["lasso_web", "--ros-args", "-p", "port:=0"]) == 7
    assert given == [["--ros-args", "-p", "port:=0"]]


def test_each_is_installed_under_its_name() -> None:
    setup = (Path(__file__).parents[2] / "setup.py").read_text(encoding="utf-8")
    for name in EXECUTABLES:
        assert f'f"{name} = {{NAME}}.nodes.executables:{name}"' in setup


def test_numpy_is_not_imported_before_the_threads_are_bounded() -> None:
    code = "import sys, lasso_motion_ros.nodes.executables; sys.exit('numpy' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False, timeout=120).returncode == 0
