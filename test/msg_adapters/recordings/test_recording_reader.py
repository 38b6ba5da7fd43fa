"""Recordings are read in order of time, whoever wrote them, with bounded memory."""

from __future__ import annotations

import tracemalloc
from pathlib import Path

import pytest
from mcap.writer import CompressionType, Writer
from support.message_inputs import MESSAGES
from support.recording_inputs import content, expected, write, write_noise

from lasso_motion_ros.core.errors import RecordingError
from msg_adapters.images import decode_image
from msg_adapters.recorded_messages import jazzy_types
from msg_adapters.recordings.reader import RecordingReader


@pytest.mark.parametrize("compression", ["zstd", "none"])
def test_what_is_written_is_read_back_in_log_time_order(tmp_path: Path, compression: str) -> None:
    path = write(tmp_path / "r.mcap", compression=compression)
    found = content(path)
    assert sorted(found) == sorted(expected(6))
    assert [at for _, at, _ in found] == sorted(at for _, at, _ in found)
    assert RecordingReader(path).damage is None


@pytest.mark.parametrize("compression", [CompressionType.LZ4, CompressionType.ZSTD, CompressionType.NONE])
@pytest.mark.parametrize("chunked", [True, False])
def test_files_of_another_writer_are_read(tmp_path: Path, compression: CompressionType, chunked: bool) -> None:
    path = tmp_path / "r.mcap"
    with path.open("wb") as file:
        writer = Writer(file, chunk_size=1000, compression=compression, use_chunking=chunked, repeat_channels=False)
        writer.start("ros2")
        schema = writer.register_schema("std_msgs/msg/String", "ros2msg", b"string data")
        channel = writer.register_channel("/text", "cdr", schema)
        for index in (2, 0, 3, 1):  # put down out of order, and chunks overlap
            text = MESSAGES.make("std_msgs/msg/String", {"data": "x" * 700 + str(index)})
            data = bytes(jazzy_types().serialize_cdr(text, "std_msgs/msg/String"))
            writer.add_message(channel, index, data, index)
        writer.finish()
    assert [m.message.data[-1] for m in RecordingReader(path).messages()] == ["0", "1", "2", "3"]


def test_topics_are_renamed_and_what_stood_in_the_way_steps_aside(tmp_path: Path) -> None:
    path = write(tmp_path / "r.mcap")
    reader = RecordingReader(
        path, {"plane_a/image_raw": "/plane_b/image_raw", "/plane_b/image_raw": "plane_a/image_raw"}
    )
    assert reader.topics["/plane_b/image_raw"] == "sensor_msgs/msg/Image"
    assert len(reader.topics) == 6
    with pytest.raises(RecordingError, match="no topic /frontal; it has /plane_a/camera_info"):
        RecordingReader(path, {"frontal": "/plane_a/image_raw"})


def test_reading_holds_a_few_chunks_only(tmp_path: Path) -> None:

    path = write_noise(tmp_path / "r.mcap", 60)
    tracemalloc.start()
    for recorded in RecordingReader(path).messages():
        decode_image(recorded.message)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert path.stat().st_size > 15e6
    assert peak < 8e6
