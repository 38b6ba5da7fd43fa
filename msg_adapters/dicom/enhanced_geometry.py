"""Geometry and times of an Enhanced XA object, frame by frame (PS3.3 C.8.19: iso-centre reference system, detector)."""

from __future__ import annotations

from datetime import UTC, datetime
from itertools import pairwise
from typing import Any

from lasso_motion_ros.core.errors import RecordingError
from msg_adapters.dicom.frame_geometry import FrameGeometry
from msg_adapters.dicom.given_geometry import GivenGeometry
from msg_adapters.dicom.objects import Needed, group_item, missing, number, numbers, tag_name, word

_ANGLES = (
    "PositionerIsocenterPrimaryAngle",
    "PositionerIsocenterSecondaryAngle",
    "PositionerIsocenterDetectorRotationAngle",
)
_TABLE = ("TableXPositionToIsocenter", "TableYPositionToIsocenter", "TableZPositionToIsocenter")
_TABLE_ANGLES = ("TableHorizontalRotationAngle", "TableHeadTiltAngle", "TableCradleTiltAngle")
# Entries of the geometry file that only classic XA leaves open.
_SAID_BY_ITSELF = (
    "primary_deg",
    "secondary_deg",
    "rotation_deg",
    "mirrored",
    "increments",
    "frame_time_ms",
    "use_pixel_spacing",
    "patient_position",
)
_TURNED_DEG = 0.01


def enhanced_geometry(dataset: Any, frames: int, given: GivenGeometry, remarks: list[str]) -> tuple[FrameGeometry, ...]:
    """The geometry of each frame.

    Args:
        dataset: the object.
        frames: how many frames it has.
        given: what the user says instead.
        remarks: what is taken for granted is appended.

    Raises:
        RecordingError: attributes that are missing, a table that turns, a picture that is turned by other than
            quarters, or entries that such an object has no use for.
    """
    _say_what_is_given(given, remarks)
    geometry = tuple(_frame(dataset, frame, given) for frame in range(frames))
    first = table_angles(dataset, 0)
    for frame in range(1, frames):
        check_table_turn(first, table_angles(dataset, frame), f"frame {frame + 1}")
    return geometry


def table_angles(dataset: Any, frame: int) -> tuple[float, ...]:
    """(3,) degrees by which the table is turned in one frame; zero where nothing is said."""
    item = group_item(dataset, frame, "IsocenterReferenceSystemSequence")
    return tuple(number(item, keyword) or 0.0 for keyword in _TABLE_ANGLES)


def check_table_turn(reference: tuple[float, ...], angles: tuple[float, ...], where: str) -> None:
    """Check that the table was moved only, not turned.

    Raises:
        RecordingError: it was turned, so that there is no world fixed to it without its axis.
    """
    for keyword, before, now in zip(_TABLE_ANGLES, reference, angles, strict=True):
        if abs(now - before) > _TURNED_DEG:
            raise RecordingError(
                f"{tag_name(keyword)}: expected a table that is moved, not turned, found {before:g} in frame 1 and"
                f" {now:g} degrees in {where}"
            )


def enhanced_times(dataset: Any, frames: int) -> tuple[int, ...]:
    """When each frame was taken: nanoseconds since 1970, by the equipment's own clock.

    Raises:
        RecordingError: a frame without a time, or times that do not increase.
    """
    stamps: list[int] = []
    for frame in range(frames):
        content = group_item(dataset, frame, "FrameContentSequence")
        # The point in time that the frame stands for, where it is said; else the beginning of its exposure.
        text = word(content, "FrameReferenceDateTime") or word(content, "FrameAcquisitionDateTime")
        if not text:
            raise missing([("FrameAcquisitionDateTime", "")])
        stamps.append(nanoseconds(text, "FrameAcquisitionDateTime"))
    if any(later <= earlier for earlier, later in pairwise(stamps)):
        raise RecordingError(
            f"{tag_name('FrameAcquisitionDateTime')}: expected times that increase from frame to frame"
        )
    return tuple(stamps)


def nanoseconds(text: str, keyword: str) -> int:
    """A DICOM date and time (DT, YYYYMMDDHHMMSS.FFFFFF&ZZXX) as nanoseconds since 1970; without a zone, UTC.

    Raises:
        RecordingError: another form.
    """
    from pydicom.valuerep import DT

    try:
        value = DT(text)
    except (ValueError, TypeError):
        value = None
    if not isinstance(value, datetime):
        raise RecordingError(f"{tag_name(keyword)}: expected a date and a time, found {text!r}")
    moment = value if value.tzinfo is not None else value.replace(tzinfo=UTC)
    whole = int((moment.replace(microsecond=0) - datetime(1970, 1, 1, tzinfo=UTC)).total_seconds())
    return whole * 1_000_000_000 + moment.microsecond * 1000


def _say_what_is_given(given: GivenGeometry, remarks: list[str]) -> None:
    unused = [name for name in _SAID_BY_ITSELF if getattr(given, name) is not None]
    if unused:
        raise RecordingError(f"an Enhanced XA object says itself what --geometry gives: leave out {', '.join(unused)}")
    for keyword, value in (
        ("DistanceSourceToDetector", given.source_detector_mm),
        ("DistanceSourceToIsocenter", given.source_isocentre_mm),
        ("ImagerPixelSpacing", given.imager_pixel_spacing_mm),
        ("PositionOfIsocenterProjection", given.isocentre_px),
    ):
        if value is not None:
            remarks.append(f"{tag_name(keyword)}: {value} as given")


def _frame(dataset: Any, frame: int, given: GivenGeometry) -> FrameGeometry:
    system = group_item(dataset, frame, "IsocenterReferenceSystemSequence")
    distances = group_item(dataset, frame, "XRayGeometrySequence")
    pixels = group_item(dataset, frame, "FramePixelDataPropertiesSequence")
    if system is None:
        raise missing([("IsocenterReferenceSystemSequence", "")])
    needed = Needed()
    primary, secondary, turned, *table = (
        needed.one(number(system, keyword), keyword) for keyword in (*_ANGLES, *_TABLE)
    )
    detector = needed.one(
        given.source_detector_mm or number(distances, "DistanceSourceToDetector"),
        "DistanceSourceToDetector",
        "source_detector_mm",
    )
    isocentre = needed.one(
        given.source_isocentre_mm or number(distances, "DistanceSourceToIsocenter"),
        "DistanceSourceToIsocenter",
        "source_isocentre_mm",
    )
    spacing = needed.two(
        given.imager_pixel_spacing_mm or numbers(pixels, "ImagerPixelSpacing", 2),
        "ImagerPixelSpacing",
        "imager_pixel_spacing_mm",
    )
    needed.check()
    isocentre_px, quarter, flipped = _on_picture(dataset, frame, given, spacing)
    return FrameGeometry(
        primary_deg=primary,
        secondary_deg=secondary,
        # A detector that is turned clockwise shows what it sees turned the other way; the flip comes last.
        rotation_deg=(quarter - turned) * (-1.0 if flipped else 1.0),
        source_detector_mm=detector,
        source_isocentre_mm=isocentre,
        spacing_mm=spacing,
        isocentre_px=isocentre_px,
        mirrored=not flipped,
        table_mm=(table[0], table[1], table[2]),
    )


def _on_picture(
    dataset: Any, frame: int, given: GivenGeometry, spacing: tuple[float, float]
) -> tuple[tuple[float, float], float, bool]:
    """Where the iso-centre is in the picture (x, y), by how much it was turned clockwise, and whether flipped then."""
    field = group_item(dataset, frame, "FieldOfViewSequence")
    quarter = number(field, "FieldOfViewRotation") or 0.0
    flipped = word(field, "FieldOfViewHorizontalFlip") == "YES"
    if quarter not in (0.0, 90.0, 180.0, 270.0):
        raise RecordingError(f"{tag_name('FieldOfViewRotation')}: expected 0, 90, 180 or 270, found {quarter:g}")
    if given.isocentre_px is not None:
        return given.isocentre_px, quarter, flipped
    needed = Needed()
    isocentre = needed.two(
        numbers(dataset, "PositionOfIsocenterProjection", 2), "PositionOfIsocenterProjection", "isocentre_px"
    )
    element = needed.two(
        # Not the element's physical size: the elements may lie further apart than they are large.
        numbers(dataset, "DetectorElementSpacing", 2),
        "DetectorElementSpacing",
        "isocentre_px",
    )
    origin = needed.two(numbers(field, "FieldOfViewOrigin", 2), "FieldOfViewOrigin", "isocentre_px")
    needed.check()
    rows, columns = int(dataset.Rows), int(dataset.Columns)
    upright = quarter in (0.0, 180.0)
    row_mm, column_mm = spacing if upright else spacing[::-1]
    height, width = (rows, columns) if upright else (columns, rows)
    # The iso-centre counts from the centre of the first detector element, the field from its corner.
    y = (isocentre[0] + 0.5 - origin[0]) * element[0] / row_mm - 0.5
    x = (isocentre[1] + 0.5 - origin[1]) * element[1] / column_mm - 0.5
    x, y = {
        0.0: (x, y),
        90.0: (height - 1 - y, x),
        180.0: (width - 1 - x, height - 1 - y),
        270.0: (y, width - 1 - x),
    }[quarter]
    return (columns - 1 - x if flipped else x, y), quarter, flipped
