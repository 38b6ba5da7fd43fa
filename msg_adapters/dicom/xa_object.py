"""One XA object, classic or Enhanced: its frames with their times and projections, and what was taken for granted."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from lasso_motion_ros.core.errors import LassoMotionError, RecordingError
from lasso_motion_ros.geometry.projection import Projection
from msg_adapters.dicom.classic_geometry import classic_geometry, classic_times
from msg_adapters.dicom.enhanced_geometry import enhanced_geometry, enhanced_times, nanoseconds, table_angles
from msg_adapters.dicom.frame_geometry import FrameGeometry
from msg_adapters.dicom.given_geometry import GivenGeometry
from msg_adapters.dicom.objects import ENHANCED_XA, number, numbers, open_object, tag_name, word
from msg_adapters.dicom.pixels import check_pixels, frames
from msg_adapters.images import Pixels

IDENTITY = ("PatientName", "PatientID", "PatientBirthDate", "PatientSex", "StudyInstanceUID", "SOPInstanceUID")


@dataclass(frozen=True, eq=False)
class XaObject:
    """One plane's object.

    Attributes:
        path: its file.
        enhanced: whether it is an Enhanced XA object.
        width: of the pictures, pixels.
        height: of the pictures, pixels.
        times_ns: (N,) of each frame, since the first.
        clocks: keyword of a clock → what it said at the first frame, nanoseconds since 1970.
        fine_clocks: the clocks that were read to fractions of a second.
        geometry: (N,) of each frame.
        r_waves: indices of the frames in which an R wave lies.
        remarks: what was taken for granted, a line each.
        table_turn_deg: (3,) how the table is turned.
        dataset: the object without its pixels.
    """

    path: Path
    enhanced: bool
    width: int
    height: int
    times_ns: tuple[int, ...]
    clocks: Mapping[str, int]
    fine_clocks: frozenset[str]
    geometry: tuple[FrameGeometry, ...]
    r_waves: tuple[int, ...]
    remarks: tuple[str, ...]
    table_turn_deg: tuple[float, ...]
    dataset: Any

    def projections(self, table_reference_mm: tuple[float, float, float]) -> list[Projection]:
        """(N,) of each frame, from metres in the world.

        Args:
            table_reference_mm: where the table is while world and iso-centre coincide.

        Raises:
            RecordingError: distances that no C-arm has.
        """
        try:
            return [one.projection(self.width, self.height, table_reference_mm) for one in self.geometry]
        except RecordingError as error:
            raise RecordingError(f"{self.path}: {error}") from error

    def pictures(self, *, voi_lut: bool = False) -> Iterator[Pixels]:
        """(H, W) uint8 or uint16, frame by frame.

        Args:
            voi_lut: as the object's display would show them.

        Raises:
            RecordingError: pixels that cannot be decoded, or another number of frames.
        """
        count = 0
        for picture in frames(self.path, self.dataset, voi_lut=voi_lut):
            count += 1
            if count <= len(self.times_ns):
                yield picture
        if count != len(self.times_ns):
            raise RecordingError(
                f"{self.path}: {tag_name('NumberOfFrames')}: expected {len(self.times_ns)} pictures, found {count}"
            )

    def identity(self) -> dict[str, str]:
        """What the object says of patient and examination."""
        return {keyword: text for keyword in IDENTITY if (text := word(self.dataset, keyword))}


def read_xa(path: Path, given: GivenGeometry) -> XaObject:
    """Read an object's frames, times and geometry; its pictures are read later, one by one.

    Args:
        path: the file.
        given: what the user says where the object does not.

    Raises:
        RecordingError: it cannot be read, is of another kind, or lacks what is needed; named by tag.
    """
    dataset = open_object(path)
    try:
        return _read(path, dataset, given)
    except LassoMotionError as error:
        raise RecordingError(f"{path}: {error}") from error
    except Exception as error:  # pydicom converts values when they are asked for, and lets all errors through
        raise RecordingError(f"{path}: cannot be read as DICOM: {' '.join(str(error).split())[:300]}") from error


def _read(path: Path, dataset: Any, given: GivenGeometry) -> XaObject:
    remarks: list[str] = []
    check_pixels(dataset, remarks)
    count = int(number(dataset, "NumberOfFrames") or 1)
    if count < 1:
        raise RecordingError(f"{tag_name('NumberOfFrames')}: expected 1 or more, found {count}")
    enhanced = str(dataset.SOPClassUID) == ENHANCED_XA
    if enhanced:
        geometry = enhanced_geometry(dataset, count, given, remarks)
        stamps = enhanced_times(dataset, count)
        times = tuple(stamp - stamps[0] for stamp in stamps)
        clocks, fine = {"FrameAcquisitionDateTime": stamps[0]}, {"FrameAcquisitionDateTime"}
    else:
        geometry = classic_geometry(dataset, count, given, remarks)
        times = classic_times(dataset, count, given, remarks)
        clocks, fine = _clocks(dataset, remarks)
    return XaObject(
        path=path,
        enhanced=enhanced,
        width=int(dataset.Columns),
        height=int(dataset.Rows),
        times_ns=times,
        clocks=clocks,
        fine_clocks=frozenset(fine),
        geometry=geometry,
        r_waves=_r_waves(dataset, count, remarks),
        remarks=tuple(remarks),
        table_turn_deg=table_angles(dataset, 0) if enhanced else (0.0, 0.0, 0.0),
        dataset=dataset,
    )


def _clocks(dataset: Any, remarks: list[str]) -> tuple[dict[str, int], set[str]]:
    """What a classic object says of the time of its first frame, in the order of trust; which of it has fractions.

    One that is no time is passed over, with a remark: another, the pictures, or the user may say it.
    """
    clocks: dict[str, int] = {}

    def add(text: str, keyword: str) -> None:
        try:
            clocks[keyword] = nanoseconds(text, keyword)
        except RecordingError as error:
            remarks.append(f"{error}; this clock is passed over")

    fine = {one for one in ("AcquisitionDateTime", "AcquisitionTime", "ContentTime") if "." in word(dataset, one)}
    if text := word(dataset, "AcquisitionDateTime"):
        add(text, "AcquisitionDateTime")
    for kind in ("Acquisition", "Content"):
        day = word(dataset, f"{kind}Date") or word(dataset, "StudyDate")
        if day and (time := word(dataset, f"{kind}Time")):
            add(day.replace(".", "") + time.replace(":", ""), f"{kind}Time")
    if "ContentTime" in clocks:
        clocks["ContentTime"] += round(1e6 * (number(dataset, "FrameDelay") or 0.0))
    return clocks, fine


def _r_waves(dataset: Any, count: int, remarks: list[str]) -> tuple[int, ...]:
    pointers = numbers(dataset, "RWavePointer") or ()
    inside = tuple(sorted({int(one) - 1 for one in pointers if 1 <= one <= count}))
    if inside:
        remarks.append(f"{len(inside)} R peaks from {tag_name('RWavePointer')}, each to within a frame")
    return inside
