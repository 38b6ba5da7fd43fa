"""The pairs of XA objects in folders: which two belong together, and which of them is plane A's."""

from __future__ import annotations

import os
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from lasso_motion_ros.core.errors import RecordingError
from msg_adapters.dicom.objects import group_item, number, open_object, word

_PREAMBLE, _MARK = 128, b"DICM"
_PLANES = {"BIPLANE A": "a", "BIPLANE B": "b"}


@dataclass(frozen=True)
class FoundPair:
    """Two objects of one folder, or why there are none.

    Attributes:
        paths: plane A's object and plane B's, absolute; of a folder in which none can be told, all of it.
        name: what the recording is called, without suffix: the folder's path below the one that was named, and plane
            A's file where the folder has several pairs.
        problem: why the objects cannot be paired; empty where they can.
    """

    paths: tuple[Path, ...]
    name: Path
    problem: str = ""


def find_pairs(folders: Sequence[Path], without: Sequence[Path] = ()) -> list[FoundPair]:
    """The pairs in folders, at any depth; hidden files and what is no XA object are passed over.

    Objects that call themselves BIPLANE A and B (ImageType, value 3) are paired by their ReferencedImageSequence, or if
    there is one of each. Of two others that are alone in their folder the more frontal one is plane A's
    (PositionerPrimaryAngle, PositionerIsocenterPrimaryAngle).

    Args:
        folders: where to look.
        without: folders to pass over (where recordings go).

    Raises:
        RecordingError: a place that is no folder, one without an XA object, or two pairs of one name.
    """
    passed_over = {os.path.realpath(one) for one in without}
    found: dict[Path, FoundPair] = {}
    for folder in folders:
        if not folder.is_dir():
            raise RecordingError(f"{folder}: expected a folder with DICOM XA objects")
        here = list(_below(folder.absolute(), folder.absolute(), passed_over))
        if not here:
            raise RecordingError(f"{folder}: expected DICOM XA objects, found none")
        for one in here:
            if found.setdefault(one.name, one) is not one:
                raise RecordingError(f"{folder}: two recordings would be called {one.name}; name the folder above both")
    return list(found.values())


def _below(top: Path, folder: Path, passed_over: set[str]) -> Iterator[FoundPair]:
    if os.path.realpath(folder) in passed_over:
        return
    objects: list[tuple[Path, Any]] = []
    for path in sorted(folder.iterdir()):
        if path.name.startswith("."):
            continue
        if path.is_dir() and not path.is_symlink():
            yield from _below(top, path, passed_over)
        elif (dataset := _object(path)) is not None:
            objects.append((path, dataset))
    if objects:
        name = Path(folder.name) if folder == top else folder.relative_to(top)
        yield from _paired(objects, name)


def _object(path: Path) -> Any:
    """An XA object, or None where the file is none."""
    try:
        with path.open("rb") as file:
            if file.read(_PREAMBLE + len(_MARK))[_PREAMBLE:] != _MARK:
                return None
        return open_object(path)
    except (OSError, RecordingError) as error:
        if "pydicom" in str(error):
            raise
        return None


def _paired(objects: Sequence[tuple[Path, Any]], name: Path) -> Iterator[FoundPair]:
    planes = {plane: [one for one in objects if _plane(one[1]) == plane] for plane in ("a", "b")}
    if len(planes["a"]) == len(planes["b"]) == 1 and len(objects) == 2:
        yield FoundPair((planes["a"][0][0], planes["b"][0][0]), name)
        return
    rest = list(objects)
    partners = {str(dataset.get("SOPInstanceUID")): (path, dataset) for path, dataset in planes["b"]}
    for path, dataset in planes["a"]:
        named = [partners[uid] for uid in _referenced(dataset) if uid in partners]
        if len(named) == 1:
            rest = [one for one in rest if one[0] not in (path, named[0][0])]
            yield FoundPair((path, named[0][0]), name / path.stem if len(objects) > 2 else name)
    if len(rest) == 2 and len(objects) == 2 and not (planes["a"] or planes["b"]):
        angles = [_frontal_deg(dataset) for _, dataset in rest]
        if angles[0] != angles[1]:
            first, second = (path for _, path in sorted(zip(angles, (path for path, _ in rest), strict=True)))
            yield FoundPair((first, second), name)
            return
    if rest:
        told = "that tell they are a pair and which is plane A's (ImageType BIPLANE A and B, references, angles)"
        problem = f"found {len(rest)} XA object{'s' * (len(rest) > 1)}, expected two {told}"
        yield FoundPair(tuple(path for path, _ in rest), name, problem)


def _plane(dataset: Any) -> str:
    kind: Any = dataset.get("ImageType")
    if kind is None or isinstance(kind, str) or len(kind) < 3:
        return ""
    return _PLANES.get(str(kind[2]), "")


def _referenced(dataset: Any) -> Iterator[str]:
    for item in dataset.get("ReferencedImageSequence") or ():
        yield word(item, "ReferencedSOPInstanceUID")


def _frontal_deg(dataset: Any) -> float:
    """How far a view is from frontal, degrees; 180 where the object does not say."""
    try:
        angle = number(dataset, "PositionerPrimaryAngle")
        if angle is None:  # of an Enhanced object
            isocentre = group_item(dataset, 0, "IsocenterReferenceSystemSequence")
            angle = number(isocentre, "PositionerIsocenterPrimaryAngle")
    except RecordingError:
        angle = None
    return 180.0 if angle is None else abs(angle)
