"""What RViz and Foxglove draw by themselves on the standard views lies where the tracker drew it: real processes."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

pytest.importorskip("rclpy", reason="needs ROS 2")

from scipy.spatial.transform import Rotation
from support.drawn_recording import PERIOD_NS, SIDE, loop, projections, shift, stamp
from support.method_inputs import draw_curve
from support.node_harness import Graph
from support.tf2_interface import build_tf2_msgs, can_build

from lasso_motion_ros.geometry.projection import Projection
from lasso_motion_ros.geometry.transforms import apply
from msg_adapters import topics
from msg_adapters.calibrations import encode_camera_info
from msg_adapters.images import decode_image, encode_image
from msg_adapters.markers import decode_points
from msg_adapters.messages import header_fields, stamp_to_ns
from msg_adapters.poses import decode_pose
from msg_adapters.recordings.writer import RecordingWriter
from msg_adapters.seeds import encode_polygon

pytestmark = pytest.mark.ros

MOTIONS = [0.0, 2.0, 5.0, 3.0, 1.0, 0.0, 2.0, 5.0]
MIRRORED = ("a",)


def views() -> dict[str, Projection]:
    """One plane as angiography systems show it, which is mirrored to who stands behind the source; the other not."""
    flip = np.array([[-1.0, 0.0, SIDE - 1.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]])
    flipped = Projection(flip @ projections()["b"].matrix, SIDE, SIDE)
    return {"a": projections()["a"], "b": flipped}


def film(plane: str, z_mm: float) -> np.ndarray:
    return draw_curve(views()[plane].project(apply(shift(z_mm), loop())), (SIDE, SIDE), background=180.0)


def write_mirrored(path: Path) -> Path:
    with RecordingWriter(path) as writer:
        for pair, z_mm in enumerate(MOTIONS):
            header = header_fields(stamp(pair), "detector")
            for plane, projection in views().items():
                curve = projection.project(apply(shift(z_mm), loop()))
                sent = {
                    topics.camera_info_topic(plane): encode_camera_info(projection, header)
                    | {"p": np.array(-3.0 * projection.matrix).reshape(-1)},
                    topics.image_topic(plane): encode_image(film(plane, z_mm), header),
                }
                if pair == 0:
                    sent[topics.seed_topic(plane)] = encode_polygon(curve[:-1:18], header)
                for topic, fields in sent.items():
                    writer.write(topic.recorded_name, topic.type_name, fields, stamp(pair), latched=topic.latched)
    return path


def off_the_drawn_line(picture: np.ndarray, curve: np.ndarray) -> np.ndarray:
    """How far from each point of a curve, across it, the middle of the green line lies, pixels."""
    green = np.clip(picture[..., 1].astype(np.float32) - picture[..., 0], 0.0, None)
    along = np.gradient(curve, axis=0)
    across = np.column_stack([-along[:, 1], along[:, 0]]) / np.linalg.norm(along, axis=1, keepdims=True)
    steps = np.arange(-2.5, 2.51, 0.1)
    at = (curve[:, None, :] + steps[:, None] * across[:, None, :]).astype(np.float32)
    found = cv2.remap(green, at[..., 0], at[..., 1], cv2.INTER_LINEAR)
    assert np.all(found.sum(axis=1) > 100.0)  # there is a line all along
    return np.asarray(found @ steps / found.sum(axis=1))


def test_other_tools_draw_the_catheter_where_the_tracker_does(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, request: pytest.FixtureRequest
) -> None:
    if not can_build():
        pytest.skip("needs a C++ compiler and rosidl's generators to make tf2_msgs")
    site = build_tf2_msgs(tmp_path / "tf2")
    monkeypatch.syspath_prepend(str(site))
    monkeypatch.setenv("PYTHONPATH", f"{site}:{':'.join(path for path in sys.path if path)}")
    request.addfinalizer(lambda: [sys.modules.pop(name) for name in list(sys.modules) if name.startswith("tf2_msgs")])
    standard = [make(p) for p in "ab" for make in (topics.standard_image_topic, topics.standard_camera_info_topic)]
    listened = [topics.MOTION, topics.CATHETER, *map(topics.tracking_topic, "ab"), topics.TF, *standard]
    with Graph(listened, tmp_path) as graph:
        heard = graph.heard.messages
        graph.processes.start_node("tracker", "lasso_tracker")
        graph.wait_until(lambda: all(graph.listener.publishers(topic) for topic in listened))
        recording = write_mirrored(tmp_path / "mirrored.mcap")
        graph.processes.start("player", "lasso_motion_ros.cli.main", ["play", str(recording), "--rate", "0.5"])

        def complete() -> list[int]:
            """The pairs of which all has come."""
            stamped = [
                {stamp_to_ns(one.header.stamp) for one in heard[topic.name]}
                for topic in (topics.MOTION, topics.CATHETER, *map(topics.tracking_topic, "ab"), *standard)
            ]
            return sorted(set.intersection(*stamped, *({at for at, _ in frames()[name]} for name in FRAMES)))

        def frames() -> dict[str, list[tuple[int, Any]]]:
            placed: dict[str, list[tuple[int, Any]]] = {name: [] for name in FRAMES}
            for message in heard[topics.TF.name]:
                for one in message.transforms:
                    assert one.header.frame_id == "patient_table"
                    placed[one.child_frame_id].append((stamp_to_ns(one.header.stamp), one.transform))
            return placed

        graph.heard.wait_for(lambda: len([at for at in complete() if at > stamp(0)]) >= 2)
        at = complete()[-1]
        transforms = {name: dict(placed)[at] for name, placed in frames().items()}

    def of(topic: topics.Topic) -> Any:
        return next(one for one in heard[topic.name] if stamp_to_ns(one.header.stamp) == at)

    def matrix(transform: Any) -> np.ndarray:
        found, turn, place = np.eye(4), transform.rotation, transform.translation
        found[:3, :3] = Rotation.from_quat([turn.x, turn.y, turn.z, turn.w]).as_matrix()
        found[:3, 3] = place.x, place.y, place.z
        return found

    np.testing.assert_allclose(matrix(transforms["left_atrium"]), decode_pose(of(topics.MOTION)), atol=1e-9)
    catheter = decode_points(of(topics.CATHETER))
    for plane in "ab":
        info, image = of(topics.standard_camera_info_topic(plane)), of(topics.standard_image_topic(plane))
        assert info.header == image.header
        assert info.header.frame_id == f"plane_{plane}_standard_optical"
        k = np.reshape(info.k, (3, 3))
        np.testing.assert_array_equal(np.reshape(info.p, (3, 4)), np.column_stack([k, np.zeros(3)]))
        assert k[0, 0] > 0 < k[1, 1]
        # As RViz and Foxglove do it: into the image's frame by TF, then by the camera matrix.
        camera = np.linalg.inv(matrix(transforms[info.header.frame_id]))
        seen = apply(camera, catheter)
        drawn = np.column_stack([k[i, i] * seen[:, i] / seen[:, 2] + k[i, 2] for i in (0, 1)])
        picture = decode_rgb(of(topics.tracking_topic(plane)))
        raw = film(plane, MOTIONS[(at - stamp(0)) // PERIOD_NS])
        if plane in MIRRORED:
            picture, raw = picture[:, ::-1], raw[:, ::-1]
        np.testing.assert_array_equal(decode_image(image), raw)
        assert np.abs(off_the_drawn_line(picture, drawn)).max() < 0.5


FRAMES = ("left_atrium", "plane_a_standard_optical", "plane_b_standard_optical")


def decode_rgb(message: Any) -> np.ndarray:
    assert message.encoding == "rgb8"
    return np.frombuffer(message.data, np.uint8).reshape(message.height, message.width, 3)
