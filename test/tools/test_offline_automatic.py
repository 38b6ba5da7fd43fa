"""A recording without clicks, tracked: the ring is found, and the first pair that shows it is the reference."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import pytest

pytest.importorskip("mcap")

from support.breathing_lasso import moved, pair

from lasso_motion_ros.config.stream import StreamConfig
from lasso_motion_ros.core.errors import ConfigurationError, RecordingError
from lasso_motion_ros.geometry.frames import PLANES
from lasso_motion_ros.tools.offline_tracking import track_recording
from lasso_motion_ros.tracking.tracker import TrackerState
from msg_adapters.calibrations import encode_camera_info
from msg_adapters.images import encode_image
from msg_adapters.messages import header_fields, stamp_to_ns
from msg_adapters.poses import decode_pose
from msg_adapters.recorded_messages import RecordedMessages
from msg_adapters.recordings.reader import RecordingReader
from msg_adapters.recordings.writer import RecordingWriter
from msg_adapters.topics import MOTION_RAW, REFERENCE, camera_info_topic, image_topic

PAIRS = 5
START_NS = 1_760_000_000_000_000_000
CONFIG = StreamConfig(polarity="dark")


@pytest.fixture(scope="module")
def recording(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("automatic") / "clickless.mcap"
    messages = RecordedMessages()
    with RecordingWriter(path) as writer:
        for index in range(PAIRS):
            drawn = pair(index)
            for plane in PLANES:
                frame = drawn.frames[plane]
                stamp_ns = START_NS + frame.stamp_ns
                header = header_fields(stamp_ns, "xray")
                for topic, fields in (
                    (camera_info_topic(plane), encode_camera_info(frame.projection, header)),
                    (image_topic(plane), encode_image(frame.pixels, header)),
                ):
                    message = messages.make(topic.type_name, fields)
                    writer.write(topic.recorded_name, topic.type_name, message, stamp_ns)
    return path


@pytest.mark.slow
def test_the_ring_is_found_and_followed(recording: Path, tmp_path: Path) -> None:
    output = tmp_path / "tracked.mcap"
    summary = track_recording(recording, output, CONFIG, automatic=True)
    assert summary.statistics.seeds.taken == 1
    assert summary.statistics.state is TrackerState.TRACKING
    poses, references = {}, set()
    wanted = {MOTION_RAW.recorded_name: MOTION_RAW, REFERENCE.recorded_name: REFERENCE}
    for recorded in RecordingReader(output).messages(wanted):
        if recorded.topic == REFERENCE.recorded_name:
            references.add(stamp_to_ns(recorded.message.stamp))
        else:
            at = stamp_to_ns(recorded.message.header.stamp)
            poses[at] = decode_pose(recorded.message)[:3, 3]
    assert references == {START_NS}
    assert len(poses) == PAIRS
    last = poses[max(poses)]
    assert last == pytest.approx(moved(PAIRS - 1) - moved(0), abs=0.5e-3)


def test_without_being_asked_clicks_are_missed_and_the_way_out_is_named(recording: Path, tmp_path: Path) -> None:
    with pytest.raises(RecordingError, match=r"no clicks .*--automatic"):
        track_recording(recording, tmp_path / "out.mcap", dataclasses.replace(CONFIG))


def test_clicks_from_a_file_and_the_search_for_a_ring_exclude_each_other(recording: Path, tmp_path: Path) -> None:
    with pytest.raises(ConfigurationError, match="exclude each other"):
        track_recording(recording, tmp_path / "out.mcap", CONFIG, seeds=tmp_path / "clicks.yaml", automatic=True)
