"""What is written is an MCAP recording to every reader: whole, the same each time, replaced only when told."""

from __future__ import annotations

import io
from pathlib import Path

import pytest
import yaml
from mcap.reader import make_reader
from mcap.records import Chunk
from mcap.stream_reader import StreamReader
from mcap_ros2.decoder import DecoderFactory
from rosbags.highlevel import AnyReader
from support.message_inputs import camera_info, image, stamp
from support.recording_inputs import content, write

from lasso_motion_ros.core.errors import RecordingError
from msg_adapters.recordings.reader import RecordingReader
from msg_adapters.recordings.writer import RecordingWriter


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


def test_our_chunks_carry_their_checksum(tmp_path: Path) -> None:
    records = StreamReader(io.BytesIO(write(tmp_path / "r.mcap").read_bytes()), emit_chunks=True).records
    assert all(record.uncompressed_crc for record in records if isinstance(record, Chunk))
