"""A sound stream as a list of messages, and what can be wrong with such messages, one change each."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from support.drawn_recording import loop, projections, stamp

from lasso_motion_ros.geometry.carm import carm_projection
from msg_adapters.calibrations import encode_camera_info
from msg_adapters.images import encode_image
from msg_adapters.messages import header_fields
from msg_adapters.recordings.writer import RecordingWriter
from msg_adapters.seeds import encode_polygon
from msg_adapters.topics import camera_info_topic, image_topic, seed_topic

PAIRS = 8
SIDE = 512
OFF_CENTRE = np.array([0.0, 0.0, 0.03])
Entry = dict[str, Any]
Change = Callable[[Entry], Any]


def sound_stream() -> list[Entry]:
    """Images, calibrations with each, and clicks on the first pair, as `drawn_recording` has them."""
    entries = []
    ramp = np.add.outer(np.arange(SIDE), np.arange(SIDE)).astype(np.uint16) * 3
    for pair in range(PAIRS):
        for plane, projection in projections().items():
            header = header_fields(stamp(pair), "xray")
            for topic, fields in (
                (camera_info_topic(plane), encode_camera_info(projection, header)),
                (image_topic(plane), encode_image(ramp, header)),
            ):
                entries.append(entry(topic, plane, pair, fields))
            if pair == 0:
                fields = encode_polygon(projection.project(loop() + OFF_CENTRE)[:-1:18], header)
                entries.append(entry(seed_topic(plane), plane, pair, fields))
    return entries


def entry(topic: Any, plane: str, pair: int, fields: Any) -> Entry:
    kind = topic.name.split("/")[1]
    return {
        "topic": topic.recorded_name,
        "type": topic.type_name,
        "plane": plane,
        "pair": pair,
        "kind": kind,
        "fields": dict(fields),
        "log": stamp(pair),
        "latched": False,
    }


def write(path: Path, entries: list[Entry]) -> Path:
    with RecordingWriter(path, "none") as writer:
        for one in entries:
            if "raw" in one:
                writer.write_raw(one["topic"], one["type"], one["raw"], one["log"])
                continue
            writer.write(one["topic"], one["type"], one["fields"], one["log"], latched=one["latched"])
    return path


def restamp(one: Entry, stamp_ns: int) -> None:
    one["fields"]["header"] = header_fields(stamp_ns, "xray")


def images(plane: str, change: Change) -> Change:
    return lambda one: change(one) if one["kind"] == "image_raw" and one["plane"] == plane else None


def infos(change: Change, planes: str = "ab") -> Change:
    return lambda one: change(one) if one["kind"] == "camera_info" and one["plane"] in planes else None


def seeds(change: Change, planes: str = "ab") -> Change:
    return lambda one: change(one) if one["kind"] == "seed" and one["plane"] in planes else None


def fields(**values: Any) -> Change:
    return lambda one: one["fields"].update(values)


def in_millimetres(one: Entry) -> None:
    """What a bridge does that takes the C-arm's millimetres as they are."""
    p = one["fields"]["p"].reshape(3, 4).copy()
    p[:, 3] *= 1e3
    one["fields"]["p"] = p.reshape(-1)


def upside_down(one: Entry) -> None:
    """The sign of the image's y axis is wrong in p, k too, so that they agree."""
    flip = np.array([[1.0, 0.0, 0.0], [0.0, -1.0, SIDE - 1.0], [0.0, 0.0, 1.0]])
    one["fields"]["p"] = (flip @ one["fields"]["p"].reshape(3, 4)).reshape(-1)
    one["fields"]["k"] = (flip @ one["fields"]["k"].reshape(3, 3)).reshape(-1)


def byte_swapped(one: Entry) -> None:
    one["fields"]["data"] = np.frombuffer(one["fields"]["data"], np.uint16).byteswap().tobytes()


def coloured(one: Entry) -> None:
    grey = (np.frombuffer(one["fields"]["data"], np.uint16) >> 4).astype(np.uint8)
    one["fields"] |= {"encoding": "rgb8", "step": 3 * SIDE, "data": np.repeat(grey, 3).tobytes()}


def mirror_free(one: Entry) -> None:
    one["fields"]["r"] = np.eye(3).reshape(-1)


def over_exposed(one: Entry) -> None:
    picture = np.full((SIDE, SIDE), 4095, np.uint16)
    picture[: SIDE // 4] = np.arange(SIDE)
    one["fields"]["data"] = picture.tobytes()


def cropped(one: Entry, side: int) -> None:
    picture = np.frombuffer(one["fields"]["data"], np.uint16).reshape(SIDE, SIDE)[:side, :side]
    one["fields"].update(encode_image(picture, one["fields"]["header"]))


def slowed(one: Entry) -> None:
    """One pair in two seconds; the clicks are on the first, whose stamp stays."""
    at = stamp(0) + one["pair"] * 2_000_000_000
    restamp(one, at)
    one["log"] = at


def turned(one: Entry) -> None:
    """By 3 degrees, with the pair."""
    width, height = one["fields"]["width"], one["fields"]["height"]
    projection = carm_projection(
        np.radians(60.0 + 3.0 * (one["pair"] > 0)),
        0.0,
        source_detector_m=1.2,
        source_object_m=0.785,
        pixel_size_m=0.4e-3,
        width=width,
        height=height,
    )
    one["fields"].update(encode_camera_info(projection, one["fields"]["header"]))


def shifted(one: Entry) -> None:
    """A principal point that is 2000 pixels off."""
    move = np.array([[1.0, 0.0, 2000.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]])
    one["fields"]["p"] = (move @ one["fields"]["p"].reshape(3, 4)).reshape(-1)
    one["fields"]["k"] = (move @ one["fields"]["k"].reshape(3, 3)).reshape(-1)


def moved_world(one: Entry) -> None:
    """The world's origin lies half a metre to one side (along z) of what both planes look at."""
    if one["kind"] == "camera_info":
        p = one["fields"]["p"].reshape(3, 4).copy()
        p[:, 3] -= p[:, :3] @ np.array([0.0, 0.0, 0.47])
        one["fields"]["p"] = p.reshape(-1)


def shrunk(one: Entry) -> Any:
    points = np.array([[point["x"], point["y"]] for point in one["fields"]["polygon"]["points"]])
    middle = points.mean(axis=0)
    return encode_polygon(middle + 0.1 * (points - middle), one["fields"]["header"])
