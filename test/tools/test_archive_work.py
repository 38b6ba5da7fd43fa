"""`import` and `render` over folders, by real workers: what one command makes of one, for each."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

pytest.importorskip("mcap")

from support.drawn_recording import write_input, write_result
from support.rendering_inputs import ellipsoid_mesh

from lasso_motion_ros.cli.main import main
from lasso_motion_ros.tools.archive_rows import DONE, ArchiveRow, read_rows, row_file, write_row


def says(kind: str, partner: str = "") -> Callable[[Any], None]:
    """What an object says of its plane, and of the other plane's object."""

    def change(dataset: Any) -> None:
        from pydicom.dataset import Dataset

        dataset.ImageType = ["ORIGINAL", "PRIMARY", kind]
        dataset.SOPInstanceUID = f"1.2.3.{int(Path(dataset.filename).name[-1])}"
        if partner:
            item = Dataset()
            item.ReferencedSOPInstanceUID = f"1.2.3.{partner}"
            dataset.ReferencedImageSequence = [item]

    return change


def write_object(path: Path, primary_deg: float, change: Callable[[Any], None] = lambda dataset: None) -> Path:
    from support.xa_objects import Shot, write_classic

    path.parent.mkdir(parents=True, exist_ok=True)
    pictures = [np.full((64, 64), 90 + index, np.uint8) for index in range(3)]
    return write_classic(path, Shot(pictures, [primary_deg] * 3, [0.0] * 3, change=change))


def test_pairs_are_found_and_told_apart(tmp_path: Path) -> None:
    pytest.importorskip("pydicom", reason="needs the dicom extra")
    from msg_adapters.dicom.pair_search import find_pairs

    # The file names mislead: the frontal view, or whoever says so, is plane A.
    write_object(tmp_path / "angles" / "1", 60.0)
    write_object(tmp_path / "angles" / "2", -30.0)
    write_object(tmp_path / "names" / "1", -30.0, says("BIPLANE B"))
    write_object(tmp_path / "names" / "2", 60.0, says("BIPLANE A"))
    for number, (kind, partner) in enumerate([("A", "3"), ("A", "2"), ("B", ""), ("B", "")]):
        write_object(tmp_path / "study" / f"run_{number}", 0.0, says(f"BIPLANE {kind}", partner))
    write_object(tmp_path / "alone" / "1", 0.0)
    (tmp_path / "alone" / "notes.txt").write_text("no DICOM")
    found = {str(one.name): one for one in find_pairs([tmp_path])}
    assert {name: [path.name for path in one.paths] for name, one in found.items() if not one.problem} == {
        "angles": ["2", "1"],
        "names": ["2", "1"],
        "study/run_0": ["run_0", "run_3"],
        "study/run_1": ["run_1", "run_2"],
    }
    assert {name: one.problem[:17] for name, one in found.items() if one.problem} == {"alone": "found 1 XA object"}


def test_a_folder_of_objects_is_imported(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    pytest.importorskip("pydicom", reason="needs the dicom extra")
    place, out = tmp_path / "dicom", tmp_path / "out"
    a = write_object(place / "p" / "1.dcm", -30.0)
    b = write_object(place / "p" / "2.dcm", 60.0)
    write_object(place / "q" / "1.dcm", 60.0)
    assert main(["import", str(place), "-o", str(out), "--workers", "1"]) == 3
    said = capsys.readouterr()
    assert "1 of 2 recordings done, 1 failed; 3 pairs" in said.out
    assert f"{place / 'q'}: found 1 XA object, expected two that tell" in said.err
    assert main(["import", str(a), str(b), "-o", str(tmp_path / "p.mcap"), "--quiet"]) == 0
    assert (out / "p.mcap").read_bytes() == (tmp_path / "p.mcap").read_bytes()
    assert main(["import", str(a), "-o", str(tmp_path / "x.mcap")]) == 2
    assert "expected two objects, plane A's and plane B's, found 1" in capsys.readouterr().err


def test_a_folder_of_results_is_rendered(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    pytest.importorskip("av", reason="needs the video extra")
    pytest.importorskip("trimesh", reason="needs the overlay extra")
    from lasso_motion_ros.overlay.surface_files import write_stl

    recording = write_input(tmp_path / "ring.mcap", [0.0, 4.0])
    results = tmp_path / "results"
    (results / "p").mkdir(parents=True)
    write_result(results / "p" / "ring.mcap", [0.0, 4.0], ["TRACKING"] * 2)
    write_row(row_file(results, "p/ring.mcap"), ArchiveRow(str(recording), "p/ring.mcap", DONE))
    surface = tmp_path / "ball.stl"
    write_stl(surface, ellipsoid_mesh((0.02, 0.015, 0.012), rows=20, columns=11), "mm")
    volume = ["--volume", str(surface), "--units", "mm"]
    assert main(["render", str(results), *volume, "-o", str(tmp_path / "out"), "--workers", "1"]) == 0
    assert (tmp_path / "out" / "p" / "ring.mp4").stat().st_size > 1000
    (row,) = read_rows(tmp_path / "out")
    assert (row.figures["pairs"], row.figures["compensated"]) == (2, 2)
    capsys.readouterr()
    assert main(["render", str(recording), *volume, "-o", str(tmp_path / "x.mp4")]) == 2
    assert "no result: name IN.mcap and RESULT.mcap" in capsys.readouterr().err
