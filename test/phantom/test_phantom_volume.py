"""A CT volume as the body: placement, line integrals, motion, errors."""

import sys
from pathlib import Path

import numpy as np
import pytest

from lasso_motion_ros.core.errors import ScenarioError
from lasso_motion_ros.geometry.carm import carm_projection
from lasso_motion_ros.geometry.projection import Projection
from lasso_motion_ros.geometry.transforms import rigid
from lasso_motion_ros.phantom import Simulator
from lasso_motion_ros.phantom.anatomy import TISSUE
from lasso_motion_ros.phantom.body_renderer import BodyState
from lasso_motion_ros.phantom.scenario import scenario_from_values
from lasso_motion_ros.phantom.volume import Volume, VolumeRenderer, read_volume, volume_bodies

PIXEL_MM = 200.0 / 64 * 0.8 / 1.2  # at the iso-centre
AT_REST = BodyState(np.eye(4), 0.0, np.zeros(3), 0.0)


def centroid(depth: np.ndarray) -> np.ndarray:
    """Row and column of what is seen, from the middle of a 64² picture."""
    rows, columns = np.indices(depth.shape)
    return np.array([(rows * depth).sum(), (columns * depth).sum()]) / depth.sum() - 31.5


def frontal(size: int = 64) -> Projection:
    return carm_projection(
        0.0, 0.0, source_detector_m=1.2, source_object_m=0.8, pixel_size_m=0.2 / size, width=size, height=size
    )


def ball_in_air(directory: Path, suffix: str = ".nii.gz") -> Path:
    """Air with a ball of water of 60 mm radius, 5 mm above (cranial of) the middle of the file."""
    itk = pytest.importorskip("SimpleITK")
    z, y, x = np.mgrid[0:50, 0:40, 0:40]
    x, y, z = 4.0 * (x - 19.5), 4.0 * (y - 19.5), 4.0 * (z - 24.5)
    hounsfield = np.where(x**2 + y**2 + (z - 5.0) ** 2 < 60.0**2, 0, -1000).astype(np.int16)
    image = itk.GetImageFromArray(hounsfield)
    image.SetSpacing((4.0, 4.0, 4.0))
    image.SetOrigin((100.0, -50.0, 20.0))
    path = directory / f"ball{suffix}"
    itk.WriteImage(image, str(path))
    return path


def cube(side: int = 41, spacing_m: float = 5e-3) -> Volume:
    """A cube of water with a denser ball of 10 mm radius at the origin."""
    to_index = np.diag([1 / spacing_m] * 3 + [1.0])[[2, 1, 0, 3]]
    to_index[:3, 3] = (side - 1) / 2
    grid = (np.arange(side) - (side - 1) / 2) * spacing_m
    distance = np.sqrt(grid[:, None, None] ** 2 + grid[:, None] ** 2 + grid**2)
    return Volume(np.where(distance < 0.011, 3 * TISSUE.soft, TISSUE.soft).astype(np.float32), to_index)


@pytest.mark.parametrize("suffix", [".nii.gz", ".nrrd", ".mha"])
def test_line_integrals_through_a_ball_of_water(tmp_path: Path, suffix: str) -> None:
    depth = VolumeRenderer(read_volume(ball_in_air(tmp_path, suffix))).optical_depth(frontal(), AT_REST)
    assert depth.max() == pytest.approx(TISSUE.soft * 0.120, rel=0.03)
    # 5 mm cranial is up.
    assert centroid(depth) == pytest.approx([-5.0 / PIXEL_MM, 0.0], abs=0.2)


def test_the_centre_given_is_placed_at_the_origin(tmp_path: Path) -> None:
    path = ball_in_air(tmp_path)
    # Middle of the file in LPS: origin + spacing · (size − 1)/2; the ball is 5 mm further up.
    centred = read_volume(path, (100 + 78, -50 + 78, 20 + 98 + 5))
    depth = VolumeRenderer(centred).optical_depth(frontal(), AT_REST)
    assert centroid(depth) == pytest.approx([0.0, 0.0], abs=0.3)


def test_the_heart_region_follows_the_motion() -> None:
    renderer = VolumeRenderer(cube())
    moved = BodyState(rigid((0, 0, 0), (0, 0, -0.020)), 0.0, np.array([0, 0, -0.020]), 1.0)
    still, now = (renderer.optical_depth(frontal(), state) for state in (AT_REST, moved))
    rows = [int(np.argmax(image[:, 30:34].mean(axis=1) - np.median(image))) for image in (still, now)]
    assert rows[1] - rows[0] == pytest.approx(20.0 / PIXEL_MM, abs=1.6)
    # What lies beyond the heart stays.
    assert now[:4] == pytest.approx(still[:4], abs=0.05)


def test_a_scenario_on_a_volume(tmp_path: Path) -> None:
    scenario = scenario_from_values({"pairs": 1, "geometry": {"size_px": 128}})
    pair = next(Simulator(scenario, volume_bodies(ball_in_air(tmp_path))).pairs())
    assert sorted(pair.images.frames) == ["a", "b"]
    assert sorted(pair.centrelines) == ["a", "b"]


def test_without_the_extra_the_error_names_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "SimpleITK", None)
    with pytest.raises(ScenarioError, match=r"ct\.nii: a volume needs SimpleITK: pip install .*\[volume\]"):
        read_volume(tmp_path / "ct.nii")


def test_files_that_are_no_volume(tmp_path: Path) -> None:
    itk = pytest.importorskip("SimpleITK")
    with pytest.raises(ScenarioError, match="no such file"):
        read_volume(tmp_path / "missing.nii")
    (tmp_path / "text.nii").write_text("hello")
    with pytest.raises(ScenarioError, match="cannot be read"):
        read_volume(tmp_path / "text.nii")
    itk.WriteImage(itk.GetImageFromArray(np.zeros((8, 8), np.int16)), str(tmp_path / "flat.nrrd"))
    with pytest.raises(ScenarioError, match="found 2-D data"):
        read_volume(tmp_path / "flat.nrrd")
    itk.WriteImage(itk.GetImageFromArray(np.zeros((8, 8, 8), np.int16)), str(tmp_path / "tiny.nrrd"))
    with pytest.raises(ScenarioError, match="50 to 3000 mm"):
        read_volume(tmp_path / "tiny.nrrd")
