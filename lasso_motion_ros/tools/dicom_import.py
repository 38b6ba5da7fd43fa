"""Brings a pair of DICOM XA objects into a recording: pictures, stamps and a calibration for every frame."""

from __future__ import annotations

import heapq
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from lasso_motion_ros.core.errors import RecordingError
from lasso_motion_ros.core.progress import busy, progress
from lasso_motion_ros.geometry.conventions import diffdrr_detector, opencv_camera, rtk_geometry
from lasso_motion_ros.geometry.frames import PLANES, Plane
from lasso_motion_ros.geometry.projection import Projection
from msg_adapters import topics
from msg_adapters.calibrations import check_source, encode_camera_info
from msg_adapters.dicom.enhanced_geometry import check_table_turn
from msg_adapters.dicom.given_geometry import read_geometry_file
from msg_adapters.dicom.object_pairing import plane_b_offset
from msg_adapters.dicom.objects import tag_name, word
from msg_adapters.dicom.xa_object import XaObject, read_xa
from msg_adapters.images import Pixels, encode_image
from msg_adapters.messages import header_fields
from msg_adapters.recordings.writer import RecordingWriter

# 2000-01-01: where a recording begins that keeps the day of the examination to itself.
NEUTRAL_START_NS = 946_684_800_000_000_000
_SAME_VIEW_DEG = 15.0


@dataclass(frozen=True)
class ImportOptions:
    """How a pair is imported.

    Attributes:
        geometry: a geometry file, or None.
        plane_b_offset_s: how much later plane B begins; None: by clocks or pictures.
        voi_lut: pictures as the objects' display would show them.
        identity: keep the patient's name and numbers, the day of the examination, and pictures with text burnt in.
    """

    geometry: Path | None = None
    plane_b_offset_s: float | None = None
    voi_lut: bool = False
    identity: bool = False


@dataclass(frozen=True, eq=False)
class ImportedPair:
    """The outcome.

    Attributes:
        objects: plane → what was read.
        projections: plane → (N,) of each frame.
        stamps_ns: plane → (N,) of each frame.
        remarks: what was taken for granted: plane, or "both", → lines.
    """

    objects: Mapping[Plane, XaObject]
    projections: Mapping[Plane, list[Projection]]
    stamps_ns: Mapping[Plane, list[int]]
    remarks: Mapping[str, list[str]]


def import_dicom(
    paths: Mapping[Plane, Path], output: Path, options: ImportOptions, *, overwrite: bool = False, quiet: bool = True
) -> ImportedPair:
    """Write a recording of two XA objects.

    Args:
        paths: plane → file.
        output: MCAP file to write.
        options: see there.
        overwrite: replace `output` if it exists.
        quiet: no progress bar.

    Raises:
        LassoMotionError: an object that cannot be read or lacks what is needed, films that do not belong together, or
            an output that cannot be written.
    """
    pair = read_pair(paths, options, quiet=quiet)
    total = sum(len(stamps) for stamps in pair.stamps_ns.values())
    with RecordingWriter(output, compression="zstd", overwrite=overwrite, whole=True) as writer:
        if options.identity:
            for plane, one in pair.objects.items():
                writer.write_metadata(f"dicom_plane_{plane}", one.identity())
        streams = [_messages(pair, plane, options.voi_lut) for plane in PLANES]
        merged = heapq.merge(*streams, key=lambda entry: entry[0])
        for stamp_ns, messages in progress(merged, total, "importing", quiet):
            for topic, fields in messages:
                writer.write(topic.recorded_name, topic.type_name, fields, stamp_ns, latched=topic.latched)
    return pair


def read_pair(paths: Mapping[Plane, Path], options: ImportOptions, *, quiet: bool = True) -> ImportedPair:
    """Both objects with their frames' times and projections; no picture is decoded unless the clocks fail.

    Raises:
        LassoMotionError: as `import_dicom`.
    """
    given = read_geometry_file(options.geometry)
    objects: dict[Plane, XaObject] = {plane: read_xa(paths[plane], given[plane]) for plane in PLANES}
    a, b = objects["a"], objects["b"]
    if a.dataset.get("SOPInstanceUID") == b.dataset.get("SOPInstanceUID"):
        raise RecordingError(f"{a.path} and {b.path} are one object: expected one for each plane")
    remarks: dict[str, list[str]] = {f"plane {plane.upper()}": list(objects[plane].remarks) for plane in PLANES}
    both = remarks["both planes"] = []
    for plane in PLANES:
        both += _check_annotation(objects[plane], options.identity)
    _check_designation(objects, both)
    with busy("reading the films", quiet or options.plane_b_offset_s is not None):
        offset_ns, words = plane_b_offset(a, b, options.plane_b_offset_s)
    both.append(words)
    references = dict.fromkeys(PLANES, (0.0, 0.0, 0.0))
    if a.enhanced and b.enhanced:
        check_table_turn(a.table_turn_deg, b.table_turn_deg, f"{b.path}, frame 1")
        references = dict.fromkeys(PLANES, a.geometry[0].table_mm)
    else:
        references = {plane: objects[plane].geometry[0].table_mm for plane in PLANES}
        both.append("table and gantry have no common frame: the table stands at one place when the films begin")
    projections = {plane: objects[plane].projections(references[plane]) for plane in PLANES}
    for plane in PLANES:
        for projection in projections[plane]:
            check_source(projection)
    between = _angle_deg(projections["a"][0], projections["b"][0])
    if min(between, 180.0 - between) < _SAME_VIEW_DEG:
        both.append(f"the planes look {between:.0f} degrees from one another: depth will be poor")
    start_ns = NEUTRAL_START_NS
    if options.identity:
        clock = next(iter(a.clocks), None)
        if clock is None:
            raise RecordingError(f"{a.path}: no date and time of the examination to keep: leave out --identity")
        start_ns = a.clocks[clock]
    else:
        both.append("no patient data, and stamps from 2000-01-01 on (--identity keeps name, numbers and day)")
        start_ns -= min(0, offset_ns)
    return ImportedPair(
        objects,
        projections,
        {
            "a": [start_ns + time for time in a.times_ns],
            "b": [start_ns + offset_ns + time for time in b.times_ns],
        },
        _shared(remarks),
    )


def describe(pair: ImportedPair) -> list[str]:
    """What was imported, and what was taken for granted, a line each."""
    lines = []
    for plane in PLANES:
        one, projection = pair.objects[plane], pair.projections[plane][0]
        first = one.geometry[0]
        rate = 1e9 * (len(one.times_ns) - 1) / one.times_ns[-1] if len(one.times_ns) > 1 else 0.0
        kind = "Enhanced XA" if one.enhanced else "XA"
        lines.append(
            f"plane {plane.upper()}: {kind}, {len(one.times_ns)} frames of {one.width}×{one.height} at {rate:.4g}/s,"
            f" {_angle(first.primary_deg, 'RAO', 'LAO')} {_angle(first.secondary_deg, 'CAUD', 'CRAN')},"
            f" {first.source_detector_mm:g} mm to the detector, {first.source_isocentre_mm:g} mm to the iso-centre,"
            f" {projection.millimetres_per_pixel(np.zeros(3)):.3f} mm a pixel there"
        )
    return lines + [f"{place}: {line}" for place, found in pair.remarks.items() for line in found]


def _shared(remarks: Mapping[str, list[str]]) -> dict[str, list[str]]:
    """The same remarks, with what holds for either plane said once."""
    one, other = (remarks[place] for place in ("plane A", "plane B"))
    common = [line for line in one if line in other]
    sorted_out = {
        "plane A": [line for line in one if line not in common],
        "plane B": [line for line in other if line not in common],
        "both planes": [*common, *remarks["both planes"]],
    }
    return {place: lines for place, lines in sorted_out.items() if lines}


def report(pair: ImportedPair) -> dict[str, Any]:
    """The report as JSON values."""
    planes = {
        plane: {
            "frames": len(pair.stamps_ns[plane]),
            "width": pair.objects[plane].width,
            "height": pair.objects[plane].height,
            "first_stamp_ns": pair.stamps_ns[plane][0],
            "last_stamp_ns": pair.stamps_ns[plane][-1],
            "enhanced": pair.objects[plane].enhanced,
        }
        for plane in PLANES
    }
    return {"planes": planes, "taken_for_granted": dict(pair.remarks)}


def conventions(pair: ImportedPair) -> dict[str, Any]:
    """Every frame's projection as OpenCV, RTK and DiffDRR have it, as JSON values."""
    return {
        f"plane_{plane}": [
            {
                "stamp_ns": stamp_ns,
                "matrix_metres": projection.matrix.tolist(),
                "opencv": _plain(opencv_camera(projection)),
                "rtk": _plain(rtk_geometry(projection, geometry.spacing_mm)),
                "diffdrr": _plain(diffdrr_detector(projection, geometry.spacing_mm)),
            }
            for stamp_ns, projection, geometry in zip(
                pair.stamps_ns[plane], pair.projections[plane], pair.objects[plane].geometry, strict=True
            )
        ]
        for plane in PLANES
    }


def _messages(
    pair: ImportedPair, plane: Plane, voi_lut: bool
) -> Iterator[tuple[int, list[tuple[topics.Topic, dict[str, Any]]]]]:
    """One plane's messages, frame by frame; the calibration before its picture."""
    one = pair.objects[plane]
    peaks = set(one.r_waves) if plane == "a" or not pair.objects["a"].r_waves else set()
    pictures: Iterator[Pixels] = one.pictures(voi_lut=voi_lut)
    for frame, picture in enumerate(pictures):
        stamp_ns = pair.stamps_ns[plane][frame]
        header = header_fields(stamp_ns, f"plane_{plane}")
        messages = [
            (topics.camera_info_topic(plane), encode_camera_info(pair.projections[plane][frame], header)),
            (topics.image_topic(plane), encode_image(picture, header)),
        ]
        if frame in peaks:
            messages.insert(0, (topics.R_PEAK, header_fields(stamp_ns, "ecg")))
        yield stamp_ns, messages


def _check_annotation(one: XaObject, identity: bool) -> list[str]:
    burnt = word(one.dataset, "BurnedInAnnotation")
    if burnt == "YES" and not identity:
        raise RecordingError(
            f"{one.path}: {tag_name('BurnedInAnnotation')} is YES: the pictures show text that may name the patient;"
            " --identity takes them as they are"
        )
    if burnt != "NO":
        return [
            f"{one.path.name}: {tag_name('BurnedInAnnotation')} is {burnt or 'absent'}:"
            " look whether the pictures show text"
        ]
    return []


def _check_designation(objects: Mapping[Plane, XaObject], remarks: list[str]) -> None:
    for plane, one in objects.items():
        kind = [str(value) for value in one.dataset.get("ImageType") or []]
        other = "B" if plane == "a" else "A"
        if any(value.endswith(f" {other}") for value in kind):
            remarks.append(f"{one.path.name} is given as plane {plane.upper()} and calls itself {kind[-1]}")


def _angle_deg(one: Projection, other: Projection) -> float:
    return float(np.degrees(np.arccos(np.clip(one.viewing_direction @ other.viewing_direction, -1.0, 1.0))))


def _angle(degrees: float, negative: str, positive: str) -> str:
    return f"{negative if degrees < 0.0 else positive} {abs(degrees):g}"


def _plain(values: dict[str, Any]) -> dict[str, Any]:
    return {key: value.tolist() if isinstance(value, np.ndarray) else value for key, value in values.items()}
