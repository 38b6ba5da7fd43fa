"""Bags of other kinds: the command that makes a recording of them is named, and does."""

from __future__ import annotations

import shlex
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("rosbags", reason="needs rosbags")

from rosbags.rosbag1 import Writer as Rosbag1Writer
from rosbags.rosbag2 import StoragePlugin
from rosbags.rosbag2 import Writer as Rosbag2Writer
from rosbags.typesys import Stores, get_typestore

from lasso_motion_ros.cli.main import main
from lasso_motion_ros.core.errors import RecordingError
from msg_adapters.recordings.reader import RecordingReader

TYPE, TOPIC = "sensor_msgs/msg/Image", "/plane_a/image_raw"


def database(directory: Path) -> Path:
    types = get_typestore(Stores.ROS2_JAZZY)
    header = types.types["std_msgs/msg/Header"](types.types["builtin_interfaces/msg/Time"](7, 0), "xray")
    image = types.types[TYPE](header, 2, 3, "mono8", 0, 3, np.arange(6, dtype=np.uint8))
    with Rosbag2Writer(directory / "a film", version=9, storage_plugin=StoragePlugin.SQLITE3) as writer:
        connection = writer.add_connection(TOPIC, TYPE, typestore=types)
        writer.write(connection, 5, types.serialize_cdr(image, TYPE))
    return directory / "a film"


def ros_1_bag(directory: Path) -> Path:
    types = get_typestore(Stores.ROS1_NOETIC)
    header = types.types["std_msgs/msg/Header"](0, types.types["builtin_interfaces/msg/Time"](7, 0), "xray")
    image = types.types[TYPE](header, 2, 3, "mono8", 0, 3, np.arange(6, dtype=np.uint8))
    with Rosbag1Writer(directory / "film.bag") as writer:
        connection = writer.add_connection(TOPIC, TYPE, typestore=types)
        writer.write(connection, 5, types.serialize_ros1(image, TYPE))
    return directory / "film.bag"


@pytest.mark.parametrize(
    ("make", "name"), [(database, ""), (database, "a film.db3"), (ros_1_bag, "")], ids=["directory", "db3", "ROS 1"]
)
def test_the_command_that_is_named_makes_a_recording_of_it(tmp_path: Path, make: object, name: str) -> None:
    assert callable(make)
    with pytest.raises(RecordingError, match="is not read; convert it: rosbags-convert ") as caught:
        RecordingReader(make(tmp_path) / name)
    program, *words = shlex.split(str(caught.value).partition("convert it: ")[2])
    subprocess.run([Path(sys.executable).with_name(program), *words], check=True, capture_output=True)
    (message,) = RecordingReader(words[words.index("--dst") + 1]).messages()
    assert (message.topic, message.message.header.stamp.sec, message.message.data.tolist()) == (TOPIC, 7, [*range(6)])


def test_a_database_alone_needs_its_index_first(tmp_path: Path) -> None:
    directory = database(tmp_path)
    (directory / "metadata.yaml").unlink()
    with pytest.raises(RecordingError, match=r"convert it: ros2 bag reindex -s sqlite3 '.*a film'; rosbags-convert "):
        RecordingReader(directory)


def test_a_command_says_it_in_one_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["check", str(ros_1_bag(tmp_path))]) == 2
    error = capsys.readouterr().err
    assert "film.bag is a ROS 1 bag, which is not read; convert it: rosbags-convert --src " in error
    assert error.count("\n") == 1
