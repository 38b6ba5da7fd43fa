"""Geometry of XA and Enhanced XA objects: angles, increments, table, field of view; what is missing is named by tag."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

pytest.importorskip("pydicom", reason="needs the dicom extra")

from support.xa_objects import Shot, write_classic, write_enhanced

from lasso_motion_ros.core.errors import LassoMotionError, RecordingError
from lasso_motion_ros.geometry.projection import Projection
from lasso_motion_ros.geometry.triangulation import triangulate
from msg_adapters.dicom.given_geometry import GivenGeometry, read_geometry_file
from msg_adapters.dicom.objects import open_object
from msg_adapters.dicom.xa_object import XaObject, read_xa

POINT = np.array([0.021, -0.013, 0.034])
ANGLES = [
    (-45.0, 0.0),
    (-30.0, 25.0),
    (-10.0, -20.0),
    (0.0, 0.0),
    (20.0, 30.0),
    (45.0, -25.0),
    (60.0, 10.0),
    (90.0, 0.0),
]
PRIMARY, SECONDARY = [one for one, _ in ANGLES], [one for _, one in ANGLES]
BLANK = np.zeros((100, 120), np.uint8)
NOTHING = GivenGeometry()
HOME = (0.0, 0.0, 0.0)


def shot(**changes: Any) -> Shot:
    return Shot(**{"pictures": [BLANK] * 8, "primary_deg": PRIMARY, "secondary_deg": SECONDARY, **changes})


def ideal(primary: float, secondary: float, point: np.ndarray, sid: float = 1200.0, sod: float = 785.0) -> np.ndarray:
    """(2,) where a point is seen, mm right and down of the iso-centre on the detector, by trigonometry."""
    a, b = np.radians(primary), np.radians(secondary)
    right = np.array([np.cos(a), np.sin(a), 0.0])
    detector = np.array([np.sin(a) * np.cos(b), -np.cos(a) * np.cos(b), np.sin(b)])
    down = np.cross(right, -detector) * -1.0
    millimetres = 1e3 * point
    scale = sid / (sod + millimetres @ detector)
    return scale * np.array([millimetres @ right, millimetres @ down])


def seen(primary: float, secondary: float, middle: tuple[float, float], spacing: tuple[float, float]) -> np.ndarray:
    return np.asarray(middle) + ideal(primary, secondary, POINT) / (spacing[1], spacing[0])


def error_mm(projections: list[Projection], pixels: list[np.ndarray]) -> float:
    return 1e3 * float(np.linalg.norm(triangulate(tuple(projections), tuple(pixels)) - POINT))


def test_one_point_in_eight_angulations_of_a_classic_object(tmp_path: Path) -> None:
    one = read_xa(write_classic(tmp_path / "a.dcm", shot(spacing_mm=(0.31, 0.29))), NOTHING)
    pixels = [seen(p, s, (59.5, 49.5), (0.31, 0.29)) for p, s in ANGLES]
    assert error_mm(one.projections(HOME), pixels) < 1e-3
    for projection, pixel in zip(one.projections(HOME), pixels, strict=True):
        np.testing.assert_allclose(projection.project(POINT), pixel, atol=1e-6)


@pytest.mark.parametrize("flip", [False, True])
@pytest.mark.parametrize("quarter", [0, 90, 180, 270])
@pytest.mark.parametrize("turned", [0.0, 7.0])
def test_one_point_in_eight_angulations_of_an_enhanced_object(
    tmp_path: Path, quarter: int, flip: bool, turned: float
) -> None:
    """A point, taken the way of the film: detector turned, field cut, binned by two, turned by quarters, flipped."""
    element, isocentre, origin = (0.15, 0.14), (310.25, 280.5), (240.0, 200.0)
    upright = (2 * element[0], 2 * element[1])
    spacing = upright if quarter in (0, 180) else upright[::-1]
    path = write_enhanced(
        tmp_path / "a.dcm",
        shot(spacing_mm=spacing),
        detector_rotation_deg=turned,
        quarter=quarter,
        flip=flip,
        isocentre=isocentre,
        origin=origin,
        element_mm=element,
    )
    one = read_xa(path, NOTHING)
    pixels = []
    for primary, secondary in ANGLES:
        right, down = ideal(primary, secondary, POINT)
        # A detector turned clockwise, as seen from it towards the source.
        angle = np.radians(turned)
        along = np.cos(angle) * right + np.sin(angle) * down
        below = -np.sin(angle) * right + np.cos(angle) * down
        # In elements from the centre of the first; two of them make a pixel of the field.
        row, column = isocentre[0] + below / element[0], isocentre[1] + along / element[1]
        row, column = (row + 0.5 - origin[0]) / 2 - 0.5, (column + 0.5 - origin[1]) / 2 - 0.5
        height, width = (100, 120) if quarter in (0, 180) else (120, 100)
        for _ in range(quarter // 90):
            row, column, height, width = column, height - 1 - row, width, height
        pixels.append(np.array([width - 1 - column if flip else column, row]))
    table = one.geometry[0].table_mm
    assert error_mm(one.projections(table), pixels) < 1e-3
    for projection, pixel in zip(one.projections(table), pixels, strict=True):
        np.testing.assert_allclose(projection.project(POINT), pixel, atol=2e-4)  # the object's numbers are 32-bit


def test_a_turned_detector_is_as_the_standards_matrices_have_it(tmp_path: Path) -> None:
    """PS3.17 Z.2: P_p = R3 (R2 R1) P; X_p to the right and Z_p to the top, as seen towards the source; Y_p to it."""
    turned, sid, sod = 23.0, 1200.0, 785.0
    middle = (280.5, 310.25)  # x, y, of the iso-centre's projection
    path = write_enhanced(
        tmp_path / "a.dcm", shot(spacing_mm=(0.2, 0.2)), detector_rotation_deg=turned, isocentre=middle[::-1],
        origin=(0.0, 0.0),
    )  # fmt: skip
    one = read_xa(path, NOTHING)
    c3, s3 = np.cos(np.radians(turned)), np.sin(np.radians(turned))
    r3 = np.array([[c3, 0.0, -s3], [0.0, 1.0, 0.0], [s3, 0.0, c3]])
    for projection, (primary, secondary) in zip(one.projections(one.geometry[0].table_mm), ANGLES, strict=True):
        (c1, s1), (c2, s2) = ((np.cos(angle), np.sin(angle)) for angle in np.radians([primary, secondary]))
        r1 = np.array([[c1, s1, 0.0], [-s1, c1, 0.0], [0.0, 0.0, 1.0]])
        r2 = np.array([[1.0, 0.0, 0.0], [0.0, c2, -s2], [0.0, s2, c2]])
        x, y, z = r3 @ (r2 @ r1) @ (1e3 * POINT)
        larger = sid / (sod - y)
        expected = np.array(middle) + larger * np.array([x, -z]) / 0.2
        np.testing.assert_allclose(projection.project(POINT), expected, atol=2e-4)


@pytest.mark.parametrize("write", [write_classic, write_enhanced])
def test_the_world_is_fixed_to_the_table(tmp_path: Path, write: Any) -> None:
    """Table 5 mm to the left, 2 mm down, 8 mm towards the head: a point on it is seen where it has gone."""
    moved = [(10.0, 20.0, 30.0)] * 4 + [(15.0, 22.0, 38.0)] * 4
    one = read_xa(write(tmp_path / "a.dcm", shot(table_mm=moved)), NOTHING)
    first, last = (one.projections(one.geometry[0].table_mm)[frame] for frame in (0, 7))
    np.testing.assert_allclose(
        last.source - first.source + 0.0,
        np.asarray(
            read_still(tmp_path, write).projections(HOME if write is write_classic else (12.0, 140.0, -75.0))[7].source
        )
        - first.source
        - np.array([0.005, 0.002, 0.008]),
        atol=1e-7,
    )


def read_still(tmp_path: Path, write: Any) -> XaObject:
    return read_xa(write(tmp_path / "still.dcm", shot()), NOTHING)


def test_increments_as_the_standard_allows_them(tmp_path: Path) -> None:
    """One value is an average a frame; a vector holds offsets from frame 1; steps where the user says so."""

    def average(dataset: Any) -> None:
        dataset.PositionerPrimaryAngleIncrement = 2.0

    def steps(dataset: Any) -> None:
        dataset.PositionerPrimaryAngleIncrement = [0.0, *[2.0] * 7]

    still = {"primary_deg": [-30.0] * 8, "secondary_deg": [0.0] * 8}
    expected = [-30.0 + 2.0 * frame for frame in range(8)]
    one = read_xa(write_classic(tmp_path / "a.dcm", shot(**still, change=average)), NOTHING)
    assert [frame.primary_deg for frame in one.geometry] == expected
    path = write_classic(tmp_path / "b.dcm", shot(**still, change=steps))
    assert [frame.primary_deg for frame in read_xa(path, GivenGeometry(increments="steps")).geometry] == expected
    assert [frame.primary_deg for frame in read_xa(path, NOTHING).geometry][1:] == [-28.0] * 7


def without(*keywords: str) -> Any:
    def change(dataset: Any) -> None:
        for keyword in keywords:
            delattr(dataset, keyword)

    return change


def test_what_is_missing_is_named_all_at_once(tmp_path: Path) -> None:
    lacking = without("DistanceSourceToDetector", "DistanceSourceToPatient", "ImagerPixelSpacing")
    path = write_classic(tmp_path / "a.dcm", shot(change=lacking))
    with pytest.raises(RecordingError) as caught:
        read_xa(path, NOTHING)
    text = str(caught.value)
    for tag in ("(0018,1110) DistanceSourceToDetector", "(0018,1111) DistanceSourceToPatient", "(0018,1164) Imager"):
        assert tag in text
    assert "source_detector_mm, source_isocentre_mm, imager_pixel_spacing_mm" in text
    assert "\n" not in text
    given = GivenGeometry(source_detector_mm=1200.0, source_isocentre_mm=785.0, imager_pixel_spacing_mm=(0.4, 0.4))
    np.testing.assert_allclose(
        read_xa(path, given).projections(HOME)[0].matrix,
        read_still(tmp_path, write_classic).projections(HOME)[0].matrix,
    )


def test_pixel_spacing_is_taken_only_where_asked_for(tmp_path: Path) -> None:
    """The objects carry (0028,0030) of 0.1 mm; at the iso-centre that is 0.1 × 1200 / 785 mm on the detector."""
    path = write_classic(tmp_path / "a.dcm", shot(change=without("ImagerPixelSpacing")))
    with pytest.raises(RecordingError, match=r"\(0018,1164\) ImagerPixelSpacing"):
        read_xa(path, NOTHING)
    one = read_xa(path, GivenGeometry(use_pixel_spacing="isocentre"))
    assert one.geometry[0].spacing_mm == pytest.approx((0.1 * 1200 / 785, 0.1 * 1200 / 785))
    assert any("(0028,0030) PixelSpacing" in line and "as asked for" in line for line in one.remarks)
    assert read_xa(path, GivenGeometry(use_pixel_spacing="detector")).geometry[0].spacing_mm == pytest.approx(
        (0.1, 0.1)
    )


def changed(keyword: str, value: Any) -> Any:
    return lambda dataset: setattr(dataset, keyword, value)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (changed("DistanceSourceToDetector", 120.0), r"\(0018,1110\) .*expected 300 to 2000 mm, found 120"),
        (changed("DistanceSourceToPatient", 1300.0), r"expected less than the 1200 mm to the detector.*1300"),
        (changed("PatientPosition", "FFP"), r"\(0018,5100\) PatientPosition: expected HFS.*found FFP"),
        (changed("PositionerPrimaryAngleIncrement", [0.0, 1.0]), r"\(0018,1520\) .*expected 1 or 8 values, found 2"),
        (changed("FrameTime", None), r"\(0018,1063\) FrameTime, \(0018,1065\) FrameTimeVector"),
        (changed("FrameTime", -5.0), r"\(0018,1063\) FrameTime: must be above zero, found -5"),
        (changed("ImagerPixelSpacing", [0.0, 0.4]), r"\(0018,1164\) .*must be above zero"),
        (
            changed("PhotometricInterpretation", "RGB"),
            r"\(0028,0004\) .*expected MONOCHROME1 or MONOCHROME2, found RGB",
        ),
        (changed("SOPClassUID", "1.2.840.10008.5.1.4.1.1.2"), r"\(0008,0016\) SOPClassUID: .*found CT Image Storage"),
    ],
)
def test_values_that_cannot_be_are_refused_by_tag(tmp_path: Path, change: Any, words: str) -> None:
    path = write_classic(tmp_path / "a.dcm", shot(change=change))
    with pytest.raises(RecordingError, match=words) as caught:
        read_xa(path, NOTHING).projections(HOME)
    assert str(caught.value).startswith(str(path))


def test_an_enhanced_object_without_its_reference_system_is_refused(tmp_path: Path) -> None:
    def change(dataset: Any) -> None:
        del dataset.PerFrameFunctionalGroupsSequence[0].IsocenterReferenceSystemSequence

    with pytest.raises(RecordingError, match=r"\(0018,9462\) IsocenterReferenceSystemSequence"):
        read_xa(write_enhanced(tmp_path / "a.dcm", shot(change=change)), NOTHING)


def test_an_entry_that_an_enhanced_object_has_no_use_for_is_refused(tmp_path: Path) -> None:
    path = write_enhanced(tmp_path / "a.dcm", shot())
    with pytest.raises(RecordingError, match="leave out primary_deg, mirrored"):
        read_xa(path, GivenGeometry(mirrored=False, primary_deg=3.0, source_detector_mm=1200.0))


def test_a_table_that_turns_is_refused(tmp_path: Path) -> None:
    def change(dataset: Any) -> None:
        item = dataset.PerFrameFunctionalGroupsSequence[3].IsocenterReferenceSystemSequence[0]
        item.TableHorizontalRotationAngle = 4.0

    with pytest.raises(RecordingError, match=r"\(0018,9469\) .*moved, not turned.*4 degrees in frame 4"):
        read_xa(write_enhanced(tmp_path / "a.dcm", shot(change=change)), NOTHING)


def test_what_is_taken_for_granted_is_said(tmp_path: Path) -> None:
    def change(dataset: Any) -> None:
        dataset.FieldOfViewDimensions = [100, 96]  # 120 pixels of 0.4 mm are 48 mm

    words = " ".join(read_xa(write_classic(tmp_path / "a.dcm", shot(change=change)), NOTHING).remarks)
    for said in ("middle of the picture", "heads-up display", "the table stands still", "together 48.0 mm"):
        assert said in words


def test_not_dicom(tmp_path: Path) -> None:
    (tmp_path / "a.dcm").write_bytes(b"no" * 400)
    with pytest.raises(RecordingError, match="not a DICOM file"):
        open_object(tmp_path / "a.dcm")
    with pytest.raises(RecordingError, match="cannot be read: No such file"):
        open_object(tmp_path / "b.dcm")


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("plane_c: {}", "unknown key 'plane_c' did you mean plane_"),
        ("both: {mirored: true}", "both: unknown key 'mirored' did you mean mirrored"),
        ("both: {source_detector_mm: -1}", "both.source_detector_mm: must be above zero"),
        ("plane_a: {isocentre_px: 3}", "plane_a.isocentre_px: expected two numbers, found 3"),
        ("plane_a: {increments: all}", "plane_a.increments: expected offsets or steps"),
        ("plane_a: 7", "plane_a: expected a mapping"),
    ],
)
def test_a_geometry_file_that_is_wrong_is_refused_by_key(tmp_path: Path, text: str, words: str) -> None:
    (tmp_path / "g.yaml").write_text(text)
    with pytest.raises(LassoMotionError) as caught:
        read_geometry_file(tmp_path / "g.yaml")
    assert words in str(caught.value)


def test_a_geometry_file_holds_for_both_planes_or_one(tmp_path: Path) -> None:
    (tmp_path / "g.yaml").write_text("both: {mirrored: false, frame_time_ms: 50}\nplane_b: {isocentre_px: [3, 4]}\n")
    given = read_geometry_file(tmp_path / "g.yaml")
    assert given["a"] == GivenGeometry(mirrored=False, frame_time_ms=50.0)
    assert given["b"] == GivenGeometry(mirrored=False, frame_time_ms=50.0, isocentre_px=(3.0, 4.0))
