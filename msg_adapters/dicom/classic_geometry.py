"""Geometry and times of a classic XA object (PS3.3 C.8.7: XA Positioner, XA Table, XA Acquisition, Cine).

The object says everything with respect to the patient, for a heads-up display, with the iso-centre in the middle of the
field; PS3.17 FFF.2 says so of it. What is taken for granted goes into the report.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from lasso_motion_ros.core.errors import RecordingError
from msg_adapters.dicom.frame_geometry import FrameGeometry
from msg_adapters.dicom.given_geometry import GivenGeometry
from msg_adapters.dicom.objects import Needed, missing, number, numbers, tag_name, word

# Towards the patient's left, back and head. The standard's longitudinal and lateral are those of an operator at the
# table's side: longitudinal is positive towards +90° of the primary angle (LAO), lateral towards +90° of the secondary
# one (CRAN) (PS3.3 C.8.7.4).
_TABLE = ("TableLongitudinalIncrement", "TableVerticalIncrement", "TableLateralIncrement")
# Beyond it the field of view is of another size than the pixels: (0018,1164) is not that of this picture.
_FIELD_DISAGREEMENT = 0.03


def classic_geometry(dataset: Any, frames: int, given: GivenGeometry, remarks: list[str]) -> tuple[FrameGeometry, ...]:
    """The geometry of each frame.

    Args:
        dataset: the object.
        frames: how many frames it has.
        given: what the user says instead.
        remarks: what is taken for granted is appended.

    Raises:
        RecordingError: attributes that are missing, or values that cannot be.
    """
    _check_patient_position(dataset, given, remarks)
    needed = Needed()
    detector = needed.one(
        _either(given.source_detector_mm, dataset, "DistanceSourceToDetector", remarks),
        "DistanceSourceToDetector",
        "source_detector_mm",
    )
    isocentre = needed.one(
        _either(given.source_isocentre_mm, dataset, "DistanceSourceToPatient", remarks),
        "DistanceSourceToPatient",
        "source_isocentre_mm",
    )
    primary = needed.one(
        _either(given.primary_deg, dataset, "PositionerPrimaryAngle", remarks), "PositionerPrimaryAngle", "primary_deg"
    )
    secondary = needed.one(
        _either(given.secondary_deg, dataset, "PositionerSecondaryAngle", remarks),
        "PositionerSecondaryAngle",
        "secondary_deg",
    )
    magnification = detector / isocentre if isocentre > 0.0 else 1.0
    spacing = needed.two(*_spacing(dataset, given, magnification, remarks), "imager_pixel_spacing_mm")
    needed.check()
    _check_spacing(dataset, spacing, remarks)
    width, height = int(dataset.Columns), int(dataset.Rows)
    if given.isocentre_px is None:
        remarks.append("the iso-centre is projected on the middle of the picture (isocentre_px)")
    if given.rotation_deg is None and given.mirrored is None:
        remarks.append("heads-up display as seen facing the patient (rotation_deg, mirrored)")
    primaries = primary + _increments(dataset, "PositionerPrimaryAngleIncrement", frames, given)
    secondaries = secondary + _increments(dataset, "PositionerSecondaryAngleIncrement", frames, given)
    table = np.column_stack([_increments(dataset, keyword, frames, given) for keyword in _TABLE])
    if not any(numbers(dataset, keyword) for keyword in _TABLE):
        remarks.append(f"the table stands still: {tag_name(_TABLE[0])} and its like are absent")
    elif table.any():
        left, back, head = table[-1]
        remarks.append(
            f"the table moves: in the last frame {left:+.1f} mm to the patient's left, {back:+.1f} mm to the back,"
            f" {head:+.1f} mm headwards ({tag_name(_TABLE[0])} is towards LAO, {tag_name(_TABLE[2])} towards CRAN)"
        )
    return tuple(
        FrameGeometry(
            primary_deg=float(primaries[frame]),
            secondary_deg=float(secondaries[frame]),
            rotation_deg=given.rotation_deg or 0.0,
            source_detector_mm=detector,
            source_isocentre_mm=isocentre,
            spacing_mm=spacing,
            isocentre_px=given.isocentre_px or ((width - 1) / 2.0, (height - 1) / 2.0),
            mirrored=True if given.mirrored is None else given.mirrored,
            table_mm=(float(table[frame, 0]), float(table[frame, 1]), float(table[frame, 2])),
        )
        for frame in range(frames)
    )


def classic_times(dataset: Any, frames: int, given: GivenGeometry, remarks: list[str]) -> tuple[int, ...]:
    """When each frame was taken, nanoseconds since the first.

    Raises:
        RecordingError: neither a frame time nor a vector of them, or one that does not fit the frames.
    """
    if given.frame_time_ms is not None:
        remarks.append(f"frame time {given.frame_time_ms:g} ms as given")
        return tuple(round(1e6 * given.frame_time_ms * frame) for frame in range(frames))
    vector, step = numbers(dataset, "FrameTimeVector"), number(dataset, "FrameTime")
    if vector is not None and len(vector) == frames and (frames > 1 or step is None):
        elapsed = np.cumsum(vector) - vector[0]
        if np.any(np.diff(elapsed) <= 0.0):
            raise RecordingError(f"{tag_name('FrameTimeVector')}: expected steps above zero, found one that is not")
        return tuple(round(1e6 * one) for one in elapsed)
    if step is None:
        if vector is not None:
            raise RecordingError(f"{tag_name('FrameTimeVector')}: expected {frames} values, found {len(vector)}")
        raise missing([("FrameTime", "frame_time_ms"), ("FrameTimeVector", "")])
    if vector is not None and len(vector) != frames:
        remarks.append(
            f"{tag_name('FrameTimeVector')} has {len(vector)} values for {frames} frames and is passed over:"
            f" {tag_name('FrameTime')} is {step:g} ms"
        )
    if not step > 0.0:
        raise RecordingError(f"{tag_name('FrameTime')}: must be above zero, found {step:g}")
    return tuple(round(1e6 * step * frame) for frame in range(frames))


def _either(given: float | None, dataset: Any, keyword: str, remarks: list[str]) -> float | None:
    if given is None:
        return number(dataset, keyword)
    remarks.append(f"{tag_name(keyword)}: {given:g} as given")
    return given


def _check_patient_position(dataset: Any, given: GivenGeometry, remarks: list[str]) -> None:
    position = word(dataset, "PatientPosition")
    if position not in ("", "HFS") and given.patient_position is None:
        raise RecordingError(
            f"{tag_name('PatientPosition')}: expected HFS (head first, supine), found {position};"
            " where the angles are those of such a patient all the same, --geometry FILE can give patient_position: HFS"
        )
    if position != "HFS":
        remarks.append("the patient lies head first, supine (patient_position)")


def _spacing(
    dataset: Any, given: GivenGeometry, magnification: float, remarks: list[str]
) -> tuple[tuple[float, ...] | None, str]:
    """(row, column) spacing on the detector in mm, or None; and the keyword of the attribute that it comes from."""
    if given.imager_pixel_spacing_mm is not None:
        remarks.append(f"{tag_name('ImagerPixelSpacing')}: {given.imager_pixel_spacing_mm} as given")
        return given.imager_pixel_spacing_mm, "ImagerPixelSpacing"
    if given.use_pixel_spacing is None:
        return numbers(dataset, "ImagerPixelSpacing", 2), "ImagerPixelSpacing"
    patient = numbers(dataset, "PixelSpacing", 2)
    if patient is None:
        return None, "PixelSpacing"
    at_isocentre = given.use_pixel_spacing == "isocentre"
    remarks.append(
        f"{tag_name('PixelSpacing')} {patient[0]:g}\\{patient[1]:g} mm taken as that at the"
        f" {'iso-centre' if at_isocentre else 'detector'}, as asked for"
    )
    return tuple((magnification if at_isocentre else 1.0) * one for one in patient), "PixelSpacing"


def _check_spacing(dataset: Any, spacing: tuple[float, float], remarks: list[str]) -> None:
    row, column = spacing
    if not (row > 0.0 and column > 0.0):
        raise RecordingError(f"{tag_name('ImagerPixelSpacing')}: must be above zero, found {row:g}\\{column:g}")
    field = numbers(dataset, "FieldOfViewDimensions")
    if not field or field[-1] <= 0.0:
        return
    width = column * int(dataset.Columns)
    if abs(width / field[-1] - 1.0) > _FIELD_DISAGREEMENT:
        remarks.append(
            f"{tag_name('FieldOfViewDimensions')} is {field[-1]:g} mm wide, the pixels together {width:.1f} mm: is"
            f" {tag_name('ImagerPixelSpacing')} that of the pixels as stored? It is used as it is"
        )


def _increments(dataset: Any, keyword: str, frames: int, given: GivenGeometry) -> np.ndarray[Any, np.dtype[np.float64]]:
    """(frames,) what is to be added to the value of frame 1 (PS3.3 C.8.7.5.1.3: a vector, or an average a frame)."""
    values = numbers(dataset, keyword)
    if values is None:
        return np.zeros(frames)
    if len(values) == 1:
        return values[0] * np.arange(frames, dtype=np.float64)
    if len(values) != frames:
        raise RecordingError(f"{tag_name(keyword)}: expected 1 or {frames} values, found {len(values)}")
    vector = np.asarray(values, dtype=np.float64)
    return np.cumsum(vector) - vector[0] if given.increments == "steps" else vector
