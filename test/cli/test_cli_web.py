"""`lasso-motion web` with a recording and a volume: what is refused before any process is started."""

from __future__ import annotations

from pathlib import Path

import pytest

from lasso_motion_ros.cli.main import main


@pytest.mark.parametrize(
    ("words", "complaint"),
    [
        (["--units", "mm"], "go with --volume FILE"),
        (["--config", "{tmp}/a.yaml"], "--config goes with IN.mcap or --volume"),
        (["{tmp}/a.mcap", "--annotate", "{tmp}/a.mcap", "-o", "{tmp}/b.mcap"], "-o goes with --annotate"),
        (["{tmp}/a.mcap", "--annotate", "{tmp}/a.mcap"], "one of both"),
        (["{tmp}/a.mcap", "--ros-args", "-r", "__ns:=/lab"], "--ros-args is for a graph that is running"),
        (["{tmp}/a.mcap", "--volume", "a.stl", "--config", "{tmp}/none.yaml"], "none.yaml: cannot be read"),
    ],
)
def test_what_does_not_go_together_is_one_line(
    words: list[str], complaint: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    for name in ("a.mcap", "a.yaml"):
        (tmp_path / name).touch()
    assert main(["web", *(word.format(tmp=tmp_path) for word in words)]) == 2
    error = capsys.readouterr().err
    assert complaint in error
    assert error.count("\n") == 1
