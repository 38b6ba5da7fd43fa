"""Recordings: what we write others read, what others write we read."""

from __future__ import annotations

import io
import tracemalloc
from pathlib import Path

import pytest
import yaml
from mcap.reader import make_reader
from mcap.records import Chunk
from mcap.stream_reader import StreamReader
from mcap.writer import CompressionType, Writer
from mcap_ros2.decoder import DecoderFactory
from rosbags.highlevel import AnyReader
from rosbags.rosbag2 import StoragePlugin
from rosbags.rosbag2 import Writer as BagWriter
from support.message_inputs import MESSAGES, camera_info, image, stamp
from support.recording_inputs import content, expected, write, write_noise

from lasso_motion_ros.core.errors import RecordingError
from msg_adapters.images import decode_image
from msg_adapters.messages import jazzy_types
from msg_adapters.recordings.reader import RecordingReader, check_tracking_topics
from msg_adapters.recordings.writer import RecordingWriter


@pytest.mark.parametrize("compression", ["zstd", "none"])
def test_what_is_written_is_read_back_in_log_time_order(tmp_path: Path, compression: str) -> None:
    path = write(tmp_path / "r.mcap", compression=compression)
    found = content(path)
    assert sorted(found) == sorted(expected(6))
    assert [at for _, at, _ in found] == sorted(at for _, at, _ in found)
    assert RecordingReader(path).damage is None


def test_mcap_and_its_ros2_decoder_read_it(tmp_path: Path) -> None:
    path = write(tmp_path / "r.mcap")
    with path.open("rb") as file:
        reader = make_reader(file, decoder_factories=[DecoderFactory()])
        assert reader.get_header().profile == "ros2"
        summary = reader.get_summary()
        assert summary is not None
        assert {schema.encoding for schema in summary.schemas.values()} == {"ros2msg"}
        assert all(index.message_index_offsets for index in summary.chunk_indexes)
        (record,) = reader.iter_metadata()
        messages = list(reader.iter_decoded_messages())
    assert record.name == "rosbag2"
    text = record.metadata["serialized_metadata"]
    assert "&id" not in text, "an alias is YAML that a recorder never writes"
    metadata = yaml.safe_load(text)
    topics = [entry["topic_metadata"] for entry in metadata["topics_with_message_count"]]
    assert all(topic["type_description_hash"].startswith("RIHS01_") for topic in topics)
    assert all(yaml.safe_load(topic["offered_qos_profiles"])[0]["reliability"] == 1 for topic in topics)
    assert metadata["storage_identifier"] == "mcap"
    assert metadata["message_count"] == len(messages) == 26
    assert metadata["starting_time"]["nanoseconds_since_epoch"] == stamp(0)
    picture = next(m.decoded_message for m in messages if m.channel.topic == "/plane_b/image_raw")
    assert (picture.width, picture.encoding, picture.data[0]) == (32, "mono8", 50)
    info = next(m.decoded_message for m in messages if m.channel.topic == "/plane_a/camera_info")
    assert list(info.p) == pytest.approx(list(camera_info("a").p))


def test_rosbags_reads_it_with_its_qos(tmp_path: Path) -> None:
    path = tmp_path / "r.mcap"
    with RecordingWriter(path) as writer:
        writer.write("/state", "std_msgs/msg/String", {"data": "TRACKING"}, stamp(0), latched=True)
        writer.write("/plane_a/image_raw", "sensor_msgs/msg/Image", image(stamp(1)), stamp(1))
    with AnyReader([path]) as reader:
        found = {c.topic: (t, reader.deserialize(data, c.msgtype)) for c, t, data in reader.messages()}
        qos = {c.topic: c.ext.offered_qos_profiles[0] for c in reader.connections}  # type: ignore[union-attr]
    assert found["/state"][1].data == "TRACKING"
    assert found["/plane_a/image_raw"][0] == stamp(1)
    assert (qos["/state"].durability.name, qos["/state"].depth) == ("TRANSIENT_LOCAL", 1)
    assert (qos["/plane_a/image_raw"].durability.name, qos["/plane_a/image_raw"].reliability.name) == (
        "VOLATILE",
        "RELIABLE",
    )


def test_the_same_input_gives_the_same_bytes(tmp_path: Path) -> None:
    for name in ("1", "2"):
        (tmp_path / name).mkdir()
        write(tmp_path / name / "r.mcap")
    assert (tmp_path / "1" / "r.mcap").read_bytes() == (tmp_path / "2" / "r.mcap").read_bytes()


def test_a_file_is_replaced_only_when_told(tmp_path: Path) -> None:
    path = write(tmp_path / "r.mcap")
    with pytest.raises(RecordingError, match="exists"):
        RecordingWriter(path)
    with pytest.raises(RecordingError, match="is a directory"):
        RecordingWriter(tmp_path, overwrite=True)
    with RecordingWriter(path, overwrite=True):
        pass
    assert content(path) == []


def test_a_whole_file_takes_its_place_at_the_end_or_not_at_all(tmp_path: Path) -> None:
    path = write(tmp_path / "r.mcap")
    before = path.read_bytes()

    def interrupted() -> None:
        with RecordingWriter(path, overwrite=True, whole=True) as writer:
            writer.write("/note", "std_msgs/msg/String", {"data": "half"}, 1)
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        interrupted()
    assert list(tmp_path.iterdir()) == [path]
    assert path.read_bytes() == before
    link = tmp_path / "link.mcap"
    link.symlink_to(path)
    with RecordingWriter(link, overwrite=True, whole=True) as writer:
        writer.write("/note", "std_msgs/msg/String", {"data": "whole"}, 1)
        assert path.read_bytes() == before
    assert link.is_symlink()
    assert [message.message.data for message in RecordingReader(path).messages()] == ["whole"]
    assert sorted(tmp_path.iterdir()) == [link, path]


def test_a_whole_file_is_said_to_be_what_it_is_called(tmp_path: Path) -> None:
    for name, whole in (("1", True), ("2", False)):
        (tmp_path / name).mkdir()
        with RecordingWriter(tmp_path / name / "r.mcap", whole=whole) as writer:
            writer.write("/note", "std_msgs/msg/String", {"data": ""}, 1)
    assert (tmp_path / "1" / "r.mcap").read_bytes() == (tmp_path / "2" / "r.mcap").read_bytes()


def test_a_device_is_not_replaced_by_a_file(monkeypatch: pytest.MonkeyPatch) -> None:
    replaced: list[Path] = []
    monkeypatch.setattr(Path, "replace", lambda _, target: replaced.append(target))
    with RecordingWriter("/dev/null", overwrite=True, whole=True) as writer:
        writer.write("/note", "std_msgs/msg/String", {"data": ""}, 1)
    assert replaced == []


def test_an_error_while_writing_leaves_a_readable_file(tmp_path: Path) -> None:
    path = tmp_path / "r.mcap"

    def interrupted() -> None:
        with RecordingWriter(path) as writer:
            writer.write("/state", "std_msgs/msg/String", {"data": "LOST"}, stamp(0))
            raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        interrupted()
    assert len(content(path)) == 1


def test_one_topic_has_one_type(tmp_path: Path) -> None:
    with RecordingWriter(tmp_path / "r.mcap") as writer:
        writer.write("/x", "std_msgs/msg/String", {"data": ""}, 0)
        with pytest.raises(RecordingError, match="/x is std_msgs/msg/String"):
            writer.write("/x", "std_msgs/msg/Header", {}, 0)


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


def test_bag_directories_split_and_whole_are_read(tmp_path: Path) -> None:
    bag = tmp_path / "bag"
    with BagWriter(bag, version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        connection = writer.add_connection("/text", "std_msgs/msg/String", typestore=jazzy_types())
        for index in range(3):
            message = MESSAGES.make("std_msgs/msg/String", {"data": str(index)})
            writer.write(connection, index, jazzy_types().serialize_cdr(message, "std_msgs/msg/String"))
    assert [m.message.data for m in RecordingReader(bag).messages()] == ["0", "1", "2"]
    with RecordingWriter(bag / "bag_10.mcap") as later:
        later.write("/text", "std_msgs/msg/String", {"data": "10"}, 10)
    with RecordingWriter(bag / "bag_9.mcap") as later:
        later.write("/text", "std_msgs/msg/String", {"data": "9"}, 10)  # at one time with the next file's
    metadata = yaml.safe_load((bag / "metadata.yaml").read_text())
    metadata["rosbag2_bagfile_information"]["relative_file_paths"] += ["bag_9.mcap", "bag_10.mcap"]
    (bag / "metadata.yaml").write_text(yaml.safe_dump(metadata))
    assert [m.message.data for m in RecordingReader(bag).messages()] == ["0", "1", "2", "9", "10"]
    (bag / "metadata.yaml").unlink()  # as a crashed recorder leaves it
    assert [m.message.data for m in RecordingReader(bag).messages()] == ["0", "1", "2", "9", "10"]


def test_a_listed_file_that_is_gone_is_named(tmp_path: Path) -> None:
    (tmp_path / "metadata.yaml").write_text(
        yaml.safe_dump(
            {"rosbag2_bagfile_information": {"storage_identifier": "mcap", "relative_file_paths": ["bag_0.mcap"]}}
        )
    )
    with pytest.raises(RecordingError, match=r"bag_0\.mcap is missing"):
        RecordingReader(tmp_path)


def test_topics_are_renamed_and_what_stood_in_the_way_steps_aside(tmp_path: Path) -> None:
    path = write(tmp_path / "r.mcap")
    reader = RecordingReader(
        path, {"plane_a/image_raw": "/plane_b/image_raw", "/plane_b/image_raw": "plane_a/image_raw"}
    )
    assert reader.topics["/plane_b/image_raw"] == "sensor_msgs/msg/Image"
    assert len(reader.topics) == 6
    with pytest.raises(RecordingError, match="no topic /frontal; it has /plane_a/camera_info"):
        RecordingReader(path, {"frontal": "/plane_a/image_raw"})


def test_missing_topics_are_named_with_what_is_there() -> None:
    topics = {
        "/plane_a/image_raw": "sensor_msgs/msg/Image",
        "/plane_a/camera_info": "sensor_msgs/msg/CameraInfo",
        "/lateral": "sensor_msgs/msg/Image",
    }
    with pytest.raises(RecordingError) as caught:
        check_tracking_topics(Path("r.mcap"), topics)
    assert str(caught.value).startswith(
        "r.mcap lacks /plane_b/image_raw (sensor_msgs/msg/Image), "
        "/plane_b/camera_info (sensor_msgs/msg/CameraInfo); it has"
    )
    assert "/lateral" in str(caught.value)
    topics |= {"/plane_b/image_raw/compressed": "sensor_msgs/msg/CompressedImage"}
    check_tracking_topics(Path("r.mcap"), topics, calibrated=True)
    with pytest.raises(RecordingError, match="it is std_msgs/msg/String"):
        check_tracking_topics(Path("r.mcap"), topics | {"/plane_a/image_raw": "std_msgs/msg/String"}, calibrated=True)


def test_reading_holds_a_few_chunks_only(tmp_path: Path) -> None:

    path = write_noise(tmp_path / "r.mcap", 60)
    tracemalloc.start()
    for recorded in RecordingReader(path).messages():
        decode_image(recorded.message)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert path.stat().st_size > 15e6
    assert peak < 8e6


def test_our_chunks_carry_their_checksum(tmp_path: Path) -> None:
    records = StreamReader(io.BytesIO(write(tmp_path / "r.mcap").read_bytes()), emit_chunks=True).records
    assert all(record.uncompressed_crc for record in records if isinstance(record, Chunk))
