"""Files and directories are written whole or not at all; what was there before survives."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from lasso_motion_ros.core.errors import RecordingError
from lasso_motion_ros.core.output_checks import OutputPlace, check_free, check_outputs
from lasso_motion_ros.core.output_files import (
    EarlierFile,
    UnfinishedFile,
    whole_directory,
    whole_file,
    write_json,
    write_text,
)


def interrupted(work: Callable[[], None]) -> None:
    with pytest.raises(KeyboardInterrupt):
        work()


def test_a_file_is_replaced_at_the_end_with_its_access_rights_and_its_links(tmp_path: Path) -> None:
    path, link = tmp_path / "a.json", tmp_path / "link.json"
    path.write_text("old")
    path.chmod(0o600)
    link.symlink_to(path)
    with whole_file(link) as unfinished:
        unfinished.write_text("new")
        assert path.read_text() == "old"
    assert (path.read_text(), link.is_symlink(), path.stat().st_mode & 0o777) == ("new", True, 0o600)
    assert sorted(tmp_path.iterdir()) == [path, link]


def test_an_interrupt_leaves_the_old_file_and_nothing_else(tmp_path: Path) -> None:
    path = tmp_path / "a.json"
    path.write_text("old")

    def work() -> None:
        with whole_file(path) as unfinished:
            unfinished.write_text("half")
            raise KeyboardInterrupt

    interrupted(work)
    assert (path.read_text(), list(tmp_path.iterdir())) == ("old", [path])
    # Even before anybody could see to it.
    unfinished = UnfinishedFile(path)
    unfinished.path.write_text("half")
    del unfinished
    assert list(tmp_path.iterdir()) == [path]


def test_a_directory_is_written_as_a_whole_or_not_at_all(tmp_path: Path) -> None:
    directory = tmp_path / "new" / "report"

    def work() -> None:
        with whole_directory(directory, ("page_*",)) as staged:
            write_text(staged / "page_3", "half")
            raise KeyboardInterrupt

    interrupted(work)
    assert list(tmp_path.iterdir()) == []
    with whole_directory(directory, ("page_*",)) as staged:
        for number in range(3):
            write_text(staged / f"page_{number}", "old")
    (directory / "mine").write_text("mine")
    before = sorted(directory.iterdir())
    interrupted(work)
    assert sorted(directory.iterdir()) == before
    with whole_directory(directory, ("page_*",)) as staged:
        write_text(staged / "page_1", "new")
    # What an earlier run left is gone, what is not its own stays.
    assert {path.name: path.read_text() for path in directory.iterdir()} == {"mine": "mine", "page_1": "new"}


def test_a_folder_of_a_directory_takes_the_place_of_one_of_its_name(tmp_path: Path) -> None:
    (tmp_path / "part").mkdir()
    (tmp_path / "part" / "old.txt").write_text("old")
    (tmp_path / "other").mkdir()
    with whole_directory(tmp_path, ("other",)) as staged:
        (staged / "part").mkdir()
        (staged / "part" / "new.txt").write_text("new")
    assert sorted(path.relative_to(tmp_path).as_posix() for path in tmp_path.rglob("*")) == [
        "other",
        "part",
        "part/new.txt",
    ]


def test_what_a_killed_process_had_begun_is_no_loss_and_is_taken_away(tmp_path: Path) -> None:
    directory = tmp_path / "report"
    words = f"with whole_directory(Path({str(directory)!r})) as staged: os._exit(0)"
    code = (
        f"import os; from pathlib import Path; from lasso_motion_ros.core.output_files import whole_directory\n{words}"
    )
    subprocess.run([sys.executable, "-c", code], check=True)
    (left,) = directory.iterdir()
    at_work = directory / f".files.{os.getppid()}.unfinished"
    at_work.mkdir()
    check_free(directory, overwrite=False)
    with whole_directory(directory) as staged:
        (staged / "page").write_text("new")
    assert not left.exists()
    assert sorted(path.name for path in directory.iterdir()) == [at_work.name, "page"]


def test_a_file_that_a_killed_process_had_begun_is_taken_away(tmp_path: Path) -> None:
    path = tmp_path / "result[1].mcap"
    words = f"with whole_file(Path({str(path)!r})) as begun: begun.write_text('half'); os._exit(0)"
    code = f"import os; from pathlib import Path; from lasso_motion_ros.core.output_files import whole_file\n{words}"
    subprocess.run([sys.executable, "-c", code], check=True)
    (left,) = tmp_path.iterdir()
    at_work, other = tmp_path / f".{path.name}.{os.getppid()}.unfinished", tmp_path / ".other.mcap.0.unfinished"
    at_work.touch()
    other.touch()
    with whole_file(path) as begun:
        begun.write_text("whole")
    assert not left.exists()
    assert sorted(one.name for one in tmp_path.iterdir()) == sorted([at_work.name, other.name, path.name])


def test_a_file_of_a_directory_that_cannot_be_replaced_leaves_all_as_they_were(tmp_path: Path) -> None:
    for name in ("a.txt", "old.txt"):
        (tmp_path / name).write_text(name)
    (tmp_path / "b.txt").mkdir()  # in the way of the second one
    (tmp_path / "b.txt" / "mine").write_text("mine")
    before = sorted(tmp_path.rglob("*"))

    def work() -> None:
        with whole_directory(tmp_path, ("*.txt",)) as staged:
            for name in ("a.txt", "b.txt", "c.txt"):
                (staged / name).write_text("new")

    with pytest.raises(RecordingError, match="cannot be written"):
        work()
    assert sorted(tmp_path.rglob("*")) == before
    assert [(tmp_path / name).read_text() for name in ("a.txt", "old.txt")] == ["a.txt", "old.txt"]


def test_an_earlier_file_comes_back_or_is_kept(tmp_path: Path) -> None:
    path = tmp_path / "r.mcap"
    EarlierFile(path).bring_back()
    assert list(tmp_path.iterdir()) == []
    path.write_text("old")
    earlier = EarlierFile(path)
    path.write_text("")
    earlier.bring_back()
    assert (path.read_text(), list(tmp_path.iterdir())) == ("old", [path])
    earlier = EarlierFile(path)
    path.write_text("new")
    kept = earlier.keep()
    assert (kept, kept and kept.read_text(), path.read_text()) == (tmp_path / "r.earlier.mcap", "old", "new")
    earlier = EarlierFile(path)
    path.write_text("newer")
    earlier.drop()
    assert (path.read_text(), sorted(tmp_path.iterdir())) == ("newer", [kept, path])


def test_what_cannot_be_written_is_said(tmp_path: Path) -> None:
    with pytest.raises(RecordingError, match=r"a\.json cannot be written: No such file or directory"):
        write_json(tmp_path / "none" / "a.json", {})
    (tmp_path / "file").write_text("")
    with (
        pytest.raises(RecordingError, match="file/report: cannot be made: Not a directory"),
        whole_directory(tmp_path / "file" / "report"),
    ):
        pass


@pytest.mark.parametrize("name", ["/dev/null", "/dev/stdout"])
def test_a_device_is_written_as_it_goes(name: str) -> None:
    if not Path(name).exists() or Path(name).is_file():
        pytest.skip("standard output is a file")
    check_outputs([OutputPlace(Path(name)), OutputPlace(Path(name))], [Path(name)], overwrite=False)
    write_text(Path(name), "")
    assert Path(name).exists()


@pytest.mark.parametrize(
    ("name", "is_directory", "said"),
    [
        ("file", True, "is a file: expected the name of a directory"),
        ("folder", False, "is a directory: expected the name of a file"),
        ("none/a.json", False, "cannot be written: there is no directory"),
        ("file/a.json", False, "cannot be written: .*file is no directory"),
        ("loop/a.json", False, "cannot be written"),
        ("x" * 300, False, "cannot be written: File name too long"),
        ("locked", False, "locked cannot be written: it is protected against writing"),
        ("closed/a.json", False, "closed is protected against writing"),
        ("closed/report", True, "closed is protected against writing"),
    ],
)
def test_what_is_in_the_way_is_said_before_the_work(
    name: str, is_directory: bool, said: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "file").write_text("")
    (tmp_path / "locked").write_text("")
    for folder in ("folder", "closed"):
        (tmp_path / folder).mkdir()
    (tmp_path / "loop").symlink_to(tmp_path / "loop")
    # Root may write everywhere: what the system would say to anybody else.
    closed = (tmp_path / "locked", tmp_path / "closed")
    monkeypatch.setattr(os, "access", lambda path, mode: Path(path) not in closed)
    with pytest.raises(RecordingError, match=said):
        check_outputs([OutputPlace(tmp_path / name, is_directory)], [], overwrite=True)


def test_a_directory_that_holds_only_logs_is_free(tmp_path: Path) -> None:
    (tmp_path / "logs").mkdir()
    check_outputs([OutputPlace(tmp_path, True, ("a",), ("logs",))], [], overwrite=False)
    (tmp_path / "a").write_text("")
    with pytest.raises(RecordingError, match="exists: choose another name or add --overwrite"):
        check_outputs([OutputPlace(tmp_path, True, ("a",), ("logs",))], [], overwrite=False)


def test_a_file_may_go_into_a_directory_that_is_an_output_too(tmp_path: Path) -> None:
    report = OutputPlace(tmp_path / "report", True, ("page.html",))
    check_outputs([OutputPlace(tmp_path / "report" / "all.json"), report], [], overwrite=False)
    with pytest.raises(RecordingError, match="would be one file"):
        check_outputs([OutputPlace(tmp_path / "report" / "page.html"), report], [], overwrite=False)
