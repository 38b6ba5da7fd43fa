"""Medical volumes from files: NIfTI, NRRD, MetaImage, or a folder with a DICOM series, in patient axes LPS.

The reader is SimpleITK's (the optional extra `volume`). Each of these formats states its own axes, whatever they
are (NIfTI: RAS; NRRD: either), and SimpleITK turns them all into LPS: +x left, +y posterior, +z cranial.
"""

from __future__ import annotations

import importlib
import locale
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from lasso_motion_ros.core.errors import VolumeError

Array = npt.NDArray[np.float64]

VOLUME_SUFFIXES = (".nii", ".nii.gz", ".nrrd", ".nhdr", ".mha", ".mhd", ".dcm")


@dataclass(frozen=True, eq=False)
class VolumeImage:
    """Samples on a grid.

    Attributes:
        values: (Z, Y, X) samples of the file's own type.
        to_lps: (4, 4) index (x, y, z) of a sample to patient axes LPS, metres.
    """

    values: npt.NDArray[Any]
    to_lps: Array

    @property
    def spacing_m(self) -> Array:
        """(3,) distance between samples along x, y and z of the grid, metres."""
        return np.asarray(np.linalg.norm(self.to_lps[:3, :3], axis=0))


def is_volume(path: str | Path) -> bool:
    """Whether a path names a volume by its suffix, or is a folder (of DICOM files)."""
    path = Path(path)
    return path.is_dir() or path.name.lower().endswith(VOLUME_SUFFIXES)


def read_volume_image(path: str | Path, metres_per_unit: float = 1e-3) -> VolumeImage:
    """Read one scalar 3-D volume.

    Args:
        path: a file, or the folder of one DICOM series.
        metres_per_unit: of the file's coordinates; the formats are in millimetres.

    Raises:
        VolumeError: SimpleITK is not installed, no such file, not readable, several series in the folder, or not one
            scalar volume of at least 2 finite samples a side.
    """
    path = Path(path)
    try:
        itk = importlib.import_module("SimpleITK")
    except ImportError as error:
        raise VolumeError(f"{path}: a volume needs SimpleITK: pip install 'lasso_motion_ros[volume]'") from error
    if not path.exists():
        raise VolumeError(f"{path}: no such file")
    try:
        # GDCM leaves the process's locale at C, after which it would take text files for ASCII.
        before = locale.setlocale(locale.LC_ALL)
        try:
            image = _read_series(itk, path) if path.is_dir() else itk.ReadImage(str(path))
        finally:
            locale.setlocale(locale.LC_ALL, before)
    except RuntimeError as error:
        raise VolumeError(f"{path}: cannot be read as NIfTI, NRRD, MHA or DICOM") from error
    if image.GetDimension() != 3 or image.GetNumberOfComponentsPerPixel() != 1:
        raise VolumeError(
            f"{path}: expected one 3-D volume of single values, found {image.GetDimension()}-D data with "
            f"{image.GetNumberOfComponentsPerPixel()} values a voxel"
        )
    values = itk.GetArrayFromImage(image)
    if min(values.shape) < 2 or not np.all(np.isfinite(values)):
        raise VolumeError(f"{path}: expected at least 2 finite voxels a side, found shape {values.shape}")
    to_lps = np.eye(4)
    to_lps[:3, :3] = np.asarray(image.GetDirection(), np.float64).reshape(3, 3) * np.asarray(image.GetSpacing())
    to_lps[:3, 3] = image.GetOrigin()
    to_lps[:3] *= metres_per_unit
    return VolumeImage(values, to_lps)


def _read_series(itk: Any, folder: Path) -> Any:
    """The folder's only DICOM series as an image."""
    reader = itk.ImageSeriesReader()
    series = reader.GetGDCMSeriesIDs(str(folder))
    if not series:
        raise VolumeError(f"{folder}: no DICOM series in this folder")
    files = {one: reader.GetGDCMSeriesFileNames(str(folder), one) for one in series}
    if len(series) > 1:
        counts = ", ".join(f"{one} ({len(names)} files)" for one, names in files.items())
        raise VolumeError(f"{folder}: {len(series)} DICOM series, expected one to a folder: {counts}")
    reader.SetFileNames(files[series[0]])
    return reader.Execute()
