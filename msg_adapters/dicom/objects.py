"""DICOM objects as pydicom reads them: opening one, values by tag, and errors that name the tag."""

from __future__ import annotations

import math
import warnings
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from lasso_motion_ros.core.errors import RecordingError

CLASSIC_XA = "1.2.840.10008.5.1.4.1.1.12.1"
ENHANCED_XA = "1.2.840.10008.5.1.4.1.1.12.1.1"


def open_object(path: Path) -> Any:
    """The data set of a classic or an Enhanced XA object, without its pixels.

    Raises:
        RecordingError: pydicom is not installed; no such file; not DICOM, cut short, or of another kind.
    """
    try:
        import pydicom
        from pydicom.errors import InvalidDicomError
    except ImportError as error:
        raise RecordingError(
            f"{path}: DICOM is read by pydicom, which is not installed: pip install 'lasso_motion_ros[dicom]'"
        ) from error
    # Values of another form than the standard's are common and harmless, or else refused by name where they are used.
    warnings.filterwarnings("ignore", module="pydicom")
    try:
        dataset = pydicom.dcmread(path, stop_before_pixels=True)
        _drop_unreadable(dataset)
        kind = str(dataset.get("SOPClassUID", ""))
    except InvalidDicomError as error:
        raise RecordingError(f"{path}: not a DICOM file: the mark DICM is missing behind its preamble") from error
    except OSError as error:
        raise RecordingError(f"{path}: cannot be read: {error.strerror or error}") from error
    except Exception as error:  # a spoilt file lets errors of all kinds through
        raise RecordingError(f"{path}: cannot be read as DICOM: {' '.join(str(error).split())}") from error
    if kind not in (CLASSIC_XA, ENHANCED_XA):
        name = pydicom.uid.UID(kind).name if kind else "none"
        raise RecordingError(
            f"{path}: (0008,0016) SOPClassUID: expected X-Ray Angiographic Image Storage, classic or Enhanced,"
            f" found {' '.join(name.split())}"
        )
    return dataset


def _drop_unreadable(dataset: Any) -> None:
    """Take out what cannot be converted: where it is needed it is missing, and named."""
    for tag in list(dataset.keys()):
        try:
            dataset[tag]
        except Exception:  # pydicom lets errors of all kinds through
            del dataset[tag]


def tag_name(keyword: str) -> str:
    """`(0018,1110) DistanceSourceToDetector`, from the keyword."""
    from pydicom.tag import Tag

    tag = Tag(keyword)
    return f"({tag.group:04X},{tag.element:04X}) {keyword}"


def numbers(item: Any, keyword: str, count: int | None = None) -> tuple[float, ...] | None:
    """The values of a numeric attribute; None where it is absent or empty.

    Args:
        item: a data set or an item of a sequence; None has no values.
        keyword: of the attribute.
        count: how many values are expected; None takes any number.

    Raises:
        RecordingError: another number of values, or values that are no finite numbers.
    """
    value = None if item is None else item.get(keyword)
    if value is None or value == "":
        return None
    values = [value] if isinstance(value, (int, float, str)) else list(value)
    if not values:
        return None
    try:
        found = tuple(float(one) for one in values)
    except (TypeError, ValueError):
        found = (float("nan"),)
    if (count is not None and len(found) != count) or not all(abs(one) < float("inf") for one in found):
        expected = "finite numbers" if count is None else f"{count} finite number{'s' if count > 1 else ''}"
        raise RecordingError(f"{tag_name(keyword)}: expected {expected}, found {' '.join(str(value).split())}")
    return found


def number(item: Any, keyword: str) -> float | None:
    """The one value of a numeric attribute; None where it is absent or empty.

    Raises:
        RecordingError: several values, or no finite number.
    """
    found = numbers(item, keyword, 1)
    return None if found is None else found[0]


def word(item: Any, keyword: str) -> str:
    """The text of an attribute, in one line and without blanks around it; empty where it is absent."""
    value = None if item is None else item.get(keyword)
    return "" if value is None else " ".join(str(value).split())


def group_item(dataset: Any, frame: int, keyword: str) -> Any:
    """The item of a functional group for one frame, from the frame's own groups or the shared ones; None without.

    Args:
        dataset: an enhanced object.
        frame: index of the frame, from 0.
        keyword: of the group's sequence.
    """
    for groups, index in (("PerFrameFunctionalGroupsSequence", frame), ("SharedFunctionalGroupsSequence", 0)):
        items = dataset.get(groups) or []
        if index < len(items):
            sequence = items[index].get(keyword)
            if sequence:
                return sequence[0]
    return None


class Needed:
    """Collects the attributes that are missing, so that all of them are named at once."""

    def __init__(self) -> None:
        self._absent: list[tuple[str, str]] = []

    def one(self, value: float | None, keyword: str, key: str = "") -> float:
        """The value; NaN where it is missing.

        Args:
            value: as read or given, or None.
            keyword: of the attribute.
            key: under which `--geometry FILE` can give it, or "".
        """
        if value is None:
            self._absent.append((keyword, key))
            return math.nan
        return value

    def two(self, values: Sequence[float] | None, keyword: str, key: str = "") -> tuple[float, float]:
        """As `one`, of two values."""
        if values is None:
            self._absent.append((keyword, key))
            return math.nan, math.nan
        return values[0], values[1]

    def check(self) -> None:
        """Raise RecordingError if anything is missing."""
        if self._absent:
            raise missing(self._absent)


def missing(keywords: Sequence[tuple[str, str]]) -> RecordingError:
    """The error of attributes that are missing.

    Args:
        keywords: of each, its keyword and the key under which `--geometry FILE` can give it, or "".
    """
    tags = ", ".join(tag_name(keyword) for keyword, _ in keywords)
    keys = dict.fromkeys(key for _, key in keywords if key)
    help_text = f"; --geometry FILE can give {', '.join(keys)}" if keys else ""
    return RecordingError(f"missing or empty: {tags}{help_text}")
