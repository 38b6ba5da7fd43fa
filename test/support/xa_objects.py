"""XA and Enhanced XA objects as an archive would have them, written by pydicom from pictures and a C-arm's settings."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from datetime import datetime, timedelta
from pathlib import Path
from typing import Any

import numpy as np
from pydicom.dataset import Dataset, FileDataset, FileMetaDataset
from pydicom.sequence import Sequence as Items
from pydicom.uid import ExplicitVRLittleEndian, generate_uid

CLASSIC = "1.2.840.10008.5.1.4.1.1.12.1"
ENHANCED = "1.2.840.10008.5.1.4.1.1.12.1.1"
START = datetime(2025, 3, 4, 10, 11, 12, 250000)


@dataclass
class Shot:
    """One plane's run; angles and table by frame, where they change."""

    pictures: Sequence[np.ndarray]
    primary_deg: Sequence[float]
    secondary_deg: Sequence[float]
    spacing_mm: tuple[float, float] = (0.4, 0.4)
    sid_mm: float = 1200.0
    sod_mm: float = 785.0
    frame_ms: float = 250.0
    begin_s: float = 0.0
    table_mm: Sequence[tuple[float, float, float]] = ()
    bits: int = 8
    change: Callable[[Any], None] = field(default=lambda dataset: None)


def write_classic(path: Path, shot: Shot) -> Path:
    dataset = _common(path, CLASSIC, shot)
    dataset.ImageType = ["ORIGINAL", "PRIMARY", "SINGLE PLANE"]
    dataset.PatientPosition = "HFS"
    when = START + timedelta(seconds=shot.begin_s)
    dataset.AcquisitionDate = dataset.ContentDate = when.strftime("%Y%m%d")
    dataset.AcquisitionTime = dataset.ContentTime = when.strftime("%H%M%S.%f")
    dataset.DistanceSourceToDetector = shot.sid_mm
    dataset.DistanceSourceToPatient = shot.sod_mm
    dataset.ImagerPixelSpacing = list(shot.spacing_mm)
    dataset.PixelSpacing = [0.1, 0.1]  # calibrated on something else: must not be taken
    dataset.PositionerPrimaryAngle = shot.primary_deg[0]
    dataset.PositionerSecondaryAngle = shot.secondary_deg[0]
    moving = np.ptp(shot.primary_deg) + np.ptp(shot.secondary_deg) > 0
    dataset.PositionerMotion = "DYNAMIC" if moving else "STATIC"
    if moving:
        dataset.PositionerPrimaryAngleIncrement = [one - shot.primary_deg[0] for one in shot.primary_deg]
        dataset.PositionerSecondaryAngleIncrement = [one - shot.secondary_deg[0] for one in shot.secondary_deg]
    if shot.table_mm:
        left, back, head = (np.asarray(shot.table_mm) - shot.table_mm[0]).T.tolist()
        dataset.TableMotion = "DYNAMIC"
        # As PS3.3 C.8.7.4 has them: longitudinal towards LAO, lateral towards CRAN.
        dataset.TableLongitudinalIncrement, dataset.TableLateralIncrement = left, head
        dataset.TableVerticalIncrement = back
    dataset.FrameTime = shot.frame_ms
    return _save(path, dataset, shot)


def write_enhanced(
    path: Path,
    shot: Shot,
    *,
    detector_rotation_deg: float = 0.0,
    quarter: int = 0,
    flip: bool = False,
    isocentre: tuple[float, float] = (800.0, 700.0),
    origin: tuple[float, float] = (100.0, 120.0),
    element_mm: tuple[float, float] = (0.2, 0.2),
) -> Path:
    """`isocentre`: of its projection, in detector elements as (0018,9430) has them; `origin` as (0018,7030)."""
    dataset = _common(path, ENHANCED, shot)
    dataset.ImageType = ["ORIGINAL", "PRIMARY"]
    dataset.CArmPositionerTabletopRelationship = "YES"
    dataset.XRayReceptorType = "DIGITAL_DETECTOR"
    dataset.PositionOfIsocenterProjection = list(isocentre)
    dataset.DetectorElementSpacing = list(element_mm)
    dataset.DetectorElementPhysicalSize = [0.9 * size for size in element_mm]  # smaller than their pitch
    shared = Dataset()
    shared.FramePixelDataPropertiesSequence = Items([_item(ImagerPixelSpacing=list(shot.spacing_mm))])
    shared.XRayGeometrySequence = Items(
        [_item(DistanceSourceToDetector=shot.sid_mm, DistanceSourceToIsocenter=shot.sod_mm)]
    )
    shared.FieldOfViewSequence = Items(
        [
            _item(
                FieldOfViewOrigin=list(origin),
                FieldOfViewRotation=quarter,
                FieldOfViewHorizontalFlip="YES" if flip else "NO",
            )
        ]
    )
    dataset.SharedFunctionalGroupsSequence = Items([shared])
    frames = []
    for index, (primary, secondary) in enumerate(zip(shot.primary_deg, shot.secondary_deg, strict=True)):
        when = START + timedelta(seconds=shot.begin_s, milliseconds=index * shot.frame_ms)
        table = shot.table_mm[index] if shot.table_mm else (12.0, 140.0, -75.0)
        frame = Dataset()
        frame.FrameContentSequence = Items([_item(FrameAcquisitionDateTime=when.strftime("%Y%m%d%H%M%S.%f"))])
        frame.IsocenterReferenceSystemSequence = Items(
            [
                _item(
                    PositionerIsocenterPrimaryAngle=primary,
                    PositionerIsocenterSecondaryAngle=secondary,
                    PositionerIsocenterDetectorRotationAngle=detector_rotation_deg,
                    TableXPositionToIsocenter=table[0],
                    TableYPositionToIsocenter=table[1],
                    TableZPositionToIsocenter=table[2],
                    TableHorizontalRotationAngle=0.0,
                    TableHeadTiltAngle=0.0,
                    TableCradleTiltAngle=0.0,
                )
            ]
        )
        frames.append(frame)
    dataset.PerFrameFunctionalGroupsSequence = Items(frames)
    return _save(path, dataset, shot)


def _item(**values: Any) -> Dataset:
    item = Dataset()
    for keyword, value in values.items():
        setattr(item, keyword, value)
    return item


def _common(path: Path, kind: str, shot: Shot) -> FileDataset:
    meta = FileMetaDataset()
    meta.MediaStorageSOPClassUID = kind
    meta.MediaStorageSOPInstanceUID = generate_uid(entropy_srcs=[path.name, kind])
    meta.TransferSyntaxUID = ExplicitVRLittleEndian
    dataset = FileDataset(str(path), {}, file_meta=meta, preamble=b"\0" * 128)
    dataset.SOPClassUID, dataset.SOPInstanceUID = kind, meta.MediaStorageSOPInstanceUID
    dataset.Modality = "XA"
    dataset.PatientName, dataset.PatientID, dataset.StudyDate = "Doe^Jane", "4711", "20250304"
    dataset.BurnedInAnnotation = "NO"
    rows, columns = shot.pictures[0].shape
    dataset.Rows, dataset.Columns, dataset.NumberOfFrames = rows, columns, len(shot.pictures)
    dataset.SamplesPerPixel, dataset.PhotometricInterpretation = 1, "MONOCHROME2"
    dataset.BitsAllocated = 8 if shot.bits <= 8 else 16
    dataset.BitsStored, dataset.HighBit, dataset.PixelRepresentation = shot.bits, shot.bits - 1, 0
    kind_of_pixel = np.uint8 if shot.bits <= 8 else np.uint16
    data = np.stack(shot.pictures).astype(kind_of_pixel).tobytes()
    dataset.PixelData = data + b"\0" * (len(data) % 2)
    return dataset


def _save(path: Path, dataset: FileDataset, shot: Shot) -> Path:
    shot.change(dataset)
    dataset.save_as(path, enforce_file_format=True)
    return path
