"""What the fuzzer feeds: sound inputs, ways to spoil them, and the functions that take them."""

from __future__ import annotations

import math
import random
import re
import struct
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import zstandard
from support.message_inputs import MESSAGES, SIDE, camera_info, image, seed, stamp, stream

from lasso_motion_ros.core.errors import ConfigurationError, LassoMotionError, MessageError, RecordingError
from msg_adapters.calibrations import decode_camera_info
from msg_adapters.images import decode_image
from msg_adapters.input_bytes import READERS
from msg_adapters.markers import decode_points, encode_line_strip
from msg_adapters.messages import header_fields
from msg_adapters.poses import decode_pose, encode_pose_stamped
from msg_adapters.recorded_messages import jazzy_types
from msg_adapters.recordings.reader import RecordingReader
from msg_adapters.recordings.repair import repair_recording
from msg_adapters.recordings.writer import RecordingWriter
from msg_adapters.seeds import decode_seed, read_calibration_file, read_seeds_file
from msg_adapters.sync.frame_pairs import FramePairs
from msg_adapters.sync.partner import PartnerRule
from msg_adapters.topics import compressed_image_topic

Choice = random.Random
Feed = Callable[[Choice, Path], None]
"""Draws one spoilt input and feeds it; may write into the directory given."""

NUMBERS = (
    0,
    1,
    -1,
    2,
    5,
    6,
    8,
    10,
    16,
    127,
    255,
    256,
    4096,
    65535,
    2**24,
    2**31 - 1,
    2**31,
    2**32 - 1,
    2**63,
    2**64 - 1,
)
REALS = (0.0, -0.0, 1.0, -1.0, 1e-320, 1e-30, 1e-9, 1e3, 1e9, 1e30, 1e300, -1e300, math.inf, -math.inf, math.nan)
TEXTS = ("", "mono8", "mono16", "8UC1", "16UC1", "rgb8", "yuv422", "png", "jpeg", "\0", "é" * 40, "x" * 4096)
YAML_PIECES = (
    "&a [*a]", "*b", "<<: *b", "&b [1, 2]", "[" * 2000, "{" * 2000, "2001-99-99", "1" * 5000, "!!int ''", "!!bool x",
    ".nan", ".inf", "-.inf", "1e309", "1e308", "!!binary x", "!!set {a}", "? [a]", "<<: 1", "<<: [*a]", "\t",
    "\0", "\ufeff", "%YAML 9.9\n---", "---\n", "...\n", "'", '"', "|\n  x", "- - - -", "plane_a:", "plane_b: ~",
    "points:", "stamp: -1", "stamp: 1e18", "stamp: {sec: 1, nanosec: -1}", "width: 0", "width: 1e3", "p: []",
    "!!python/object/apply:os.system [x]", "!!timestamp x", "0x_", "7", "2.5", "[3, 4]", "1e3",
    "{sec: 5, nanosec: 6}", "190:20:30", "[[1, 2], [3]]", "[[1e400, 2]]", "true", "~",
)  # fmt: skip


def spoilt_bytes(choice: Choice, data: bytes) -> bytes:
    """Bits flipped, bytes and lengths overwritten, pieces cut out, doubled, moved or put in; several of it."""
    spoilt = bytearray(data)
    for _ in range(choice.choice((1, 1, 1, 2, 3, 8))):
        place = choice.randrange(len(spoilt)) if spoilt else 0
        if choice.random() < 0.3:
            place = min(place, choice.randrange(64))  # where the lengths are
        match choice.randrange(7):
            case 0:
                spoilt[place : place + 1] = bytes([choice.randrange(256)])
            case 1 if spoilt:
                spoilt[place] ^= 1 << choice.randrange(8)
            case 2:
                size, order = choice.choice((1, 2, 4, 8)), choice.choice(("little", "big"))
                number = choice.choice(NUMBERS) % 256**size
                spoilt[place : place + size] = number.to_bytes(size, order)
            case 3:
                del spoilt[place:]
            case 4:
                del spoilt[place : place + choice.randrange(1, 64)]
            case 5:
                spoilt[place:place] = spoilt[choice.randrange(len(spoilt) + 1) :][: choice.randrange(1, 256)]
            case 6:
                spoilt[place : place + 8] = struct.pack("<d", choice.choice(REALS))
    return bytes(spoilt)


def spoilt_message(choice: Choice, message: Any) -> Any:
    """Fields set to what they should not be, at any depth."""
    for _ in range(choice.choice((1, 1, 2, 4))):
        part, name = message, ""
        while hasattr(part, "__dataclass_fields__"):
            whole, name = part, choice.choice([name for name in part.__dataclass_fields__ if not name.startswith("_")])
            part = getattr(whole, name)
            if isinstance(part, list) and part and choice.random() < 0.7:
                whole, name, part = part, choice.randrange(len(part)), choice.choice(part)
        if isinstance(whole, list):
            whole[name] = _spoilt_value(choice, part)
        else:
            object.__setattr__(whole, name, _spoilt_value(choice, part))
    return message


def _spoilt_value(choice: Choice, value: Any) -> Any:
    """Another value of the same type, as a message can bring it."""
    if isinstance(value, bool):
        return not value
    if isinstance(value, int):
        return choice.choice(NUMBERS) % 2**32
    if isinstance(value, float):
        return choice.choice(REALS)
    if isinstance(value, str):
        return choice.choice(TEXTS)
    if isinstance(value, np.ndarray):
        if value.dtype == np.uint8:
            return np.frombuffer(spoilt_bytes(choice, value.tobytes()), np.uint8)
        changed = value.copy()
        for _ in range(choice.randrange(1, 4)):
            if changed.size:
                changed[choice.randrange(changed.size)] = choice.choice(REALS)
        return changed[: choice.randrange(changed.size + 1)] if choice.random() < 0.2 else changed
    if isinstance(value, list):
        return value[: choice.randrange(len(value) + 1)] * choice.choice((1, 1, 2, 50))
    return value


def through_the_wire(choice: Choice, message: Any, type_name: str) -> Any:
    """The message after its bytes were spoilt on the way; None where they are no such message any more."""
    types = jazzy_types()
    data = spoilt_bytes(choice, bytes(types.serialize_cdr(message, type_name)))
    if type_name in READERS:
        return READERS[type_name](data)
    try:
        return types.deserialize_cdr(data, type_name)
    except Exception:  # the middleware's business, not ours
        return None


def message_feed(make: Callable[[Choice], Any], type_name: str, take: Callable[[Any], Any]) -> Feed:
    """Feeds spoilt messages of one kind."""

    def feed(choice: Choice, _: Path) -> None:
        message = make(choice)
        on_the_way = choice.random() < 0.4
        message = through_the_wire(choice, message, type_name) if on_the_way else spoilt_message(choice, message)
        if message is not None:
            take(message)

    return feed


def _image(choice: Choice) -> Any:
    message = image(stamp(0))
    if choice.random() < 0.5:
        message.encoding, message.step = "mono16", 2 * SIDE
        message.data = np.zeros(2 * SIDE * SIDE, np.uint8)
        message.is_bigendian = choice.randrange(2)
    return message


_COMPRESSED = [
    cv2.imencode(suffix, np.add.outer(np.arange(32), np.arange(48)).astype(kind))[1]
    for suffix, kind in ((".png", np.uint8), (".png", np.uint16), (".jpg", np.uint8))
] + [cv2.imencode(".png", np.zeros((9, 9, 3), np.uint8))[1]]


def _compressed(choice: Choice) -> Any:
    fields = {"header": header_fields(stamp(0)), "format": "png", "data": choice.choice(_COMPRESSED)}
    return MESSAGES.make(compressed_image_topic("a").type_name, fields)


def _pose(_: Choice) -> Any:
    return MESSAGES.make("geometry_msgs/msg/PoseStamped", encode_pose_stamped(np.eye(4), header_fields(stamp(0))))


def _marker(_: Choice) -> Any:
    return MESSAGES.make("visualization_msgs/msg/Marker", encode_line_strip(np.eye(3), header_fields(stamp(0)), "ring"))


def stream_feed(choice: Choice, _: Path) -> None:
    """A few frames of both planes, some of them spoilt, in any order: nothing may come out of the pairing."""
    pairs = FramePairs(PartnerRule(offset_ns=choice.choice((None, 100_000_000))))
    messages = list(stream(4, None))
    choice.shuffle(messages)
    for topic, type_name, message, _at in messages:
        plane = "a" if "plane_a" in topic else "b"
        if choice.random() < 0.3:
            message = spoilt_message(choice, message)
        (pairs.add_image if type_name.endswith("/Image") else pairs.add_camera_info)(plane, message)
    pairs.flush()
    for plane in "ab":
        pairs.frames[plane].take_complaints()


SEEDS = "".join(
    f"plane_{plane}:\n  stamp: 1760000000.25\n  points: [[10, 20], [11, 22.5], [13, 25], [14, 21], [12, 17], [9, 18]]\n"
    for plane in "ab"
)
CALIBRATION = "".join(
    f"plane_{plane}:\n  p: [1, 0, 0, 1, 0, 1, 0, 1, 0, 0, 1, 1]\n  width: 1024\n  height: 1024\n" for plane in "ab"
)


def yaml_feed(text: str, read: Callable[[Path], Any]) -> Feed:
    """Feeds a spoilt file."""

    def feed(choice: Choice, directory: Path) -> None:
        words = re.split(r"(\s+|[\[\],])", text)
        for _ in range(choice.choice((0, 1, 1, 2))):
            words[choice.randrange(len(words))] = choice.choice(YAML_PIECES)
        data = "".join(words).encode()
        if choice.random() < 0.3:
            data = spoilt_bytes(choice, data)
        path = directory / "spoilt.yaml"
        path.write_bytes(data)
        read(path)

    return feed


def recordings(directory: Path) -> list[bytes]:
    """Small sound recordings: compressed and not, one with many chunks."""
    sound = []
    for number, compression in enumerate(("zstd", "none")):
        path = directory / f"sound{number}.mcap"
        with RecordingWriter(path, compression) as writer:  # type: ignore[arg-type]
            for topic, type_name, message, at in stream(2):
                writer.write(topic, type_name, message, at)
        sound.append(path.read_bytes())
    return [*sound, _lz4(sound[1]), sound[1][: len(sound[1]) // 2]]


def _lz4(data: bytes) -> bytes:
    """The same messages as another writer puts them down."""
    import io

    from mcap.stream_reader import StreamReader
    from mcap.writer import CompressionType, Writer

    out = io.BytesIO()
    writer = Writer(out, chunk_size=2048, compression=CompressionType.LZ4)
    writer.start("ros2")
    schemas: dict[int, int] = {}
    channels: dict[int, int] = {}
    for record in StreamReader(io.BytesIO(data)).records:
        kind = type(record).__name__
        if kind == "Schema" and record.id not in schemas:
            schemas[record.id] = writer.register_schema(record.name, record.encoding, record.data)
        elif kind == "Channel" and record.id not in channels:
            channels[record.id] = writer.register_channel(
                record.topic, record.message_encoding, schemas[record.schema_id]
            )
        elif kind == "Message":
            writer.add_message(channels[record.channel_id], record.log_time, record.data, record.publish_time)
    writer.finish()
    return out.getvalue()


_CHUNK_OPCODE = 0x06


def chunk_places(data: bytes) -> list[int]:
    """Where the chunks' records begin."""
    place, found = 8, []
    while place + 9 <= len(data):
        opcode, length = struct.unpack_from("<BQ", data, place)
        if opcode == _CHUNK_OPCODE:
            found.append(place)
        place += 9 + length
    return found


def lied_about(choice: Choice, data: bytes) -> bytes:
    """A chunk whose head lies about times, sizes, checksum or compression, or that holds a bomb."""
    spoilt = bytearray(data)
    place = choice.choice(chunk_places(data))
    match choice.randrange(6):
        case 0:  # the record's length
            struct.pack_into("<Q", spoilt, place + 1, choice.choice(NUMBERS) % 2**64)
        case 1:  # first time, last time, unpacked size
            struct.pack_into("<Q", spoilt, place + 9 + 8 * choice.randrange(3), choice.choice(NUMBERS) % 2**64)
        case 2:  # without a checksum, so that what is spoilt in it is looked at
            struct.pack_into("<I", spoilt, place + 33, 0)
            start = place + 37
            spoilt[start:] = spoilt_bytes(choice, bytes(spoilt[start:]))
        case 3:  # the length of the compression's name
            struct.pack_into("<I", spoilt, place + 37, choice.choice(NUMBERS) % 2**32)
        case 4:  # the packed size
            name = struct.unpack_from("<I", spoilt, place + 37)[0]
            struct.pack_into("<Q", spoilt, place + 41 + name, choice.choice(NUMBERS) % 2**64)
        case 5:
            return data[:place] + bomb(choice) + data[place:]
    return bytes(spoilt)


def bomb(choice: Choice) -> bytes:
    """A chunk of a few kilobytes that unpacks to hundreds of megabytes, whatever its head says."""
    size = choice.choice((1 << 20, 1 << 26, 1 << 28))
    claims = choice.choice((size, 1000, 1 << 24, 1 << 40))
    compressor = zstandard.ZstdCompressor(level=1).compressobj()
    zeros = bytes(1 << 20)
    packed = b"".join(compressor.compress(zeros) for _ in range(size >> 20)) + compressor.flush()
    body = struct.pack("<QQQI", 0, 2**62, claims, 0) + struct.pack("<I", 4) + b"zstd" + struct.pack("<Q", len(packed))
    return struct.pack("<BQ", _CHUNK_OPCODE, len(body) + len(packed)) + body + packed


def recording_feed(sound: list[bytes], repair: bool) -> Feed:
    """Feeds a spoilt recording to the reader, or to the repair."""

    def feed(choice: Choice, directory: Path) -> None:
        data = choice.choice(sound)
        data = lied_about(choice, data) if choice.random() < 0.4 else spoilt_bytes(choice, data)
        path = directory / "spoilt.mcap"
        path.write_bytes(data)
        if repair:
            repair_recording(path)
            return
        reader = RecordingReader(path)
        _ = reader.topics, reader.latched_topics, reader.best_effort_topics
        for recorded in reader.messages():
            if recorded.type_name.endswith("/Image") and recorded.topic.startswith("/plane"):
                decode_image(recorded.message)

    return feed


@dataclass(frozen=True)
class Target:
    """What is fed, its share of the inputs, and how it may refuse: by these errors only."""

    share: int
    feed: Feed
    refuses_by: tuple[type[LassoMotionError], ...]


def targets(directory: Path) -> dict[str, Target]:
    """All that is fed, by name."""
    sound = recordings(directory)
    message, file, recording = (MessageError,), (ConfigurationError,), (RecordingError,)

    def messages(share: int, make: Callable[[Choice], Any], type_name: str, take: Callable[[Any], Any]) -> Target:
        return Target(share, message_feed(make, type_name, take), message)

    return {
        "image": messages(16, _image, "sensor_msgs/msg/Image", decode_image),
        "compressed image": messages(14, _compressed, "sensor_msgs/msg/CompressedImage", decode_image),
        "camera info": messages(
            16, lambda _: camera_info("a", stamp(0)), "sensor_msgs/msg/CameraInfo", decode_camera_info
        ),
        "seed": messages(8, lambda _: seed(stamp(0)), "geometry_msgs/msg/PolygonStamped", decode_seed),
        "pose": messages(8, _pose, "geometry_msgs/msg/PoseStamped", decode_pose),
        "marker": messages(8, _marker, "visualization_msgs/msg/Marker", decode_points),
        "stream": Target(4, stream_feed, ()),
        "seeds file": Target(6, yaml_feed(SEEDS, read_seeds_file), file),
        "calibration file": Target(6, yaml_feed(CALIBRATION, read_calibration_file), file),
        "recording": Target(12, recording_feed(sound, repair=False), (*recording, *message)),
        "recording's repair": Target(2, recording_feed(sound, repair=True), recording),
    }
