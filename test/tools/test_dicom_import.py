"""DICOM XA in, the same poses out: phantom sequences written as an archive has them, imported and tracked."""

from __future__ import annotations

import dataclasses
import json
from datetime import UTC, datetime
from pathlib import Path

import numpy as np
import pytest
from mcap.reader import make_reader

pytest.importorskip("pydicom", reason="needs the dicom extra")

from support.xa_objects import Shot, write_classic, write_enhanced

from lasso_motion_ros.cli.main import main
from lasso_motion_ros.phantom import SimulatedPair, Simulator, load_scenario
from lasso_motion_ros.tools.dicom_import import NEUTRAL_START_NS
from lasso_motion_ros.tools.offline_tracking import track_recording
from lasso_motion_ros.tools.synthesis import write_recording
from msg_adapters.poses import decode_pose
from msg_adapters.recordings.reader import RecordingReader

PAIRS = 8
SIZE = 512
SCENARIO = f"""
pairs: {PAIRS}
rate_hz: 4.0
plane_b_offset: 0.5
seed: 11
geometry: {{size_px: {SIZE}, plane_a: {{lao_deg: -30.0, cranial_deg: 5.0}}, plane_b: {{lao_deg: 60.0}}}}
lasso: {{centre_mm: [14.0, 2.0, 12.0], normal: [0.27, -0.73, 0.62], diameter_mm: 20.0}}
breathing: {{amplitude_mm: 12.0, period_s: 3.0}}
imaging: {{quanta: 60.0}}
events:
  - {{kind: table_pan, first: 4, last: 6, shift_mm: [3.0, -2.0, 6.0]}}
"""


@dataclasses.dataclass
class Phantom:
    simulator: Simulator
    pairs: list[SimulatedPair]
    seeds: Path
    poses: list[np.ndarray]

    def shot(self, plane: str) -> Shot:
        geometry = self.simulator.scenario.geometry
        angles = getattr(geometry, f"plane_{plane}")
        frames = [pair.images.frames[plane] for pair in self.pairs]
        pitch = geometry.field_mm / geometry.size_px
        return Shot(
            [frame.pixels for frame in frames],
            [angles.lao_deg] * PAIRS,
            [angles.cranial_deg] * PAIRS,
            spacing_mm=(pitch, pitch),
            sid_mm=geometry.source_detector_mm,
            sod_mm=geometry.source_object_mm,
            begin_s=(frames[0].stamp_ns - self.pairs[0].images.frames["a"].stamp_ns) / 1e9,
            table_mm=[(12.0 + 3.0 * done, 140.0 - 2.0 * done, -75.0 + 6.0 * done) for done in pan()],
            bits=8 if frames[0].pixels.dtype == np.uint8 else 16,
        )


def pan() -> list[float]:
    """How much of the table's way is done, by frame."""
    return [0.0, 0.0, 0.0, 0.0, 1 / 3, 2 / 3, 1.0, 1.0]


def poses(recording: Path) -> list[np.ndarray]:
    return [decode_pose(one.message) for one in RecordingReader(recording).messages() if one.topic == "/motion_raw"]


def write_seeds(path: Path, simulator: Simulator) -> Path:
    lines = []
    for plane, points in simulator.seeds().items():
        lines.append(f"plane_{plane}:\n  points: {np.asarray(points).tolist()}\n")
    path.write_text("".join(lines))
    return path


@pytest.fixture(scope="module")
def phantom(tmp_path_factory: pytest.TempPathFactory) -> Phantom:
    place = tmp_path_factory.mktemp("phantom")
    (place / "scenario.yaml").write_text(SCENARIO)
    simulator = Simulator(load_scenario(str(place / "scenario.yaml")))
    pairs = list(simulator.pairs())
    simulator.r_peaks_ns = list  # type: ignore[method-assign]  # no ECG: the objects mark none, either
    write_recording(place / "direct.mcap", simulator, pairs, overwrite=False)
    seeds = write_seeds(place / "seeds.yaml", simulator)
    track_recording(place / "direct.mcap", place / "result.mcap", seeds=seeds)
    found = poses(place / "result.mcap")
    assert len(found) == PAIRS
    return Phantom(simulator, pairs, seeds, found)


def tracked(phantom: Phantom, place: Path, *options: str) -> list[np.ndarray]:
    arguments = [
        "import",
        str(place / "A.dcm"),
        str(place / "B.dcm"),
        "-o",
        str(place / "in.mcap"),
        "--quiet",
        *options,
    ]
    assert main(arguments) == 0
    track_recording(place / "in.mcap", place / "out.mcap", seeds=phantom.seeds)
    return poses(place / "out.mcap")


def largest_difference_m(one: list[np.ndarray], other: list[np.ndarray]) -> float:
    assert len(one) == len(other)
    return max(float(np.abs(a - b).max()) for a, b in zip(one, other, strict=True))


def test_a_classic_pair_gives_the_poses_of_the_direct_recording(phantom: Phantom, tmp_path: Path) -> None:
    for plane in "ab":
        write_classic(tmp_path / f"{plane.upper()}.dcm", phantom.shot(plane))
    assert largest_difference_m(tracked(phantom, tmp_path), phantom.poses) < 1e-6


def test_an_enhanced_pair_gives_the_poses_of_the_direct_recording(phantom: Phantom, tmp_path: Path) -> None:
    """The field is cut out of a larger detector of elements half as wide as the pixels."""
    for plane in "ab":
        shot = phantom.shot(plane)
        element = shot.spacing_mm[0] / 2.0
        corner = (100.0, 120.0)
        middle = tuple(one + SIZE - 0.5 for one in corner)
        write_enhanced(
            tmp_path / f"{plane.upper()}.dcm", shot, isocentre=middle, origin=corner, element_mm=(element, element)
        )
    assert largest_difference_m(tracked(phantom, tmp_path), phantom.poses) < 1e-6


@pytest.fixture
def small(tmp_path: Path) -> Path:
    write_small(tmp_path)
    return tmp_path


def write_small(place: Path, **changes: object) -> None:
    pictures = list(np.random.default_rng(1).integers(0, 255, (3, 40, 50)))
    for name, angle in (("A", -30.0), ("B", 60.0)):
        shot = Shot(pictures, [angle] * 3, [0.0] * 3, begin_s=0.05 if name == "B" else 0.0, **changes)  # type: ignore[arg-type]
        write_classic(place / f"{name}.dcm", shot)


def run(place: Path, *options: str) -> int:
    return main(["import", str(place / "A.dcm"), str(place / "B.dcm"), "-o", str(place / "out.mcap"), *options])


def test_no_patient_data_unless_asked_for(small: Path) -> None:
    """Neither name nor number nor day: not in the messages, not in the metadata."""
    assert run(small, "--quiet") == 0
    stamps = [one.log_time_ns for one in RecordingReader(small / "out.mcap").messages()]
    assert min(stamps) == NEUTRAL_START_NS
    assert metadata(small / "out.mcap").keys() == {"rosbag2"}
    assert run(small, "--quiet", "--overwrite", "--identity") == 0
    assert metadata(small / "out.mcap")["dicom_plane_a"]["PatientName"] == "Doe^Jane"
    first = min(one.log_time_ns for one in RecordingReader(small / "out.mcap").messages())
    assert datetime.fromtimestamp(first / 1e9, UTC) == datetime(2025, 3, 4, 10, 11, 12, 250000, UTC)


def metadata(path: Path) -> dict[str, dict[str, str]]:
    with path.open("rb") as file:
        return {one.name: one.metadata for one in make_reader(file).iter_metadata()}


def test_text_burnt_in_is_refused_unless_asked_for(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    write_small(tmp_path, change=lambda dataset: setattr(dataset, "BurnedInAnnotation", "YES"))
    assert run(tmp_path) == 2
    said = capsys.readouterr().err
    assert "(0028,0301) BurnedInAnnotation is YES" in said
    assert said.count("\n") == 1
    assert not (tmp_path / "out.mcap").exists()
    assert run(tmp_path, "--identity", "--quiet") == 0


def test_what_was_read_and_taken_for_granted_is_said(small: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(small, "--json", str(small / "r.json"), "--export", str(small / "p.json")) == 0
    said = capsys.readouterr().out
    assert "plane A: XA, 3 frames of 50×40 at 4/s, RAO 30 CRAN 0, 1200 mm to the detector" in said
    assert "both planes: heads-up display" in said
    assert "plane B begins +0.050 s after plane A by (0008,0032) AcquisitionTime" in said
    report = json.loads((small / "r.json").read_text())
    assert report["planes"]["b"]["first_stamp_ns"] - report["planes"]["a"]["first_stamp_ns"] == 50_000_000
    assert any("common frame" in line for line in report["taken_for_granted"]["both planes"])
    exported = json.loads((small / "p.json").read_text())["plane_b"]
    assert len(exported) == 3
    assert {"opencv", "rtk", "diffdrr"} <= exported[0].keys()
    assert exported[0]["rtk"]["source_to_detector_mm"] == pytest.approx(1200.0)


def test_r_peaks_are_written_where_they_are_marked(tmp_path: Path) -> None:
    write_small(tmp_path, change=lambda dataset: setattr(dataset, "RWavePointer", [2]))
    assert run(tmp_path, "--quiet") == 0
    peaks = [one for one in RecordingReader(tmp_path / "out.mcap").messages() if one.topic == "/ecg/r_peak"]
    assert [one.log_time_ns - NEUTRAL_START_NS for one in peaks] == [250_000_000]


@pytest.mark.parametrize("spoilt", [0, 200, 1000, 4000])
def test_a_spoilt_object_is_one_line(small: Path, spoilt: int, capsys: pytest.CaptureFixture[str]) -> None:
    whole = (small / "B.dcm").read_bytes()
    (small / "B.dcm").write_bytes(whole[:spoilt])
    assert run(small) == 2
    said = capsys.readouterr().err
    assert said.count("\n") == 1
    assert "B.dcm" in said
    assert not (small / "out.mcap").exists()


def test_one_object_for_both_planes_is_refused(small: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["import", str(small / "A.dcm"), str(small / "A.dcm"), "-o", str(small / "out.mcap")]) == 2
    assert "are one object: expected one for each plane" in capsys.readouterr().err
