"""Many recordings at once: the same bytes whoever does the work, nothing done twice, and a failure is a row."""

from __future__ import annotations

import csv
import json
import os
import shutil
import signal
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("mcap")

from support.drawn_recording import write_input

from lasso_motion_ros.cli.main import main
from lasso_motion_ros.config.stream import StreamConfig
from lasso_motion_ros.tools.archive_job import ArchiveJob, code_version, run_job
from lasso_motion_ros.tools.archive_tracking import TrackingWork

NAMES = ("a", "p/b")


@pytest.fixture(scope="module")
def archive(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two recordings at two depths, a hidden one, and one that is none."""
    folder = tmp_path_factory.mktemp("archive")
    (folder / "p").mkdir()
    for number, name in enumerate(NAMES):
        write_input(folder / f"{name}.mcap", [0.0, 1.0 + number, 2.0])
    (folder / "p" / "none.mcap").write_bytes(b"no recording")
    (folder / ".q").mkdir()
    (folder / ".q" / "b.mcap").symlink_to(folder / "a.mcap")
    (folder / ".hidden.mcap").write_bytes(b"not looked at")
    return folder


@pytest.fixture(scope="module")
def serial(archive: Path, tmp_path_factory: pytest.TempPathFactory) -> dict[str, bytes]:
    """The results of `track` on each recording by itself."""
    folder = tmp_path_factory.mktemp("serial")
    (folder / "p").mkdir()
    for name in NAMES:
        assert main(["track", str(archive / f"{name}.mcap"), "-o", str(folder / f"{name}.mcap"), "--quiet"]) == 0
    return results(folder)


def results(folder: Path) -> dict[str, bytes]:
    return {str(path.relative_to(folder)): path.read_bytes() for path in sorted(folder.rglob("*.mcap"))}


def table(folder: Path) -> dict[str, dict[str, str]]:
    with (folder / "archive.csv").open(encoding="utf-8", newline="") as file:
        return {row["result"]: row for row in csv.DictReader(file)}


def track(*words: Any) -> int:
    return main(["track", *map(str, words)])


@contextmanager
def killing_whoever_is_at(result: str, folder: Path) -> Iterator[list[int]]:
    """Kill the process that works on a result, once; the list says which."""
    killed: list[int] = []

    def kill() -> None:
        deadline = time.monotonic() + 100
        while not killed and time.monotonic() < deadline:
            for staged in folder.rglob(f".{result}@*.unfinished"):
                killed.append(int(staged.name.split("@")[2].removesuffix(".unfinished")))
                os.kill(killed[0], signal.SIGKILL)
                return
            time.sleep(0.001)

    thread = threading.Thread(target=kill)
    thread.start()
    try:
        yield killed
    finally:
        thread.join()


@pytest.mark.slow
def test_processes_write_what_one_writes_though_one_is_killed(
    archive: Path, serial: dict[str, bytes], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "out"
    with killing_whoever_is_at("b.mcap", out) as killed:
        assert track(archive, "-o", out, "--workers", 2, "--json", tmp_path / "rows.json") == 3
    said = capsys.readouterr()
    assert len(killed) == 1
    assert results(out) == serial
    assert "2 of 3 recordings done, 1 failed; 6 pairs" in said.out
    assert said.err.startswith(f"lasso-motion track: {archive / 'p' / 'none.mcap'} is not an MCAP recording")
    assert said.err.count("\n") == 1
    rows = table(out)
    assert {name: row["status"] for name, row in rows.items()} == {
        "a.mcap": "done",
        "p/b.mcap": "done",
        "p/none.mcap": "failed",
    }
    assert (rows["a.mcap"]["pairs"], rows["a.mcap"]["TRACKING"]) == ("3", "3")
    assert "is not an MCAP recording" in rows["p/none.mcap"]["reason"]
    assert [row["result"] for row in json.loads((tmp_path / "rows.json").read_text())] == sorted(rows)
    assert not [path for path in out.rglob("*") if "unfinished" in path.name]
    _gone_on_with(archive, out, tmp_path, capsys)


def _gone_on_with(archive: Path, out: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A further run leaves alone what is finished, and does not replace anything else unless told to."""
    first = {path: (path.stat().st_mtime_ns, path.read_bytes()) for path in out.rglob("*.mcap")}
    (out / "p" / "b.mcap").write_bytes(b"mine")
    other = tmp_path / "other.yaml"
    other.write_text("lasso_tracker:\n  ros__parameters:\n    polarity: dark\n")
    assert track(archive, "-o", out, "--workers", 1, "--config", other) == 2
    said = capsys.readouterr()
    assert f"{out}/p/b.mcap exists, not made by such a run" in said.err
    assert f"{out}/a.mcap exists, made of another input, configuration or version" in said.err
    assert (out / "p" / "b.mcap").read_bytes() == b"mine"
    assert {row["status"] for row in table(out).values()} == {"failed"}
    assert track(archive, "-o", out, "--workers", 1, "--overwrite") == 3
    assert "2 of 3 recordings done (1 of them before), 1 failed; 3 pairs" in capsys.readouterr().out
    now = {path: (path.stat().st_mtime_ns, path.read_bytes()) for path in out.rglob("*.mcap")}
    assert now[out / "a.mcap"] == first[out / "a.mcap"]
    assert now[out / "p" / "b.mcap"][1] == first[out / "p" / "b.mcap"][1]
    assert [row["status"] for row in table(out).values()] == ["done", "done", "failed"]
    _scored(archive, out, tmp_path, capsys)


def _scored(archive: Path, out: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The folder alone tells what belongs together."""
    summary = tmp_path / "summary.csv"
    assert main(["evaluate", str(out), "--csv", str(summary)]) == 3
    said = capsys.readouterr()
    assert f"lasso-motion evaluate: {archive}/p/none.mcap is not an MCAP recording" in said.err
    assert "p/b " in said.out
    with summary.open(encoding="utf-8", newline="") as file:
        rows = {row["name"]: row for row in csv.DictReader(file)}
    assert {name: row["status"] for name, row in rows.items()} == {"a": "done", "p/b": "done", "p/none": "failed"}
    assert (rows["p/b"]["pairs"], rows["p/b"]["recording"]) == ("3", str(archive / "p" / "b.mcap"))
    assert float(rows["p/b"]["centre_error_mm"]) < 0.5
    assert main(["evaluate", str(archive / "a.mcap"), "--workers", "2"]) == 2
    assert "are for results of an archive" in capsys.readouterr().err


@pytest.mark.slow
def test_a_cluster_writes_what_one_process_writes_though_a_worker_is_killed(
    archive: Path, serial: dict[str, bytes], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    distributed = pytest.importorskip("distributed")
    out = tmp_path / "out"
    assert track(archive, "-o", out, "--scheduler", "head") == 2
    assert "expected an address such as tcp://host:8786, found 'head'" in capsys.readouterr().err
    assert not out.exists()
    cluster = distributed.LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None)
    with cluster, killing_whoever_is_at("b.mcap", out) as killed:
        assert track(archive, "-o", out, "--scheduler", cluster.scheduler_address) == 3
        assert len(killed) == 1
    assert results(out) == serial
    assert "2 of 3 recordings done, 1 failed" in capsys.readouterr().out
    assert not [path for path in out.rglob("*") if "unfinished" in path.name]


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ("IN/a.mcap IN/p/b.mcap -o OUT", "found 2 recordings: --workers N takes several, and -o is a folder then"),
        ("IN/*.mcap -o OUT", "IN/*.mcap is no recording: --workers N takes several"),
        ("TOP -o OUT", "TOP is no recording: --workers N takes several, and -o is a folder then"),
        ("IN/p/b.mcap IN/.q/b.mcap -o OUT --workers 1", "both results would be called b; name the folder above both"),
        ("IN/nothing -o OUT --workers 1", "IN/nothing: there is no such recording"),
        (
            "IN/*/*.db3 -o OUT --workers 1",
            "IN/*/*.db3: expected recordings (.mcap files or bag directories)",
        ),
        ("IN -o IN --workers 1", "IN/a.mcap is an input, and no input is overwritten: choose another name"),
        ("IN/p/b.mcap -o IN/p --workers 1", "IN/p/b.mcap is an input, and no input is overwritten"),
        ("IN/a.mcap -o OUT --workers 0", "must be at least 1, found 0"),
        ("IN/a.mcap -o OUT --workers 1 --scheduler x", "not allowed with argument"),
    ],
)
def test_what_cannot_be_meant_is_said_before_anything_runs(
    words: str, said: str, archive: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    def there(text: str) -> str:
        text = text.replace("TOP", str(archive.parent)).replace("IN", str(archive))
        return text.replace("OUT", str(tmp_path / "out"))

    assert track(*there(words).split()) == 2
    assert there(said) in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


def test_a_worker_of_another_version_does_nothing(archive: Path, tmp_path: Path) -> None:
    work = TrackingWork(archive / "a.mcap", StreamConfig())
    finished = run_job(ArchiveJob(work, "a", tmp_path, "a.mcap", "0.0.1+abc", overwrite=False))
    said = f"this worker has lasso_motion_ros {code_version()}, asked for was 0.0.1+abc"
    assert (finished.row.status, finished.row.reason) == ("failed", said)
    assert results(tmp_path) == {}


def test_evaluate_takes_patterns(archive: Path, capsys: pytest.CaptureFixture[str]) -> None:
    result = str(archive / "p" / "none.mcap")
    assert main(["evaluate", str(archive / "p" / "n*.mcap"), "--result", result]) == 2
    assert "p/none.mcap is not an MCAP recording" in capsys.readouterr().err
    assert main(["evaluate", str(archive / "p" / "*.mcap"), "--result", result]) == 2
    assert "found 1 for 2 recordings" in capsys.readouterr().err


def test_results_that_lie_among_the_recordings_are_no_recordings(archive: Path, tmp_path: Path) -> None:
    from msg_adapters.recordings.recording_search import find_recordings

    copy = tmp_path / "copy"
    shutil.copytree(archive, copy)
    (copy / "out").mkdir()
    shutil.copy(copy / "a.mcap", copy / "out" / "a.mcap")
    names = [str(one.name) for one in find_recordings([copy], without=[copy / "out"])]
    assert names == ["a", "p/b", "p/none"]
