"""A consumer of the motion: where to draw a registered volume over each image of plane A.

    python examples/overlay_consumer.py

`Compensation` is what to keep, in whatever language you draw. It needs three topics of the tracker and one rule each:

- `reference` (std_msgs/Header, latched): the pair at which your registration is valid. Nothing is compensated before it
  has come. When it changes, the registration changes with it.
- `state` (std_msgs/String, latched): there is a motion in TRACKING and DEGRADED only. In any other state every motion
  that you still hold is void: draw the volume uncompensated, and say so in the picture. A tracker says its state every
  second at least: one from which nothing was heard for 2.5 s is gone or hangs, and the latched state with it is void.
- `motion` (geometry_msgs/PoseStamped): T with p_now = T · p_reference, metres, under the stamp of plane A's image. So
  the volume is drawn at T · registration over the image with that stamp, and over no other.

ROS 2 keeps no order among topics: a motion may be heard before the state or the reference that was published ahead of
it. `Compensation` asks what holds when an image is drawn, not what came last.

An image of plane B has the motion of its pair's A: the last A that is not later than it. `MotionHistory`, which
`lasso_overlay` draws with, does that too.
"""

from __future__ import annotations

import contextlib
import time
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import rclpy
from geometry_msgs.msg import PoseStamped
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node
from rclpy.qos import QoSDurabilityPolicy, QoSProfile, QoSReliabilityPolicy
from sensor_msgs.msg import Image
from std_msgs.msg import Header, String

from lasso_motion_ros.nodes.fastdds import use_image_profile
from msg_adapters.messages import stamp_to_ns
from msg_adapters.poses import decode_pose

Array = npt.NDArray[np.float64]

STATES_WITH_MOTION = ("TRACKING", "DEGRADED")
KEPT_MOTIONS = 100
MOTION_WAIT_S = 0.05  # the tracker answers in less; waiting longer shows old pictures
STALE_NS = 1_000_000_000  # in one second a breath moves the heart by 10 mm and more
TRACKER_SILENT_S = 2.5  # a tracker says its state every second at least
NEW_RUN_NS = 1_000_000_000  # stamps that go back by more belong to another recording


@dataclass(frozen=True)
class Place:
    """Where to draw the volume over one image.

    Attributes:
        transform: (4, 4) volume to world, metres.
        compensated: whether it moves with the heart.
        remark: what the picture has to say about it; empty where all is well.
    """

    transform: Array
    compensated: bool
    remark: str = ""


class Compensation:
    """Turns what the tracker says into the volume's place at an image's stamp.

    Args:
        registration: (4, 4) volume to world at the reference, metres.
    """

    def __init__(self, registration: Array) -> None:
        self._registration = registration
        self._state = ""
        self._reference_ns: int | None = None
        self._motions: dict[int, Array] = {}  # by stamp

    def take_reference(self, stamp_ns: int) -> bool:
        """Take the stamp of the reference pair; False where the volume has to be registered anew."""
        old_ns, self._reference_ns = self._reference_ns, stamp_ns
        if old_ns is None or old_ns == stamp_ns:
            return True
        # `~/set_reference` names a pair that was tracked. Its motion says where the volume lay then, and there it
        # stays: that is its registration at the new reference.
        at_new_reference = self._motions.get(stamp_ns)
        # On its own reference a pair has the identity. This one may have come first, but says nothing of the old one.
        if at_new_reference is None or np.array_equal(at_new_reference, np.eye(4)):
            return False  # new clicks: nobody knows how the new reference lies to the old
        self._registration = at_new_reference @ self._registration
        # Motions up to that pair are on the old reference, those after it on the new one already.
        later = {at_ns: motion for at_ns, motion in self._motions.items() if at_ns > stamp_ns}
        self._motions = {stamp_ns: np.eye(4), **later}
        return True

    def take_state(self, state: str) -> None:
        """Take the tracker's state; one without a motion ends the validity of all before it."""
        self._state = state
        if state not in STATES_WITH_MOTION:
            self._motions.clear()

    def take_motion(self, stamp_ns: int, motion: Array) -> None:
        """Take the motion (4, 4) of the pair with this stamp."""
        if self._motions and stamp_ns < max(self._motions) - NEW_RUN_NS:
            self._motions.clear()
        self._motions[stamp_ns] = motion
        while len(self._motions) > KEPT_MOTIONS:
            del self._motions[min(self._motions)]

    def awaits(self, stamp_ns: int) -> bool:
        """Whether the motion of the image with this stamp may still come."""
        return self._state in STATES_WITH_MOTION and stamp_ns not in self._motions

    def place(self, stamp_ns: int) -> Place:
        """Where to draw the volume over the image with this stamp, by what is known now."""
        if self._state not in STATES_WITH_MOTION:
            return Place(self._registration, compensated=False, remark=self._state or "no state yet")
        if self._reference_ns is None:
            return Place(self._registration, compensated=False, remark="no reference yet")
        # The image's own motion; where it has not come in time, the last one before it, while that is not stale.
        known_ns = [at_ns for at_ns in self._motions if at_ns <= stamp_ns]
        if not known_ns:
            return Place(self._registration, compensated=False, remark="no motion yet")
        age_ns = stamp_ns - max(known_ns)
        if age_ns > STALE_NS:
            return Place(self._registration, compensated=False, remark=f"motion {1e-9 * age_ns:.1f} s old")
        remarks = ["DEGRADED"] if self._state == "DEGRADED" else []
        if age_ns > 0:
            remarks.append(f"motion {1e-9 * age_ns:.2f} s old")
        return Place(self._motions[max(known_ns)] @ self._registration, compensated=True, remark=", ".join(remarks))


class OverlayConsumer(Node):
    """Draws each image of plane A as soon as its motion has come, or MOTION_WAIT_S later without it."""

    def __init__(self) -> None:
        super().__init__("overlay_consumer")
        self._compensation = Compensation(np.eye(4))  # put your registration here
        self._waiting_ns: int | None = None  # stamp of the image that is not drawn yet
        self._deadline_s = 0.0
        self._heard_s = 0.0
        # Latched topics hand their last message to whoever comes late, if the subscription asks for it.
        latched = QoSProfile(depth=1, durability=QoSDurabilityPolicy.TRANSIENT_LOCAL)
        # Best effort hears every publisher of images, whether it is reliable or not.
        images = QoSProfile(depth=10, reliability=QoSReliabilityPolicy.BEST_EFFORT)
        self.create_subscription(Header, "reference", self._on_reference, latched)
        self.create_subscription(String, "state", self._on_state, latched)
        self.create_subscription(PoseStamped, "motion", self._on_motion, 10)
        self.create_subscription(Image, "plane_a/image_raw", self._on_image, images)
        self.create_timer(0.2 * MOTION_WAIT_S, self._draw_what_is_due)

    def _on_reference(self, reference: Header) -> None:
        if not self._compensation.take_reference(stamp_to_ns(reference.stamp)):
            self.get_logger().warning("new reference: register the volume at it again")

    def _on_state(self, state: String) -> None:
        self._heard_s = time.monotonic()
        self._compensation.take_state(state.data)
        self._draw_what_is_due()

    def _on_motion(self, motion: PoseStamped) -> None:
        self._heard_s = time.monotonic()
        self._compensation.take_motion(stamp_to_ns(motion.header.stamp), decode_pose(motion))
        self._draw_what_is_due()

    def _on_image(self, image: Image) -> None:
        self._deadline_s = 0.0  # an image that still waits has its turn now: else a fast stream would never be drawn
        self._draw_what_is_due()
        self._waiting_ns = stamp_to_ns(image.header.stamp)
        self._deadline_s = time.monotonic() + MOTION_WAIT_S
        self._draw_what_is_due()

    def _draw_what_is_due(self) -> None:
        stamp_ns = self._waiting_ns
        if stamp_ns is None or (self._compensation.awaits(stamp_ns) and time.monotonic() < self._deadline_s):
            return
        self._waiting_ns = None
        if time.monotonic() - self._heard_s > TRACKER_SILENT_S:
            self._compensation.take_state("the tracker is silent")  # the last state that it said is none any more
        self._draw(stamp_ns, self._compensation.place(stamp_ns))

    def _draw(self, stamp_ns: int, place: Place) -> None:
        """Your renderer comes here: project the volume by the image's CameraInfo, and write the remark on it."""
        how = "compensated" if place.compensated else "UNCOMPENSATED"
        remark = f" ({place.remark})" if place.remark else ""
        position_mm = (1e3 * place.transform[:3, 3]).round(3)
        self.get_logger().info(f"image {stamp_ns}: {how}{remark}, volume at {position_mm} mm")


def main() -> None:
    """Draw until Ctrl-C."""
    use_image_profile()  # whole images through shared memory, before the first participant exists
    rclpy.init()
    with contextlib.suppress(KeyboardInterrupt, ExternalShutdownException):
        rclpy.spin(OverlayConsumer())
    rclpy.try_shutdown()


if __name__ == "__main__":
    main()
