"""What the tracker asks of `tf2_ros`, for where its C++ part (`tf2_py`) is not to be had.

It listens on /tf and /tf_static as tf2_ros does, but knows two frames that follow each other directly, and no others.
"""

from __future__ import annotations

import bisect
from types import SimpleNamespace
from typing import Any

from geometry_msgs.msg import Transform
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile
from rclpy.time import Time
from scipy.spatial.transform import Rotation, Slerp
from tf2_msgs.msg import TFMessage


class TransformException(Exception):  # noqa: N818 - its name in tf2_ros
    """No such transform."""


class Buffer:
    """Transforms by child and parent frame, in order of time."""

    def __init__(self) -> None:
        self._known: dict[tuple[str, str], list[tuple[int, Transform]]] = {}
        self._static: dict[tuple[str, str], Transform] = {}

    def set_transform(self, message: Any, *, static: bool) -> None:
        edge = message.child_frame_id, message.header.frame_id
        if static:
            self._static[edge] = message.transform
        else:
            stamp = Time.from_msg(message.header.stamp).nanoseconds
            bisect.insort(self._known.setdefault(edge, []), (stamp, message.transform), key=lambda one: one[0])

    def lookup_transform(self, target: str, source: str, time: Time) -> Any:
        """The `target` ← `source` transform at a time, where one is the other's parent; never waits."""
        for child, parent, forward in ((source, target, True), (target, source, False)):
            if (child, parent) in self._static or (child, parent) in self._known:
                turn, place = self._at(child, parent, time.nanoseconds)
                if not forward:
                    turn, place = turn.inv(), -turn.inv().apply(place)
                return SimpleNamespace(transform=_message(turn, place))
        raise TransformException(f'"{target}" passed to lookupTransform argument target_frame does not exist.')

    def _at(self, child: str, parent: str, stamp: int) -> tuple[Rotation, Any]:
        if (child, parent) in self._static:
            return _parts(self._static[child, parent])
        known = self._known[child, parent]
        times = [one for one, _ in known]
        if not times[0] <= stamp <= times[-1]:
            raise TransformException("Lookup would require extrapolation")
        after = bisect.bisect_left(times, stamp)
        if times[after] == stamp:
            return _parts(known[after][1])
        (first, a), (last, b) = known[after - 1], known[after]
        share = (stamp - first) / (last - first)
        (turn_a, place_a), (turn_b, place_b) = _parts(a), _parts(b)
        turn = Slerp([0.0, 1.0], Rotation.concatenate([turn_a, turn_b]))(share)
        return turn, (1.0 - share) * place_a + share * place_b


class TransformListener:
    """Fills a buffer from /tf and /tf_static."""

    def __init__(self, buffer: Buffer, node: Node) -> None:
        latched = QoSProfile(depth=100, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        for topic, profile, static in (("/tf", QoSProfile(depth=100), False), ("/tf_static", latched, True)):

            def take(message: TFMessage, static: bool = static) -> None:
                for one in message.transforms:
                    buffer.set_transform(one, static=static)

            node.create_subscription(TFMessage, topic, take, profile)


def _parts(transform: Transform) -> tuple[Rotation, Any]:
    turn, place = transform.rotation, transform.translation
    return Rotation.from_quat([turn.x, turn.y, turn.z, turn.w]), Rotation.identity().apply([place.x, place.y, place.z])


def _message(turn: Rotation, place: Any) -> Transform:
    made = Transform()
    made.rotation.x, made.rotation.y, made.rotation.z, made.rotation.w = map(float, turn.as_quat())
    made.translation.x, made.translation.y, made.translation.z = map(float, place)
    return made
