"""DICOM XA in, the same poses out: phantom sequences written as an archive has them, imported and tracked."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("pydicom", reason="needs the dicom extra")

from support.xa_objects import Shot, write_classic, write_enhanced

from lasso_motion_ros.cli.main import main
from lasso_motion_ros.phantom import SimulatedPair, Simulator, load_scenario
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
