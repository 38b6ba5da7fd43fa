"""The command line's frame: errors are one plain line, exit codes are those of the contract, help costs nothing."""

from __future__ import annotations

import argparse
import subprocess
import sys
from pathlib import Path
from types import ModuleType, SimpleNamespace
from typing import Any

import pytest

from lasso_motion_ros.cli import main as cli
from lasso_motion_ros.core.errors import RecordingError
from lasso_motion_ros.core.progress import progress
from lasso_motion_ros.core.share import bundled_recording, version


@pytest.fixture
def command(monkeypatch: pytest.MonkeyPatch) -> Any:
    """Replaces the `track` command by one that does as the test says."""

    def replace(run: Any) -> None:
        module = ModuleType("lasso_motion_ros.cli.track")
        module.HELP = "help"  # type: ignore[attr-defined]
        module.add_arguments = lambda parser: None  # type: ignore[attr-defined]
        module.run = run  # type: ignore[attr-defined]
        monkeypatch.setitem(sys.modules, module.__name__, module)

    return replace


def raising(error: BaseException) -> Any:
    def run(args: argparse.Namespace) -> int:
        raise error

    return run


def test_a_pipe_gets_each_line_when_it_is_written() -> None:
    code = (
        "import sys; from lasso_motion_ros.cli.main import main; main(['--version']); print(sys.stdout.line_buffering)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, encoding="utf-8", check=True)
    assert done.stdout.splitlines()[-1] == "True"


def test_an_error_is_one_plain_line(command: Any, capsys: pytest.CaptureFixture[str]) -> None:
    command(raising(RecordingError("in.mcap: not an MCAP file")))
    assert cli.main(["track"]) == 2
    captured = capsys.readouterr()
    assert captured.err == "lasso-motion track: in.mcap: not an MCAP file\n"
    assert captured.out == ""


def test_the_commands_own_status_is_passed_on(command: Any) -> None:
    command(lambda args: 3)
    assert cli.main(["track"]) == 3


def test_an_interrupt_ends_with_130(command: Any) -> None:
    command(raising(KeyboardInterrupt()))
    assert cli.main(["track"]) == 130


def test_a_bug_is_not_hidden(command: Any) -> None:
    command(raising(ZeroDivisionError()))
    with pytest.raises(ZeroDivisionError):
        cli.main(["track"])


def test_quiet_is_common_to_all(command: Any) -> None:
    seen: list[bool] = []
    command(lambda args: seen.append(args.quiet) or 0)
    assert cli.main(["track", "--quiet"]) == 0
    assert cli.main(["track"]) == 0
    assert seen == [True, False]


@pytest.mark.parametrize(("arguments", "status"), [(["--help"], 0), (["--version"], 0), ([], 2), (["nonsense"], 2)])
def test_without_a_command(arguments: list[str], status: int) -> None:
    assert cli.main(arguments) == status


def test_the_version_is_the_packages(capsys: pytest.CaptureFixture[str]) -> None:
    cli.main(["--version"])
    assert capsys.readouterr().out == f"lasso-motion {version()}\n"


@pytest.mark.parametrize("name", [*(command.name for command in cli.COMMANDS), "benchmark export", "benchmark score"])
def test_every_command_explains_itself(name: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main([*name.split(), "--help"]) == 0
    assert "--quiet" in capsys.readouterr().out


@pytest.mark.parametrize(
    "words",
    [
        "track IN -o OUT",
        "synth OUT --frames 1 --volume no.nii",
        "render IN no.mcap --volume no.stl -o OUT",
        "web --annotate IN -o OUT",
        "record OUT",
    ],
)
def test_an_output_that_exists_is_kept_and_said_alike(
    words: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    name = words.split(maxsplit=1)[0]
    if name == "record":
        pytest.importorskip("rclpy", reason="needs ROS 2")
    out = tmp_path / ("out.mp4" if name == "render" else "out.mcap")
    out.write_bytes(b"mine")
    files = {"IN": str(bundled_recording()), "OUT": str(out)}
    assert cli.main([files.get(word, word) for word in words.split()]) == 2
    said = f"lasso-motion {name}: {out} exists: choose another name or add --overwrite\n"
    assert capsys.readouterr() == ("", said)
    assert out.read_bytes() == b"mine"
    assert list(tmp_path.iterdir()) == [out]


def test_help_imports_nothing_heavy() -> None:
    code = (
        "import sys\nfrom lasso_motion_ros.cli.main import main\nmain(['--help'])\n"
        "sys.exit(', '.join({'numpy', 'cv2', 'scipy', 'rclpy'} & set(sys.modules)) or 0)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, encoding="utf-8", check=False)
    assert (done.returncode, done.stderr) == (0, "")


def test_progress_shows_on_a_terminal_only(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    assert list(progress(range(3), 3, "counting", quiet=False)) == [0, 1, 2]
    assert capsys.readouterr().err == ""
    terminal = SimpleNamespace(written="", isatty=lambda: True, flush=lambda: None)
    terminal.write = lambda text: setattr(terminal, "written", terminal.written + text)
    monkeypatch.setattr(sys, "stderr", terminal)
    assert list(progress(range(3), 3, "counting", quiet=True)) == [0, 1, 2]
    assert terminal.written == ""
    assert list(progress(range(3), 3, "counting", quiet=False)) == [0, 1, 2]
    assert "counting" in terminal.written
