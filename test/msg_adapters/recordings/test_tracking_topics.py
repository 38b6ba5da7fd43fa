"""What a recording lacks is named, with what is there."""

from __future__ import annotations

from pathlib import Path

import pytest

from lasso_motion_ros.core.errors import RecordingError
from msg_adapters.recordings.tracking_topics import check_tracking_topics


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
