"""Volumes of bodies known by formula, as files, for the tests of reading and drawing them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

RADII_M = (0.024, 0.016, 0.020)
CENTRE_M = np.array([0.004, -0.006, 0.010])
SPACING_MM = (1.5, 1.2, 2.0)
INSIDE, OUTSIDE = 300, -50
LABEL = 7


def write_ellipsoid(path: Path, *, label: bool = False, turned: bool = False) -> Path:
    """An ellipsoid at CENTRE_M in LPS: a CT-like ramp at its wall, or a label map; the grid oblique if `turned`."""
    itk = pytest.importorskip("SimpleITK")
    size = np.array([56, 56, 44])
    # A turn about an oblique axis, so that no axis of the grid is one of the patient's.
    direction = Rotation.from_quat([0.25, -0.15, 0.35, np.sqrt(1 - 0.2075)]).as_matrix() if turned else np.eye(3)
    origin = 1e3 * CENTRE_M - direction @ (np.array(SPACING_MM) * (size - 1) / 2.0 + [2.0, -3.0, 1.0])
    z, y, x = np.indices(size[::-1])
    index = np.stack([x, y, z], axis=-1) * SPACING_MM
    lps = 1e-3 * (index @ direction.T + origin)
    # Distance from the wall, to first order: positive inside, metres.
    unit = np.linalg.norm((lps - CENTRE_M) / RADII_M, axis=-1)
    inside = (1.0 - unit) * np.linalg.norm(lps - CENTRE_M, axis=-1) / np.maximum(unit, 1e-6)
    if label:
        values = np.where(inside > 0.0, LABEL, 0).astype(np.uint8)
        values[:3, :3, :3] = LABEL + 1  # another structure, which is not to be shown
    else:
        share = np.clip(inside / 2e-3 + 0.5, 0.0, 1.0)
        values = np.rint(OUTSIDE + share * (INSIDE - OUTSIDE)).astype(np.int16)
    image = itk.GetImageFromArray(values)
    image.SetSpacing(SPACING_MM)
    image.SetOrigin(origin)
    image.SetDirection(direction.ravel())
    itk.WriteImage(image, str(path))
    return path


def write_dicom_series(folder: Path, values: np.ndarray, spacing_mm: float, series: str = "1") -> None:
    """A CT series of (Z, Y, X) int16 samples whose first lies at −10, −20, −30 mm."""
    itk = pytest.importorskip("SimpleITK")
    folder.mkdir(exist_ok=True)
    for number, plane in enumerate(values):
        image = itk.GetImageFromArray(plane[None])
        image.SetSpacing((spacing_mm, spacing_mm, spacing_mm))
        for tag, value in {
            "0008|0060": "CT",
            "0008|0018": f"1.2.826.0.1.3680043.2.1125.{series}.{number + 1}",
            "0020|000d": "1.2.826.0.1.3680043.2.1125.9",
            "0020|000e": f"1.2.826.0.1.3680043.2.1125.{series}",
            "0020|0013": str(number + 1),
            "0020|0032": f"-10\\-20\\{-30 + number * spacing_mm}",
            "0020|0037": "1\\0\\0\\0\\1\\0",
            "0028|1052": "0",
            "0028|1053": "1",
        }.items():
            image.SetMetaData(tag, value)
        writer = itk.ImageFileWriter()
        writer.KeepOriginalImageUIDOn()
        # Names against the order of the planes: it is the position that counts.
        writer.SetFileName(str(folder / f"{series}_{len(values) - number:03d}.dcm"))
        writer.Execute(image)
