"""Nothing lost, nothing overwritten: every output of every command, on a full disk and on Ctrl-C too."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from support.command_inputs import command_names, command_parser
from support.drawn_recording import write_input, write_result

from lasso_motion_ros.cli.main import main

FILE_WORDS = ("FILE", "DIR", "mcap", "dcm", "OUT")
STATES = ["TRACKING"] * 3


@pytest.mark.parametrize("name", command_names())
def test_what_a_command_reads_and_writes_is_declared(name: str) -> None:
    """What is not declared is not looked at: an output could replace an input."""
    parser = command_parser(name)
    named = {action.dest for action in parser._actions if any(word in str(action.metavar) for word in FILE_WORDS)}
    assert named
    assert named == set(parser.inputs) | set(parser.outputs)


OUTPUTS = [(name, output) for name in command_names() for output in command_parser(name).outputs]


@pytest.mark.parametrize(("name", "output"), OUTPUTS)
def test_no_output_of_any_command_is_an_input_or_another_output(
    name: str, output: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """By its own path, by a link, by a hard link, and by another path."""
    parser = command_parser(name)
    place = parser.outputs[output]
    folder = tmp_path / "folder"
    folder.mkdir()
    # A file in the directory, where the output is one, that the command itself writes there.
    owned = next((pattern.replace("*", "x").replace("[0-9]", "1") for pattern in place.owned), "")
    read = folder / (owned or "in.mcap")
    read.write_bytes(b"precious")
    (tmp_path / "link").symlink_to(read)
    os.link(read, tmp_path / "hard")
    is_directory = place.is_directory(folder)
    for given in parser.inputs:
        for path in [folder] if is_directory else [read, tmp_path / "link", tmp_path / "hard", folder / ".." / "hard"]:
            values = dict.fromkeys((*parser.inputs, *parser.outputs)) | {given: read, output: path}
            with pytest.raises(Exception, match="is an input, and no input is overwritten"):
                parser.check_files(parser.namespace(values))
    for other in parser.outputs.keys() - {output}:
        if parser.outputs[other].is_directory(folder):
            continue  # looked at from its own side: a file under a name that the directory writes itself
        values = dict.fromkeys((*parser.inputs, *parser.outputs))
        values |= {output: folder if is_directory else folder / "new", other: read if is_directory else folder / "new"}
        with pytest.raises(Exception, match="would be one file"):
            parser.check_files(parser.namespace(values))
    assert read.read_bytes() == b"precious"


@pytest.fixture
def drawn(tmp_path: Path) -> dict[str, Path]:
    place = tmp_path / "in"
    place.mkdir()
    recording = write_input(place / "ring.mcap", [0.0, 4.0, 8.0])
    return {"IN": recording, "RESULT": write_result(place / "result.mcap", [0.0, 4.0, 8.0], STATES)}


def contents(folder: Path) -> dict[Path, bytes]:
    return {path: path.read_bytes() for path in sorted(folder.rglob("*")) if path.is_file()}


@pytest.mark.parametrize(
    "words",
    [
        "track IN -o OUT --json IN",
        "evaluate IN --result RESULT --report REPORT",
        "evaluate IN --result RESULT --json OLD",
    ],
)
def test_nothing_is_replaced_unless_told_to(
    words: str, drawn: dict[str, Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    report = tmp_path / "report"
    report.mkdir()
    (report / "report.html").write_bytes(b"mine")
    (tmp_path / "old").write_bytes(b"mine")
    named = {**drawn, "OUT": tmp_path / "out.mcap", "REPORT": report, "OLD": tmp_path / "old"}
    before = contents(tmp_path)
    typed = [str(named.get(word, word)) for word in words.split()]
    assert main(typed) == 2
    said = capsys.readouterr().err
    assert "choose another name" in said
    assert said.count("\n") == 1
    if words.endswith("IN"):
        assert main([*typed, "--overwrite"]) == 2
    assert contents(tmp_path) == before


FULL_DISK = """
import resource, signal, sys
from lasso_motion_ros.cli.main import main
limit = int(sys.argv[1])
for line in sys.stdin:
    resource.setrlimit(resource.RLIMIT_FSIZE, (limit, resource.RLIM_INFINITY))
    print(main(line.split()), flush=True)
"""


def test_a_full_disk_leaves_what_was_there(drawn: dict[str, Path], tmp_path: Path) -> None:
    """In one real process that may write no file beyond some kilobytes, as on a disk that is nearly full."""
    pytest.importorskip("av")
    pytest.importorskip("trimesh")
    out = tmp_path / "out"
    (out / "frames").mkdir(parents=True)
    (out / "report").mkdir()
    for old in ("a.mcap", "b.mp4", "c.json", "frames/plane_a_00000.png", "report/report.html", "report/mine.txt"):
        (out / old).write_bytes(b"old")
    small = tmp_path / "in" / "small.yaml"
    small.write_text("pairs: 1\ngeometry: {size_px: 128}\n")
    surface = tmp_path / "in" / "ball.stl"
    from support.rendering_inputs import ellipsoid_mesh

    from lasso_motion_ros.overlay.surface_files import write_stl

    write_stl(surface, ellipsoid_mesh((0.02, 0.015, 0.012), rows=20, columns=11), "mm")
    render = f"render --quiet {drawn['IN']} {drawn['RESULT']} --volume {surface} --units mm --overwrite -o"
    commands = {
        f"synth --quiet {out}/a.mcap --scenario {small} --overwrite": "a.mcap",
        f"track --quiet {drawn['IN']} -o {out}/a.mcap --overwrite": "a.mcap",
        f"track --quiet {drawn['IN']} -o {out}/new.mcap": "new.mcap",
        f"{render} {out}/b.mp4": "b.mp4",
        f"{render} {out}/new.mp4": "new.mp4",
        f"{render} {out}/frames": "frames",
        f"{render} {out}/new/deep": "new",
        f"evaluate --quiet {drawn['IN']} --result {drawn['RESULT']} --report {out}/report --overwrite": "report",
    }
    before = contents(out)
    done = subprocess.run(
        [sys.executable, "-c", FULL_DISK, "8000"],
        input="".join(f"{command}\n" for command in commands),
        capture_output=True,
        encoding="utf-8",
        check=False,
        timeout=200,
    )
    statuses = [line for line in done.stdout.splitlines() if line.isdigit()]
    assert statuses == ["2"] * len(commands), done.stdout + done.stderr
    said = done.stderr.splitlines()
    assert len(said) == len(commands), done.stderr
    for line, (command, name) in zip(said, commands.items(), strict=True):
        assert line.startswith(f"lasso-motion {command.split()[0]}: {out}"), line
        assert f"/{name}" in line, line
        assert "unfinished" not in line, line
        assert "cannot be written: File too large" in line, line
    assert contents(out) == before
    assert not (out / "new").exists()


@pytest.mark.parametrize(("number", "status"), [(signal.SIGINT, 130), (signal.SIGTERM, 143)])
def test_interrupted_half_way_nothing_is_left_and_the_old_is_there(
    number: signal.Signals, status: int, tmp_path: Path
) -> None:
    old = tmp_path / "old.mcap"
    old.write_bytes(b"old")
    words = ["synth", str(old), "--frames", "500", "--scenario", "01_clear_view", "--overwrite"]
    child = subprocess.Popen(
        [sys.executable, "-m", "lasso_motion_ros.cli.main", *words], stderr=subprocess.PIPE, encoding="utf-8"
    )
    with child:
        deadline = time.monotonic() + 100
        while not list(tmp_path.glob(".old.mcap.*")):
            assert time.monotonic() < deadline
            assert child.poll() is None
            time.sleep(0.02)
        child.send_signal(number)
        try:
            _, said = child.communicate(timeout=60)
        finally:
            child.kill()
        assert said == "lasso-motion synth: interrupted\n"
        # Python itself ends by SIGINT where that came within an `exec`: to a shell it is 130 as well.
        assert child.returncode in (status, -number)
    assert contents(tmp_path) == {old: b"old"}


def test_what_cannot_be_printed_is_one_line() -> None:
    """Standard output on a full disk."""
    with Path("/dev/full").open("w") as full:
        done = subprocess.run(
            [sys.executable, "-m", "lasso_motion_ros.cli.main", "synth", "--list"],
            stdout=full, stderr=subprocess.PIPE, encoding="utf-8", check=False,
        )  # fmt: skip
    assert (done.returncode, done.stderr) == (2, "lasso-motion synth: No space left on device\n")


CTRL_C = """
import importlib.abc, os, signal, sys

class Interrupt(importlib.abc.MetaPathFinder):
    def find_spec(self, name, path, target=None):
        if name == "numpy":
            os.kill(os.getpid(), signal.SIGINT)

sys.meta_path.insert(0, Interrupt())
from lasso_motion_ros.cli.start import start
sys.exit(start())
"""


def test_ctrl_c_during_imports_ends_it_quietly() -> None:
    done = subprocess.run(
        [sys.executable, "-c", CTRL_C, "synth", "--list"], capture_output=True, encoding="utf-8", check=False
    )
    assert (done.returncode, done.stdout, done.stderr) == (-signal.SIGINT, "", "")
