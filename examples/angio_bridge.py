"""An angiography system bridged into ROS 2: frames and C-arm geometry in, the tracker's input topics out.

    python examples/angio_bridge.py sequence.npz --wait 30

`SimulatedAngiography` stands for the vendor's interface; put yours in its place. `Bridge` is what to keep:

- Stamps: the instant of the exposure, converted from the system's clock to this machine's; never the time of arrival.
- Geometry: one CameraInfo with every frame, under the frame's own header and published *before* it, since gantry, table
  and zoom may move at any time. `p` maps world metres to pixels; the world is fixed to the table top.
- Quality of service: reliable, keep the last 10; best-effort subscribers hear it as well. The calibration is also
  latched (transient local): a subscriber that joins between two frames has it at once.
- Shared memory: a profile with room for whole images, loaded before the first participant exists.

Whether the tracker is content with it is what `lasso-motion check` tells.
"""

from __future__ import annotations

import argparse
import contextlib
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt
import rclpy
from rclpy.duration import Duration
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node
from rclpy.qos import QoSDurabilityPolicy, QoSProfile, QoSReliabilityPolicy
from sensor_msgs.msg import CameraInfo, Image

from lasso_motion_ros.geometry.carm import carm_projection
from lasso_motion_ros.geometry.projection import Projection
from lasso_motion_ros.nodes.fastdds import use_image_profile
from msg_adapters.calibrations import encode_camera_info
from msg_adapters.images import encode_image
from msg_adapters.messages import RosMessages, header_fields

CLOCK_READINGS = 8  # a reading may be held up; the quickest of a few is hardly off


@dataclass(frozen=True)
class Exposure:
    """One frame as the system gives it: its own units (mm, degrees), its own clock.

    Attributes:
        plane: `a` or `b`.
        time_s: instant of the exposure, seconds of the system's clock.
        pixels: (H, W) uint8 or uint16, as displayed facing the patient.
        lao_deg: rotation of the detector, LAO positive.
        cranial_deg: its tilt, CRAN positive.
        source_detector_mm: SID.
        source_object_mm: source to iso-centre.
        pixel_mm: pitch of the *published* pixels on the detector (of a zoomed field: the smaller one).
        table_mm: (3,) table top from its reference position, towards the patient's left, posterior, cranial.
    """

    plane: str
    time_s: float
    pixels: npt.NDArray[np.uint16]
    lao_deg: float
    cranial_deg: float
    source_detector_mm: float
    source_object_mm: float
    pixel_mm: float
    table_mm: npt.NDArray[np.float64]


class SimulatedAngiography:
    """A stand-in for a vendor's interface: plays NumPy arrays as a system would expose them, in real time.

    Args:
        path: .npz with, for both planes x: frames_x (N, H, W), time_x_s, lao_x_deg, cranial_x_deg (N,), and for the
            system: source_detector_mm, source_object_mm, pixel_mm, table_mm (N, 3).
    """

    CLOCK_BEHIND_S = 1234.5  # its clock has an epoch of its own, as such systems' have

    def __init__(self, path: Path) -> None:
        with np.load(path, allow_pickle=False) as file:
            self._data = {name: file[name] for name in file.files}

    def clock_s(self) -> float:
        """The system's clock now."""
        return time.time() - self.CLOCK_BEHIND_S

    def exposures(self) -> Iterator[Exposure]:
        """Frames of both planes as they are exposed; blocks until the next one."""
        data, began_s = self._data, self.clock_s()
        order = sorted((time_s, plane, k) for plane in "ab" for k, time_s in enumerate(data[f"time_{plane}_s"]))
        for time_s, plane, k in order:
            time.sleep(max(0.0, began_s + time_s - self.clock_s()))
            yield Exposure(
                plane=plane,
                time_s=began_s + float(time_s),
                pixels=data[f"frames_{plane}"][k],
                lao_deg=float(data[f"lao_{plane}_deg"][k]),
                cranial_deg=float(data[f"cranial_{plane}_deg"][k]),
                source_detector_mm=float(data["source_detector_mm"]),
                source_object_mm=float(data["source_object_mm"]),
                pixel_mm=float(data["pixel_mm"]),
                table_mm=data["table_mm"][k],
            )


def projection_of(exposure: Exposure) -> Projection:
    """World metres (fixed to the table top) to pixels of the published image.

    The table carries the world: when it has moved by d, the iso-centre lies at -d in world coordinates.
    """
    height, width = exposure.pixels.shape
    return carm_projection(
        np.radians(exposure.lao_deg),
        np.radians(exposure.cranial_deg),
        source_detector_m=1e-3 * exposure.source_detector_mm,
        source_object_m=1e-3 * exposure.source_object_mm,
        pixel_size_m=1e-3 * exposure.pixel_mm,
        width=width,
        height=height,
        iso_centre=-1e-3 * exposure.table_mm,
    )


class Bridge:
    """Publishes exposures on the tracker's input topics.

    Args:
        node: the node; its namespace and remappings hold.
        system: whose clock stamps the exposures.
    """

    def __init__(self, node: Node, system: SimulatedAngiography) -> None:
        self._messages = RosMessages()
        reliable = QoSReliabilityPolicy.RELIABLE
        quality = QoSProfile(depth=10, reliability=reliable)
        latched = QoSProfile(depth=10, reliability=reliable, durability=QoSDurabilityPolicy.TRANSIENT_LOCAL)
        self._images = {x: node.create_publisher(Image, f"plane_{x}/image_raw", quality) for x in "ab"}
        self._infos = {x: node.create_publisher(CameraInfo, f"plane_{x}/camera_info", latched) for x in "ab"}
        self._clock_offset_s = min(self._clock_difference(system) for _ in range(CLOCK_READINGS))[1]

    @staticmethod
    def _clock_difference(system: SimulatedAngiography) -> tuple[float, float]:
        """Duration of one reading, and this machine's clock minus the system's by it, seconds."""
        before = time.time()
        theirs = system.clock_s()
        after = time.time()
        return after - before, 0.5 * (before + after) - theirs

    def subscribed(self, count: int) -> bool:
        """Whether each topic has this many subscribers."""
        return all(one.get_subscription_count() >= count for one in (*self._images.values(), *self._infos.values()))

    def publish(self, exposure: Exposure) -> None:
        """Publish one frame: first its calibration, under the same header."""
        stamp_ns = round((exposure.time_s + self._clock_offset_s) * 1e9)
        header = header_fields(stamp_ns, f"plane_{exposure.plane}_optical")
        info = encode_camera_info(projection_of(exposure), header)
        self._infos[exposure.plane].publish(self._messages.make("sensor_msgs/msg/CameraInfo", info))
        image = encode_image(exposure.pixels, header)
        self._images[exposure.plane].publish(self._messages.make("sensor_msgs/msg/Image", image))

    def finish(self) -> None:
        """Wait until every subscriber has the last frame."""
        for publisher in (*self._images.values(), *self._infos.values()):
            publisher.wait_for_all_acked(Duration(seconds=5))


def main() -> None:
    """Bridge the sequence to its end."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("sequence", type=Path, help="the .npz that stands for the system")
    parser.add_argument(
        "--wait", type=float, default=0.0, metavar="S", help="first wait for subscribers, at most S seconds"
    )
    parser.add_argument(
        "--subscribers", type=int, default=1, metavar="N", help="how many to wait for on each topic (default 1)"
    )
    arguments, ros_arguments = parser.parse_known_args()
    warning = use_image_profile()
    rclpy.init(args=ros_arguments)
    node = rclpy.create_node("angio_bridge")
    if warning:
        node.get_logger().warning(warning)
    system = SimulatedAngiography(arguments.sequence)
    bridge = Bridge(node, system)
    deadline = time.monotonic() + arguments.wait
    with contextlib.suppress(KeyboardInterrupt, ExternalShutdownException):
        while not bridge.subscribed(arguments.subscribers) and time.monotonic() < deadline:
            rclpy.spin_once(node, timeout_sec=0.05)
        for exposure in system.exposures():
            if not rclpy.ok():
                break
            bridge.publish(exposure)
        bridge.finish()
    rclpy.try_shutdown()


if __name__ == "__main__":
    main()
