"""Writes a recording as a pair of DICOM XA objects, as an archive would hand them out: something to try the import on.

    python examples/dicom_pair.py bags/two_breaths.mcap A.dcm B.dcm

The C-arm's angles and distances are taken from the recording's calibration, which must be that of an ideal C-arm with
the iso-centre in the middle of the picture. Clicks in the recording are printed as a seeds file.
"""

from __future__ import annotations

import sys
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np
from pydicom.dataset import FileDataset, FileMetaDataset
from pydicom.uid import ExplicitVRLittleEndian, XRayAngiographicImageStorage, generate_uid

from msg_adapters.calibrations import decode_camera_info
from msg_adapters.images import decode_image
from msg_adapters.recordings.reader import RecordingReader

PIXEL_MM = 0.4  # a calibration tells the detector's size in pixels only: any pitch will do


def empty_object(path: Path) -> FileDataset:
    """An XA object that has its identity and nothing else."""
    meta = FileMetaDataset()
    meta.MediaStorageSOPClassUID = XRayAngiographicImageStorage
    meta.MediaStorageSOPInstanceUID = generate_uid()
    meta.TransferSyntaxUID = ExplicitVRLittleEndian
    dataset = FileDataset(str(path), {}, file_meta=meta, preamble=b"\0" * 128)
    dataset.SOPClassUID, dataset.SOPInstanceUID = meta.MediaStorageSOPClassUID, meta.MediaStorageSOPInstanceUID
    dataset.Modality, dataset.PatientName, dataset.BurnedInAnnotation = "XA", "Phantom", "NO"
    return dataset


def set_geometry(dataset: Any, camera_info: Any) -> None:
    """Angles of the detector about the patient, and distances: what the XA Positioner module holds."""
    projection = decode_camera_info(camera_info)
    towards = projection.viewing_direction
    dataset.PatientPosition, dataset.PositionerMotion = "HFS", "STATIC"
    dataset.PositionerPrimaryAngle = round(float(np.degrees(np.arctan2(towards[0], -towards[1]))), 6)
    dataset.PositionerSecondaryAngle = round(float(np.degrees(np.arcsin(towards[2]))), 6)
    dataset.DistanceSourceToDetector = round(projection.focal_length_px * PIXEL_MM, 6)
    dataset.DistanceSourceToPatient = round(1e3 * float(projection.depth(np.zeros(3))), 6)
    dataset.ImagerPixelSpacing = [PIXEL_MM, PIXEL_MM]


def set_pictures(dataset: Any, stamps_s: list[float], pictures: list[np.ndarray]) -> None:
    """The film and its times."""
    begin = datetime.fromtimestamp(stamps_s[0], UTC)
    dataset.AcquisitionDate, dataset.AcquisitionTime = begin.strftime("%Y%m%d"), begin.strftime("%H%M%S.%f")
    dataset.FrameTimeVector = [0.0, *np.round(1e3 * np.diff(stamps_s), 6)]
    dataset.Rows, dataset.Columns = pictures[0].shape
    dataset.NumberOfFrames, dataset.SamplesPerPixel = len(pictures), 1
    dataset.PhotometricInterpretation, dataset.PixelRepresentation = "MONOCHROME2", 0
    dataset.BitsAllocated = dataset.BitsStored = 8 * pictures[0].itemsize
    dataset.HighBit = dataset.BitsStored - 1
    dataset.PixelData = np.stack(pictures).tobytes()


def main(recording: str, *outputs: str) -> None:
    """Write one object a plane, and print the clicks."""
    messages = [(one.topic, one.message) for one in RecordingReader(Path(recording)).messages()]
    for plane, output in zip("ab", outputs, strict=True):
        images = [message for topic, message in messages if topic == f"/plane_{plane}/image_raw"]
        dataset = empty_object(Path(output))
        set_geometry(dataset, next(message for topic, message in messages if topic == f"/plane_{plane}/camera_info"))
        stamps = [image.header.stamp.sec + 1e-9 * image.header.stamp.nanosec for image in images]
        set_pictures(dataset, stamps, [decode_image(image) for image in images])
        dataset.save_as(output, enforce_file_format=True)
        for clicks in (message for topic, message in messages if topic == f"/plane_{plane}/seed"):
            points = [[round(point.x, 1), round(point.y, 1)] for point in clicks.polygon.points]
            sys.stdout.write(f"plane_{plane}:\n  points: {points}\n")


if __name__ == "__main__":
    main(*sys.argv[1:])
