"""The pictures of a DICOM object: frame by frame, as grey values in which more is brighter."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from lasso_motion_ros.core.errors import RecordingError
from msg_adapters.dicom.objects import group_item, number, tag_name, word
from msg_adapters.images import MAX_SIDE_PX, Pixels

Grey = np.ndarray[Any, np.dtype[np.int32]]


def check_pixels(dataset: Any, remarks: list[str]) -> None:
    """Check that the pictures can be taken, and say what they are.

    Args:
        dataset: the object.
        remarks: what is done to the pixels, and what is left out, is appended.

    Raises:
        RecordingError: colour, a size out of bounds, or more than 16 bits.
    """
    kind = word(dataset, "PhotometricInterpretation")
    if kind not in ("MONOCHROME1", "MONOCHROME2"):
        raise RecordingError(
            f"{tag_name('PhotometricInterpretation')}: expected MONOCHROME1 or MONOCHROME2, found {kind or 'none'}"
        )
    rows, columns = _whole(dataset, "Rows"), _whole(dataset, "Columns")
    if not (1 <= rows <= MAX_SIDE_PX and 1 <= columns <= MAX_SIDE_PX):
        raise RecordingError(f"Rows, Columns: expected 1 to {MAX_SIDE_PX} pixels a side, found {columns}×{rows}")
    allocated, stored = _whole(dataset, "BitsAllocated"), _whole(dataset, "BitsStored")
    if not 1 <= stored <= allocated or allocated not in (8, 16):
        raise RecordingError(
            f"{tag_name('BitsStored')}: expected at most 16 bits, 8 or 16 allocated, found {stored} of {allocated}"
        )
    if kind == "MONOCHROME1":
        remarks.append("MONOCHROME1 (more is darker) is turned over")
    if not stored - 1 <= _whole(dataset, "HighBit", stored - 1) < allocated:
        raise RecordingError(
            f"{tag_name('HighBit')}: expected {stored - 1} to {allocated - 1}, found {dataset.HighBit}"
        )
    if _whole(dataset, "PixelRepresentation"):
        remarks.append("signed pixels are moved up so that none is below zero")
    if _has_window(_window_item(dataset, 0)):
        remarks.append(
            "the stored values are taken: window and VOI LUT, which are for the eye, are not applied (--voi-lut)"
        )
    if word(dataset, "LossyImageCompression") == "01" or dataset.file_meta.TransferSyntaxUID.name.startswith(
        "JPEG Base"
    ):
        remarks.append("the pictures have been compressed with loss")
    masks = dataset.get("MaskSubtractionSequence") or []
    if any(word(item, "MaskOperation") not in ("", "NONE") for item in masks):
        remarks.append(f"{tag_name('MaskSubtractionSequence')}: no mask is subtracted")


def frames(path: Path, dataset: Any, *, voi_lut: bool = False) -> Iterator[Pixels]:
    """The pictures, one after another: (H, W) uint8 or uint16, more is brighter.

    Args:
        path: the object's file.
        dataset: the object without its pixels, checked by `check_pixels`.
        voi_lut: apply the object's own window or VOI LUT, as its display would; the values then span all bits stored.

    Raises:
        RecordingError: pixels that cannot be decoded, fewer of them than the object says, or no window where one is to
            be applied.
    """
    from pydicom.pixels import iter_pixels

    bits = _whole(dataset, "BitsStored")
    signed = bool(_whole(dataset, "PixelRepresentation"))
    largest = (1 << bits) - 1
    shift = _whole(dataset, "HighBit", bits - 1) - (bits - 1)
    try:
        for index, raw in enumerate(iter_pixels(path, raw=True)):
            values = np.asarray(raw).astype(np.int32)
            values = (values >> shift) & largest if not signed else values >> shift
            if voi_lut:
                values = _as_shown(values, _window_item(dataset, index), dataset, largest)
            elif signed:
                values = np.clip(values + (1 << (bits - 1)), 0, largest)
            if word(dataset, "PhotometricInterpretation") == "MONOCHROME1":
                values = largest - values
            yield values.astype(np.uint8) if bits <= 8 else values.astype(np.uint16)
    except RecordingError:
        raise
    except Exception as error:  # decoders let errors of all kinds through
        reason = f"pictures of {dataset.file_meta.TransferSyntaxUID.name} cannot be decoded: {error}"
        raise RecordingError(f"{path}: {' '.join(reason.split())[:400]}") from error


def _window_item(dataset: Any, frame: int) -> Any:
    """What holds a frame's window or VOI LUT: its functional group, or the object itself."""
    item = group_item(dataset, frame, "FrameVOILUTSequence")
    return dataset if item is None else item


def _has_window(item: Any) -> bool:
    return bool(item.get("VOILUTSequence")) or item.get("WindowCenter") is not None


def _as_shown(values: Grey, item: Any, dataset: Any, largest: int) -> Grey:
    """Stored values (H, W) through an item's window or VOI LUT, as its display would show them; 0 to `largest`.

    Raises:
        RecordingError: the item has none.
    """
    from pydicom.dataset import Dataset
    from pydicom.pixels import apply_windowing

    if not _has_window(item):
        raise RecordingError(f"--voi-lut: no {tag_name('WindowCenter')} and no {tag_name('VOILUTSequence')}")
    if sequence := item.get("VOILUTSequence"):
        shown = _through_table(values, sequence[0], largest)
    else:
        window = Dataset()
        window.update({element.tag: element for element in item if element.keyword.startswith(("Window", "VOILUTF"))})
        for keyword in ("PhotometricInterpretation", "BitsStored", "PixelRepresentation"):
            setattr(window, keyword, dataset.get(keyword))
        shown = np.asarray(apply_windowing(values, window), dtype=np.float64)
    grey: Grey = np.clip(np.rint(shown), 0, largest).astype(np.int32)
    return grey


def _through_table(values: Grey, table: Any, largest: int) -> np.ndarray[Any, np.dtype[np.float64]]:
    """Values (H, W) through a VOI LUT, whose entries have a depth of their own (PS3.3 C.11.2.1.1)."""
    entries, first, depth = (int(value) for value in table.LUTDescriptor)
    data, count = table.LUTData, entries or 1 << 16
    if isinstance(data, bytes):
        listed = np.frombuffer(data, np.uint8 if len(data) < 2 * count else "<u2")[:count]
    else:
        listed = np.asarray(data)
    if len(listed) < count:
        raise RecordingError(f"{tag_name('LUTData')}: expected {count} entries, found {len(listed)}")
    return listed[np.clip(values - first, 0, count - 1)] * (largest / ((1 << depth) - 1))


def _whole(dataset: Any, keyword: str, default: int = 0) -> int:
    value = number(dataset, keyword)
    return default if value is None else int(value)
