"""TF, out and in, with real processes: what RViz and Foxglove draw by themselves on the standard views lies where the
tracker drew it; and calibrations whose pose is on /tf are tracked by, while the gantry turns.

`tf2_msgs` is made of its one message. `tf2_ros` is the installed one; where there is none (its C++ part has no wheel),
a stand-in that hears /tf takes its place, and tf2's own buffer is not run.
"""

from __future__ import annotations

import importlib.util
import shutil
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

pytest.importorskip("rclpy", reason="needs ROS 2")

from rclpy.duration import Duration
from scipy.spatial.transform import Rotation
from support.drawn_recording import PERIOD_NS, SIDE, loop, projections, shift, stamp
from support.method_inputs import draw_curve
from support.node_harness import Graph
from support.paths import ROOT
from support.tf2_interface import build_tf2_msgs, can_build

from lasso_motion_ros.geometry.carm import carm_projection
from lasso_motion_ros.geometry.projection import Projection
from lasso_motion_ros.geometry.transforms import apply, inverse
from msg_adapters import topics
from msg_adapters.calibrations import encode_camera_info
from msg_adapters.images import decode_image, encode_image
from msg_adapters.markers import decode_points
from msg_adapters.messages import RosMessages, header_fields, stamp_to_ns
from msg_adapters.poses import decode_pose, encode_transform_stamped
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


@pytest.fixture(scope="module", autouse=True)
def tf2(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    """An environment with `tf2_msgs` and `tf2_ros`, for this process and its children."""
    if not can_build():
        pytest.skip("needs a C++ compiler and rosidl's generators to make tf2_msgs")
    site = build_tf2_msgs(tmp_path_factory.mktemp("tf2"))
    if importlib.util.find_spec("tf2_ros") is None:
        (site / "tf2_ros").mkdir()
        shutil.copy(ROOT / "test" / "support" / "tf2_ros_stand_in.py", site / "tf2_ros" / "__init__.py")
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(str(site))
        patch.setenv("PYTHONPATH", f"{site}:{':'.join(path for path in sys.path if path)}")
        yield
    for name in list(sys.modules):
        if name.startswith("tf2_msgs"):
            del sys.modules[name]


def test_other_tools_draw_the_catheter_where_the_tracker_does(tmp_path: Path) -> None:
    standard = [make(p) for p in "ab" for make in (topics.standard_image_topic, topics.standard_camera_info_topic)]
    listened = [topics.MOTION, topics.CATHETER, *map(topics.tracking_topic, "ab"), topics.TF, *standard]
    with Graph(listened, tmp_path) as graph:
        heard = graph.heard.messages
        graph.processes.start("tracker", "support.brisk_tracker", ["lasso_tracker"])
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


def turning(plane: str, pair: int) -> Projection:
    """The gantry turns by 1.5 degrees from pair to pair."""
    lao_deg = {"a": -30.0, "b": 60.0}[plane] + 1.5 * pair
    return carm_projection(
        np.radians(lao_deg), 0.05, source_detector_m=1.2, source_object_m=0.785, pixel_size_m=0.4e-3, width=SIDE,
        height=SIDE,
    )  # fmt: skip


def test_a_camera_whose_pose_is_on_tf_is_tracked_by_while_it_turns(tmp_path: Path) -> None:
    inputs = [make(p) for p in "ab" for make in (topics.camera_info_topic, topics.image_topic)]
    with Graph([topics.MOTION, topics.STATE], tmp_path) as graph:
        # What tells the tracker where the camera stands goes out first; the seeds last, once there is a pair.
        send = {topic.name: graph.publisher(topic) for topic in (topics.TF, *inputs, *map(topics.seed_topic, "ab"))}
        arguments = ["lasso_tracker", "--ros-args", "-p", "publish_tf:=false"]
        graph.processes.start("tracker", "support.brisk_tracker", arguments)
        graph.wait_until(lambda: all(one.get_subscription_count() for one in send.values()))

        def publish(topic: topics.Topic, fields: dict[str, Any]) -> None:
            send[topic.name].publish(RosMessages().make(topic.type_name, fields))

        for pair, z_mm in enumerate(MOTIONS[:4]):
            for ahead in (0, 1) if pair == 0 else (pair + 1,):  # so that the newest pose is the next pair's
                publish(topics.TF, {"transforms": [standing(plane, ahead) for plane in "ab"]})
            assert send[topics.TF.name].wait_for_all_acked(Duration(seconds=30.0))
            for plane in "ab":
                projection, header = turning(plane, pair), header_fields(stamp(pair), f"source_{plane}")
                curve = projection.project(apply(shift(z_mm), loop()))
                plain = np.column_stack([projection.decompose()[0], np.zeros(3)])
                pixels = draw_curve(curve, (SIDE, SIDE), background=180.0)
                publish(
                    topics.camera_info_topic(plane), encode_camera_info(projection, header) | {"p": plain.reshape(-1)}
                )
                publish(topics.image_topic(plane), encode_image(pixels, header))
                if pair == 0:
                    publish(topics.seed_topic(plane), encode_polygon(curve[:-1:18], header))
            graph.heard.wait_for(lambda count=pair + 1: len(motions(graph)) == count)
        for when, motion in motions(graph):
            expected = MOTIONS[(when - stamp(0)) // PERIOD_NS]
            np.testing.assert_allclose(1e3 * motion[:3, 3], [0.0, 0.0, expected], atol=0.4)


def standing(plane: str, pair: int) -> dict[str, Any]:
    """Where a plane's camera stands in the world, as TF has it."""
    _, rotation, translation = turning(plane, pair).decompose()
    to_camera = np.vstack([np.column_stack([rotation, translation]), [0.0, 0.0, 0.0, 1.0]])
    return encode_transform_stamped(inverse(to_camera), header_fields(stamp(pair), "patient_table"), f"source_{plane}")


def motions(graph: Graph) -> list[tuple[int, np.ndarray]]:
    return [(stamp_to_ns(one.header.stamp), decode_pose(one)) for one in graph.heard.messages[topics.MOTION.name]]


FRAMES = ("left_atrium", "plane_a_standard_optical", "plane_b_standard_optical")


def decode_rgb(message: Any) -> np.ndarray:
    assert message.encoding == "rgb8"
    return np.frombuffer(message.data, np.uint8).reshape(message.height, message.width, 3)
