"""The report: one page that needs nothing else, with every figure's own numbers in it."""

from __future__ import annotations

import base64
import re
from html.parser import HTMLParser
from pathlib import Path

import pytest
from support.drawn_recording import write_centrelines_only, write_input, write_result

from lasso_motion_ros.cli.main import main

STATES = ["TRACKING", "TRACKING", "DEGRADED", "LOST"]
PNG = b"\x89PNG\r\n\x1a\n"
JPEG = b"\xff\xd8\xff"


class Cells(HTMLParser):
    """The page's tables as rows of cells, and the addresses that it points to."""

    def __init__(self) -> None:
        super().__init__()
        self.rows: list[list[str]] = []
        self.sources: list[str] = []
        self._in_cell = False

    def handle_starttag(self, tag, attrs):
        self.sources += [value for name, value in attrs if name in {"src", "href"}]
        if tag == "tr":
            self.rows.append([])
        if tag in {"td", "th"}:
            self.rows[-1].append("")
            self._in_cell = True

    def handle_endtag(self, tag):
        if tag in {"td", "th"}:
            self._in_cell = False

    def handle_data(self, data):
        if self._in_cell:
            self.rows[-1][-1] += data


def read_page(path: Path) -> tuple[str, Cells]:
    text = path.read_text(encoding="utf-8")
    cells = Cells()
    cells.feed(text)
    return text, cells


@pytest.fixture
def recording(tmp_path: Path) -> Path:
    return write_input(tmp_path / "ring.mcap", [0.0, 4.0, 8.0, 4.0])


@pytest.mark.slow
def test_two_results_of_one_recording_stand_side_by_side(recording: Path, tmp_path: Path) -> None:
    ours = write_result(tmp_path / "ours.mcap", [0.0, 4.5, 10.5, None], STATES)
    theirs = write_result(tmp_path / "theirs & <i>.mcap", [0.0, 4.0, 8.0, 4.0], ["TRACKING"] * 4)
    report = tmp_path / "report"
    arguments = ["evaluate", "--quiet", str(recording), "--result", str(ours), "--result", str(theirs)]
    assert main([*arguments, "--report", str(report)]) == 0
    text, cells = read_page(report / "report.html")
    assert cells.sources
    for source in cells.sources:  # nothing is loaded from elsewhere
        kind, _, data = source.partition(";base64,")
        assert base64.b64decode(data).startswith({"data:image/png": PNG, "data:image/jpeg": JPEG}[kind])
    pictures = list(report.glob("*.png"))
    assert len(pictures) == len(cells.sources)
    # Films are photographs: as PNG they would make the page ten times as large.
    photographs = sum(source.startswith("data:image/jpeg") for source in cells.sources)
    assert photographs == len(list(report.glob("*worst*.png"))) > 0
    in_space = next(row for row in cells.rows if row[:2] == ["ring · ours", "1.50"])  # 0.5 and 2.5 mm off
    assert in_space[6:8] == ["6.00", "75 %"]  # static error of 4 and 8 mm, and the share removed
    assert ["z", "6.32", "1.80", "+1.50", "1.00"] in cells.rows  # rms of 4 and 8; of 0.5 and 2.5; their mean and sd
    assert [row[0] for row in cells.rows].count("ring · theirs & <i>") == 3  # names are words, whatever is in them
    assert "<i>" not in text
    assert "Brost et al. 2009, clinical" in text
    assert "1.0 ± 0.5" in text
    assert "2.50 mm off" in text
    assert not any(row and row[0].startswith("mean") for row in cells.rows)  # over methods there is none
    worst = sorted(path.name for path in report.glob("*worst*"))
    assert worst[0] == "ring_ours_worst_1.png"


def test_drawn_centrelines_alone_give_the_papers_table(tmp_path: Path) -> None:
    recording = write_centrelines_only(tmp_path / "drawn.mcap", [0.0, 4.0, 8.0])
    result = write_result(tmp_path / "result.mcap", [0.0, 4.0, 8.0], STATES[:3])
    assert main(["evaluate", "--quiet", str(recording), "--result", str(result), "--report", str(tmp_path / "r")]) == 0
    text, cells = read_page(tmp_path / "r" / "report.html")
    row = next(row for row in cells.rows if row[0] == "drawn" and "±" in row[2])
    assert [float(cell.split(" ")[0]) for cell in row[2:]] == pytest.approx([0.0] * 4, abs=0.02)
    assert "No truth in space" in text
    assert not list((tmp_path / "r").glob("*axes*"))


@pytest.mark.slow
def test_tracking_for_the_report_tells_timing_parameters_and_versions(recording: Path, tmp_path: Path) -> None:
    config = tmp_path / "mine.yaml"
    config.write_text("/**:\n  ros__parameters:\n    method: brost2009\n", encoding="utf-8")
    arguments = ["evaluate", "--quiet", str(recording), "--config", str(config), "--report", str(tmp_path / "r")]
    assert main([*arguments, "--worst", "1"]) == 0
    text, cells = read_page(tmp_path / "r" / "report.html")
    assert ["method", "brost2009", "appearance"] in cells.rows
    assert re.search(r"<td>numpy</td><td>\d", text)
    assert (tmp_path / "r" / "timing.png").exists()
    assert len(list((tmp_path / "r").glob("*worst*"))) == 1


@pytest.mark.slow
def test_several_recordings_are_compared_and_have_a_mean(recording: Path, tmp_path: Path) -> None:
    other = write_input(tmp_path / "other.mcap", [0.0, 2.0, 4.0])
    results = [
        write_result(tmp_path / "r1.mcap", [0.0, 5.0, 9.0, 5.0], ["TRACKING"] * 4),
        write_result(tmp_path / "r2.mcap", [0.0, 5.0, 7.0], ["TRACKING"] * 3),
    ]
    arguments = ["evaluate", "--quiet", str(recording), str(other), "--result", *map(str, results)]
    assert main([*arguments, "--report", str(tmp_path / "r")]) == 0
    _, cells = read_page(tmp_path / "r" / "report.html")
    assert next(row for row in cells.rows if row[0] == "mean (counts: sum)" and row[1] == "2.00")  # of 1 and 3 mm
    assert (tmp_path / "r" / "comparison.png").exists()


def test_a_report_that_cannot_be_written_is_one_line(
    recording: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    result = write_result(tmp_path / "out.mcap", [0.0, 4.5, 10.5, None], STATES)
    (tmp_path / "file").write_text("")
    arguments = ["evaluate", "--quiet", str(recording), "--result", str(result)]
    assert main([*arguments, "--report", str(tmp_path / "file")]) == 2
    error = capsys.readouterr().err
    assert "expected the name of a directory" in error
    assert error.count("\n") == 1
