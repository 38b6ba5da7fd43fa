"""Reading medical volumes: where a sample lies in the patient, whatever axes the file uses; refusals."""

import gzip
import resource
import struct
import sys

import numpy as np
import pytest
from support.volume_inputs import CENTRE_M, INSIDE, SPACING_MM, write_dicom_series, write_ellipsoid

from lasso_motion_ros.core.errors import VolumeError
from lasso_motion_ros.geometry import transforms
from lasso_motion_ros.geometry.volumes import is_volume, read_volume_image


def centroid(image, above):
    index = np.argwhere(image.values > above)[:, ::-1]
    return transforms.apply(image.to_lps, index.astype(float)).mean(axis=0)


@pytest.mark.parametrize("suffix", [".nii.gz", ".nrrd", ".mha"])
@pytest.mark.parametrize("turned", [False, True])
def test_samples_lie_where_the_file_says_in_lps(tmp_path, suffix, turned):
    image = read_volume_image(write_ellipsoid(tmp_path / f"heart{suffix}", turned=turned))
    np.testing.assert_allclose(centroid(image, INSIDE / 2), CENTRE_M, atol=1e-4)
    np.testing.assert_allclose(image.spacing_m, 1e-3 * np.array(SPACING_MM), rtol=1e-5)


def test_a_file_in_ras_is_turned_to_lps(tmp_path):
    """A NIfTI header written by hand with a sform: index (1, 2, 3) lies at R 5, A 12, S 33 mm."""
    header = bytearray(348)
    header[0:4] = (348).to_bytes(4, "little")
    header[40:56] = np.array([3, 4, 4, 5, 1, 1, 1, 1], "<i2").tobytes()
    header[70:74] = np.array([4, 16], "<i2").tobytes()  # int16
    header[76:108] = np.array([1, 1, 2, 3, 1, 1, 1, 1], "<f4").tobytes()
    header[108:112] = np.array([352], "<f4").tobytes()
    header[123] = 2  # millimetres
    header[254:256] = (1).to_bytes(2, "little")  # sform in use
    header[280:328] = np.array([[1, 0, 0, 4], [0, 2, 0, 8], [0, 0, 3, 24]], "<f4").tobytes()
    header[344:348] = b"n+1\0"
    values = np.zeros((5, 4, 4), "<i2")
    values[3, 2, 1] = 100
    path = tmp_path / "ras.nii"
    path.write_bytes(bytes(header) + bytes(4) + values.tobytes())
    pytest.importorskip("SimpleITK")
    np.testing.assert_allclose(centroid(read_volume_image(path), 50), [-0.005, -0.012, 0.033], atol=1e-7)


def test_a_dicom_series_is_put_in_order_by_position(tmp_path):
    values = np.zeros((6, 8, 8), np.int16)
    values[4, 1, 3] = 1000
    write_dicom_series(tmp_path / "series", values, 2.0)
    image = read_volume_image(tmp_path / "series")
    np.testing.assert_allclose(centroid(image, 500), [-0.010 + 0.006, -0.020 + 0.002, -0.030 + 0.008], atol=1e-7)


def test_units_scale_the_files_coordinates(tmp_path):
    path = write_ellipsoid(tmp_path / "heart.nrrd")
    millimetres, metres = read_volume_image(path), read_volume_image(path, 1.0)
    np.testing.assert_allclose(metres.to_lps[:3], 1e3 * millimetres.to_lps[:3])


def test_what_is_a_volume_tells_the_name(tmp_path):
    assert [is_volume(name) for name in ("a.nii.gz", "a.NRRD", "a.mha", "a.stl", tmp_path)] == [True] * 3 + [
        False,
        True,
    ]


def test_refusals_name_the_file_and_the_reason(tmp_path, monkeypatch):
    itk = pytest.importorskip("SimpleITK")
    (tmp_path / "bad.nrrd").write_bytes(b"no volume")
    (tmp_path / "empty").mkdir()
    for series in ("1", "2"):
        write_dicom_series(tmp_path / "two", np.zeros((3, 4, 4), np.int16), 1.0, series)
    flat = tmp_path / "flat.mha"
    itk.WriteImage(itk.GetImageFromArray(np.zeros((4, 4), np.uint8)), str(flat))
    holes = np.zeros((4, 4, 4), np.float32)
    holes[1, 1, 1] = np.nan
    itk.WriteImage(itk.GetImageFromArray(holes), str(tmp_path / "holes.mha"))
    for name, reason in (
        ("gone.nrrd", "no such file"),
        ("bad.nrrd", "cannot be read"),
        ("empty", "no DICOM series"),
        ("two", "2 DICOM series"),
        ("flat.mha", "found 2-D data"),
        ("holes.mha", "finite"),
    ):
        with pytest.raises(VolumeError, match=reason) as found:
            read_volume_image(tmp_path / name)
        assert str(tmp_path / name) in str(found.value)
    monkeypatch.setitem(sys.modules, "SimpleITK", None)
    with pytest.raises(VolumeError, match=r"lasso_motion_ros\[volume\]"):
        read_volume_image(flat)


def nifti_header(side: int) -> bytes:
    """A NIfTI header that promises side³ samples of 64 bits."""
    header = bytearray(352)
    struct.pack_into("<i", header, 0, 348)
    struct.pack_into("<8h", header, 40, 3, side, side, side, 1, 1, 1, 1)
    struct.pack_into("<2h", header, 70, 64, 64)
    struct.pack_into("<8f", header, 76, 1, 1, 1, 1, 1, 1, 1, 1)
    struct.pack_into("<f", header, 108, 352)
    header[344:348] = b"n+1\0"
    return bytes(header)


def test_a_packed_file_is_not_unpacked_beyond_the_limit(tmp_path):
    """One promises 8 GB; another says it is small, and goes on for as long as one reads."""
    pytest.importorskip("SimpleITK")
    for name, side, said in (
        ("promises.nii.gz", 1000, "promises 7629 MiB of samples, at most 1024 MiB"),
        ("goes_on.nii.gz", 4, ""),
    ):
        path = tmp_path / name
        with gzip.open(path, "wb", compresslevel=1) as file:
            file.write(nifti_header(side))
            for _ in range(256):
                file.write(bytes(1 << 20))
        before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
        if said:
            with pytest.raises(VolumeError, match=said):
                read_volume_image(path)
        else:
            assert read_volume_image(path).values.shape == (4, 4, 4)
        grown_mib = (resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before) / 1024
        assert grown_mib < 100


@pytest.mark.parametrize(
    ("name", "content", "named"),
    [
        ("a.nii.gz", gzip.compress(nifti_header(500)), None),
        ("a.nrrd", b"NRRD0004\ntype: uchar\ndimension: 3\nsizes: 900 900 900\nencoding: gzip\n\n\x1f\x8b", None),
        (
            "a.nhdr",
            b"NRRD0004\ntype: uchar\ndimension: 3\nsizes: 900 900 900\nencoding: raw\ndata file: a.raw\n",
            "a.raw",
        ),
        ("a.mha", b"NDims = 3\nDimSize = 900 900 900\nElementType = MET_UCHAR\nElementDataFile = LOCAL\n", None),
    ],
    ids=["nifti", "nrrd", "detached", "meta"],
)
def test_a_small_file_that_promises_much_takes_no_memory_for_it(tmp_path, name, content, named):
    """All within the limit; 2 GiB were taken for a file of 72 bytes before it turned out to hold nothing."""
    pytest.importorskip("SimpleITK")
    (tmp_path / name).write_bytes(content)
    if named:
        (tmp_path / named).write_bytes(bytes(64))
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    with pytest.raises(VolumeError, match=r"its header promises \d+ MiB of samples, more than \d+ bytes can hold"):
        read_volume_image(tmp_path / name)
    assert (resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before) / 1024 < 100


@pytest.mark.parametrize("suffix", [".nii", ".nii.gz"])
def test_a_nifti_file_that_is_cut_short_is_no_volume(tmp_path, suffix):
    """ITK takes the rest for zeros: an atrium of which the upper half is missing."""
    itk = pytest.importorskip("SimpleITK")
    whole, cut = tmp_path / f"whole{suffix}", tmp_path / f"cut{suffix}"
    values = np.random.default_rng(0).integers(0, 3000, (10, 11, 12)).astype(np.int16)
    itk.WriteImage(itk.GetImageFromArray(values), str(whole))
    np.testing.assert_array_equal(read_volume_image(whole).values, values)
    for length in (whole.stat().st_size // 2, whole.stat().st_size - 20):
        cut.write_bytes(whole.read_bytes()[:length])
        with pytest.raises(VolumeError, match="cut short"):
            read_volume_image(cut)


@pytest.mark.parametrize("suffix", [".mha", ".mhd"])
def test_a_packed_metaimage_that_is_damaged_is_no_volume(tmp_path, suffix):
    """ITK gives what it unpacks to, and what lay in memory for the rest."""
    itk = pytest.importorskip("SimpleITK")
    path = tmp_path / f"a{suffix}"
    values = np.random.default_rng(0).integers(0, 3000, (20, 21, 22)).astype(np.int16)
    itk.WriteImage(itk.GetImageFromArray(values), str(path), useCompression=True)
    np.testing.assert_array_equal(read_volume_image(path).values, values)
    (samples,) = set(tmp_path.iterdir()) - {path} or {path}
    whole = samples.read_bytes()
    for at in (len(whole) // 2, len(whole) - 2):  # a sample, and the check sum of all
        samples.write_bytes(whole[:at] + bytes([whole[at] ^ 255]) + whole[at + 1 :])
        with pytest.raises(VolumeError, match="damaged"):
            read_volume_image(path)


@pytest.mark.parametrize("dimensions", ["-1", "-99999999999", "2147483648", "three", ""])
def test_a_metaimage_of_impossible_dimensions_is_refused_at_once(tmp_path, dimensions):
    """The reader of ITK never comes back from some of these."""
    pytest.importorskip("SimpleITK")
    path = tmp_path / "a.mha"
    path.write_text(f"NDims = {dimensions}\nDimSize = 4 4 4\nElementType = MET_UCHAR\nElementDataFile = LOCAL\n")
    with pytest.raises(VolumeError, match=f"its header says NDims = {dimensions}, expected 3"):
        read_volume_image(path)


@pytest.mark.parametrize(
    ("name", "header"),
    [
        ("a.nhdr", "NRRD0004\ntype: uchar\ndimension: 3\nsizes: 4 4 4\nencoding: raw\ndata file: {data}\n"),
        ("a.nrrd", "NRRD0004\ntype: uchar\ndimension: 3\nsizes: 4 4 4\nencoding: raw\ndatafile: {data}\n\n"),
        ("a.nhdr", "NRRD0004\ntype: uchar\ndimension: 3\nsizes: 4 4 1\nencoding: raw\ndata file: LIST\n{data}\n"),
        ("a.mhd", "NDims = 3\nDimSize = 4 4 4\nElementType = MET_UCHAR\nElementDataFile = {data}\n"),
        ("a.mha", "Comment = ElementDataFile = LOCAL\nNDims = 3\nDimSize = 4 4 4\nElementDataFile = {data}\n"),
        ("a.mhd", "NDims = 3\nDimSize = 4 4 4\nElementType = MET_UCHAR\nElementDataFile = LIST\n{data}\n"),
    ],
)
def test_a_header_reads_no_file_outside_its_folder(name, header, tmp_path):
    pytest.importorskip("SimpleITK")
    folder = tmp_path / "given"
    folder.mkdir()
    secret = tmp_path / "secret.raw"
    secret.write_bytes(bytes(range(64)))
    (folder / "link.raw").symlink_to(secret)
    for data in (str(secret), "../secret.raw", "link.raw"):
        (folder / name).write_text(header.format(data=data))
        with pytest.raises(VolumeError, match="a file outside its own folder, which is not read"):
            read_volume_image(folder / name)
    if "LIST" not in header and "Comment" not in header:
        (folder / "own.raw").write_bytes(bytes(range(64)))
        (folder / name).write_text(header.format(data="own.raw"))
        assert read_volume_image(folder / name).values.sum() == sum(range(64))
