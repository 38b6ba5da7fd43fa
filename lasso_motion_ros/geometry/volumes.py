"""Medical volumes from files: NIfTI, NRRD, MetaImage, or a folder with a DICOM series, in patient axes LPS.

The reader is SimpleITK's (the optional extra `volume`). Each of these formats states its own axes, whatever they
are (NIfTI: RAS; NRRD: either), and SimpleITK turns them all into LPS: +x left, +y posterior, +z cranial.
"""

from __future__ import annotations

import gzip
import importlib
import locale
import math
import re
import zlib
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from lasso_motion_ros.core.errors import VolumeError

Array = npt.NDArray[np.float64]

MOST_BYTES = 1 << 30
"""Of a volume's samples: 512 × 512 × 2048 of 16 bits. A small packed file may promise any number."""
_HEADER_BYTES = 1 << 16
_NIFTI_HEADER_BYTES = 348
_LARGEST_RATIO = 1032
"""Of what is packed by DEFLATE, as these formats are, to what it unpacks to."""
_READERS = {
    ".nii": "NiftiImageIO",
    ".nii.gz": "NiftiImageIO",
    ".nrrd": "NrrdImageIO",
    ".nhdr": "NrrdImageIO",
    ".mha": "MetaImageIO",
    ".mhd": "MetaImageIO",
    ".dcm": "GDCMImageIO",
}
VOLUME_SUFFIXES = tuple(_READERS)
_NRRD_DATA = re.compile(rb"^[ \t]*data ?file[ \t]*:[ \t]*(.*)$", re.IGNORECASE | re.MULTILINE)
_META_DATA = re.compile(rb"^[ \t]*ElementDataFile[ \t]*[=:][ \t]*(.*)$", re.IGNORECASE | re.MULTILINE)
_META_PACKED = re.compile(rb"^[ \t]*CompressedData[ \t]*[=:][ \t]*[Tt1Yy]", re.MULTILINE)
_META_LOCAL = re.compile(rb"^[ \t]*ElementDataFile[ \t]*[=:][ \t]*LOCAL[ \t]*\r?\n", re.MULTILINE)
_ANY_PACK = 32 + zlib.MAX_WBITS  # zlib's or gzip's
_META_DIMENSIONS = re.compile(rb"^[ \t]*NDims[ \t]*[=:][ \t]*(.*?)[ \t]*$", re.MULTILINE)
_DATA_FILE = {".nrrd": _NRRD_DATA, ".nhdr": _NRRD_DATA, ".mha": _META_DATA, ".mhd": _META_DATA}
"""Where the headers that may name other files do so, by suffix."""


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
            scalar volume of at least 2 finite samples a side; more than `MOST_BYTES`, or a header that names a file
            outside its own folder.
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
            image = _read_series(itk, path) if path.is_dir() else _read_file(itk, path)
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


def _read_file(itk: Any, path: Path) -> Any:
    """One file, by the reader of its suffix; its header is judged before a sample is unpacked."""
    reader_name = next((name for suffix, name in _READERS.items() if path.name.lower().endswith(suffix)), None)
    if reader_name is None:
        raise VolumeError(f"{path}: expected a volume as {', '.join(_READERS)}, found {path.suffix or 'no suffix'}")
    named = _named_data_files(path)
    _refuse_foreign_data(path, named)
    reader = itk.ImageFileReader()
    reader.SetImageIO(reader_name)
    reader.SetFileName(str(path))
    held = None if reader_name == _READERS[".dcm"] else _held_bytes(path, named)
    promised = _refuse_too_large(itk, reader, path, 1, held)
    if reader_name == _READERS[".nii"]:
        _refuse_cut_short(path, promised)
    if reader_name == _READERS[".mha"] and len(named) <= 1:
        _refuse_damaged_pack(path, named, promised)
    return reader.Execute()


def _refuse_too_large(itk: Any, reader: Any, path: Path, files: int, held: int | None) -> int:
    """The bytes of all samples, by the headers; `held` is how many there are in files, None where that is not known."""
    reader.ReadImageInformation()
    sample = itk.Image([1, 1], reader.GetPixelID(), reader.GetNumberOfComponents())
    a_sample = sample.GetSizeOfPixelComponent() * reader.GetNumberOfComponents()
    size = math.prod(reader.GetSize()) * a_sample * files
    promise = f"{path}: its header promises {size / 2**20:.0f} MiB of samples"
    if size > MOST_BYTES:
        raise VolumeError(f"{promise}, at most {MOST_BYTES >> 20} MiB are read")
    if held is not None and size > _LARGEST_RATIO * held:  # memory for all of them would be taken first
        raise VolumeError(f"{promise}, more than {held} bytes can hold")
    return int(size)


def _refuse_cut_short(path: Path, promised: int) -> None:
    """The NIfTI reader of ITK takes samples that are not there for zero, without a word."""
    with path.open("rb") as file:
        packed = file.read(2) == b"\x1f\x8b"
    missing = promised + _NIFTI_HEADER_BYTES
    try:
        with gzip.open(path) if packed else path.open("rb") as file:
            while missing > 0 and (part := file.read(min(missing, 1 << 20))):
                missing -= len(part)
    except (EOFError, zlib.error, gzip.BadGzipFile) as error:
        raise VolumeError(f"{path}: it is cut short or damaged: {error}") from error
    if missing > 0:
        raise VolumeError(f"{path}: it is cut short: {missing} bytes of samples are missing")


def _refuse_damaged_pack(path: Path, named: list[str], promised: int) -> None:
    """The MetaImage reader of ITK gives what a damaged pack unpacks to, and what lay in memory for the rest."""
    with path.open("rb") as file:
        head = file.read(_HEADER_BYTES)
    local = _META_LOCAL.search(head)
    if not _META_PACKED.search(head[: local.start()] if local else head) or not (local or named):
        return
    missing, unpacker = promised, zlib.decompressobj(_ANY_PACK)
    try:
        with (path if local else path.parent / named[0]).open("rb") as file:
            file.seek(local.end() if local else 0)
            while missing > 0 and not unpacker.eof and (part := file.read(1 << 20)):
                while part and missing > 0:
                    missing -= len(unpacker.decompress(part, min(missing, 1 << 24)))
                    part = unpacker.unconsumed_tail
            if missing == 0 and not unpacker.eof:  # the check sum stands behind the last sample
                unpacker.decompress(unpacker.unconsumed_tail + file.read(64), 1)
    except (OSError, zlib.error) as error:
        raise VolumeError(f"{path}: its samples are damaged: {error}") from error
    if missing > 0:
        raise VolumeError(f"{path}: it is cut short: {missing} bytes of samples are missing")


def _held_bytes(path: Path, named: list[str]) -> int | None:
    """Of a file and those that its header names, all of one folder; None where the names are a pattern's."""
    files = [path, *(path.parent / name for name in named)]
    return sum(file.stat().st_size for file in files) if all(file.is_file() for file in files) else None


def _refuse_foreign_data(path: Path, named: list[str]) -> None:
    """A header may name the files that hold its samples; one of another folder is none of its business."""
    for name in named:
        beside = (path.parent / name).resolve()
        if Path(name).is_absolute() or beside.parent != path.parent.resolve():
            raise VolumeError(f"{path}: its header names {name!r}, a file outside its own folder, which is not read")


def _named_data_files(path: Path) -> list[str]:
    try:
        with path.open("rb") as file:
            head = file.read(_HEADER_BYTES)
            longer = len(head) == _HEADER_BYTES
    except OSError as error:
        raise VolumeError(f"{path}: cannot be read: {error.strerror}") from error
    entry = _DATA_FILE.get(path.suffix.lower())
    if entry is None:
        return []
    text = head.replace(b"\r\n", b"\n").replace(b"\r", b"\n")
    if entry is _META_DATA:
        for found in _META_DIMENSIONS.finditer(text):
            if not re.match(rb"\d\d?(?!\d)", found[1]):  # of others ITK's reader loops without an end
                number = found[1][:20].decode("utf-8", "replace")
                raise VolumeError(f"{path}: its header says NDims = {number}, expected 3")
    if path.suffix.lower() in (".nrrd", ".nhdr"):
        text, end, _ = text.partition(b"\n\n")
        longer = longer and not end
    names: list[bytes] = []
    for found in entry.finditer(text):
        if found[1].strip() == b"LOCAL":
            return []  # what follows are the samples
        # A list of names stands in the lines behind; behind a pattern stand numbers.
        listed = found[1].upper().startswith(b"LIST")
        names += text[found.end() :].splitlines() if listed else [re.sub(rb"( +-?\d+)+\s*$", b"", found[1])]
    if longer and not names:
        raise VolumeError(f"{path}: its header is longer than {_HEADER_BYTES >> 10} KiB")
    return [name for one in names if (name := one.decode("utf-8", "replace").strip())]


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
    names = files[series[0]]
    single = itk.ImageFileReader()
    single.SetImageIO(_READERS[".dcm"])
    single.SetFileName(names[0])
    _refuse_too_large(itk, single, folder, len(names), None)
    reader.SetFileNames(names)
    return reader.Execute()
