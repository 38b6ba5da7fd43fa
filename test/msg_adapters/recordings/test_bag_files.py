"""Bags: directories, split and whole, with files that are gone."""

from __future__ import annotations

from pathlib import Path

import pytest
import yaml
from rosbags.rosbag2 import StoragePlugin
from rosbags.rosbag2 import Writer as BagWriter
from support.message_inputs import MESSAGES

from lasso_motion_ros.core.errors import RecordingError
from msg_adapters.recorded_messages import jazzy_types
from msg_adapters.recordings.reader import RecordingReader
from msg_adapters.recordings.writer import RecordingWriter


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
