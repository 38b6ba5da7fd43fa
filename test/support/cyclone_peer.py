"""A child of a test: the system around the tracker on another implementation of DDS, Cyclone DDS.

`python cyclone_peer.py PAIRS SIDE`: publishes clicks and so many pairs with calibration, each when the last is
answered, and writes a line `STAMP x y z` (ns, metres) for each `motion` that it hears; the first is the reference. One
end knows of the other earlier than the other way round, so what is not answered at first is tried again with the next
pair. ROS 2 puts `rt/` before a topic's name, and names a type of package/msg/Name `package::msg::dds_::Name_`.
"""

# Not `from __future__ import annotations`: the fields' types are read from the classes.
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from cyclonedds.core import Policy, Qos
from cyclonedds.domain import DomainParticipant
from cyclonedds.idl import IdlStruct
from cyclonedds.idl.types import array, float32, float64, int32, sequence, uint8, uint32
from cyclonedds.pub import DataWriter
from cyclonedds.sub import DataReader
from cyclonedds.topic import Topic
from cyclonedds.util import duration

from lasso_motion_ros.geometry.frames import PLANES, Plane
from lasso_motion_ros.stream.drawn_ring import breath_mm, ring_image, ring_projection, ring_seed

START_S = 1_760_000_000
PERIOD_NS = 100_000_000
PATIENCE_S = 30.0
FIRST_PATIENCE_S, FIRST_TRIES = 5.0, 6
TICK_S = 0.01


@dataclass
class Time(IdlStruct, typename="builtin_interfaces::msg::dds_::Time_"):
    sec: int32
    nanosec: uint32


@dataclass
class Header(IdlStruct, typename="std_msgs::msg::dds_::Header_"):
    stamp: Time
    frame_id: str


@dataclass
class Image(IdlStruct, typename="sensor_msgs::msg::dds_::Image_"):
    header: Header
    height: uint32
    width: uint32
    encoding: str
    is_bigendian: uint8
    step: uint32
    data: sequence[uint8]


@dataclass
class RegionOfInterest(IdlStruct, typename="sensor_msgs::msg::dds_::RegionOfInterest_"):
    x_offset: uint32 = 0
    y_offset: uint32 = 0
    height: uint32 = 0
    width: uint32 = 0
    do_rectify: bool = False


@dataclass
class CameraInfo(IdlStruct, typename="sensor_msgs::msg::dds_::CameraInfo_"):
    header: Header
    height: uint32
    width: uint32
    distortion_model: str
    d: sequence[float64]
    k: array[float64, 9]
    r: array[float64, 9]
    p: array[float64, 12]
    binning_x: uint32
    binning_y: uint32
    roi: RegionOfInterest


@dataclass
class Point32(IdlStruct, typename="geometry_msgs::msg::dds_::Point32_"):
    x: float32
    y: float32
    z: float32


@dataclass
class Polygon(IdlStruct, typename="geometry_msgs::msg::dds_::Polygon_"):
    points: sequence[Point32]


@dataclass
class PolygonStamped(IdlStruct, typename="geometry_msgs::msg::dds_::PolygonStamped_"):
    header: Header
    polygon: Polygon


@dataclass
class Point(IdlStruct, typename="geometry_msgs::msg::dds_::Point_"):
    x: float64
    y: float64
    z: float64


@dataclass
class Quaternion(IdlStruct, typename="geometry_msgs::msg::dds_::Quaternion_"):
    x: float64
    y: float64
    z: float64
    w: float64


@dataclass
class Pose(IdlStruct, typename="geometry_msgs::msg::dds_::Pose_"):
    position: Point
    orientation: Quaternion


@dataclass
class PoseStamped(IdlStruct, typename="geometry_msgs::msg::dds_::PoseStamped_"):
    header: Header
    pose: Pose


QUALITY = Qos(Policy.Reliability.Reliable(duration(seconds=1)), Policy.History.KeepLast(10))


class Peer:
    """Writers of the tracker's inputs, and a reader of its motion."""

    def __init__(self, side: int) -> None:
        self._side, self._generator = side, np.random.default_rng(5)
        self._participant = DomainParticipant()  # of the domain in CYCLONEDDS_URI
        types = {"image_raw": Image, "camera_info": CameraInfo, "seed": PolygonStamped}
        self._writers = {
            (plane, name): DataWriter(self._participant, self._topic(f"plane_{plane}/{name}", kind), qos=QUALITY)
            for plane in PLANES
            for name, kind in types.items()
        }
        self._motion = DataReader(self._participant, self._topic("motion", PoseStamped), qos=QUALITY)

    def _topic(self, name: str, kind: type) -> Any:
        return Topic(self._participant, f"rt/{name}", kind)

    def is_connected(self) -> bool:
        """Wait until the tracker listens to everything."""
        return happens(lambda: all(w.get_matched_subscriptions() for w in self._writers.values()), PATIENCE_S)

    def clicks(self, number: int) -> None:
        """On this pair, by its stamp: clicks and images travel on topics of their own, and either may come first."""
        seconds, nanoseconds = divmod(number * PERIOD_NS, 10**9)
        clicked = Header(Time(START_S + seconds, nanoseconds), "")
        for plane in PLANES:
            points = [
                Point32(float(x), float(y), 0.0)
                for x, y in ring_seed(self._side, breath_mm(1e-9 * number * PERIOD_NS)).points(plane)
            ]
            self._writers[plane, "seed"].write(PolygonStamped(clicked, Polygon(points)))

    def first_pair(self) -> int:
        """Click on a pair until one is answered; returns its number."""
        for number in range(FIRST_TRIES):
            self.clicks(number)
            if self.pair(number, FIRST_PATIENCE_S):
                return number
        sys.exit("no motion came of the first pairs")

    def pair(self, number: int, patience_s: float = PATIENCE_S) -> bool:
        """Publish one pair, and write down the motion that answers it; whether it did so in time."""
        for plane in PLANES:
            self._frame(plane, number)
        stamp = divmod(number * PERIOD_NS, 10**9)
        heard: list[PoseStamped] = []

        def is_answered() -> bool:
            heard.extend(
                m for m in self._motion.take(10) if (m.header.stamp.sec - START_S, m.header.stamp.nanosec) == stamp
            )
            return bool(heard)

        if not happens(is_answered, patience_s):
            return False
        for message in heard:
            at, position = message.header.stamp, message.pose.position
            sys.stdout.write(f"{at.sec * 10**9 + at.nanosec} {position.x!r} {position.y!r} {position.z!r}\n")
        return True

    def _frame(self, plane: Plane, number: int) -> None:
        seconds, nanoseconds = divmod(number * PERIOD_NS, 10**9)
        header = Header(Time(START_S + seconds, nanoseconds), f"detector_{plane}")
        projection = ring_projection(plane, self._side)
        k, r, _ = projection.decompose()
        flat = [part.reshape(-1).tolist() for part in (k, r, np.asarray(projection.matrix))]
        side = self._side
        info = CameraInfo(header, side, side, "plumb_bob", [0.0] * 5, *flat, 0, 0, RegionOfInterest())
        self._writers[plane, "camera_info"].write(info)
        pixels = ring_image(plane, side, breath_mm(1e-9 * number * PERIOD_NS), self._generator)
        encoding = "mono16" if pixels.dtype == np.uint16 else "mono8"
        rows = np.ascontiguousarray(pixels)
        data = rows.view(np.uint8).reshape(-1).tolist()
        self._writers[plane, "image_raw"].write(Image(header, side, side, encoding, 0, rows.strides[0], data))


def happens(what: Callable[[], bool], patience_s: float) -> bool:
    """Whether it comes to hold within that time."""
    deadline = time.monotonic() + patience_s
    while not (held := what()) and time.monotonic() < deadline:
        time.sleep(TICK_S)
    return held


def main() -> None:
    """Connect, click, publish pair by pair."""
    pairs, side = int(sys.argv[1]), int(sys.argv[2])
    peer = Peer(side)
    if not peer.is_connected():
        sys.exit("the tracker does not listen")
    first = peer.first_pair()
    for number in range(first + 1, first + pairs):
        if not peer.pair(number):
            sys.exit(f"no motion came of pair {number}")


if __name__ == "__main__":
    main()
