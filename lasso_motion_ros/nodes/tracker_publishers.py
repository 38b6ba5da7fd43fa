"""What the tracker node publishes: answers in order, state, pictures, diagnostics."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
from rclpy.duration import Duration
from rclpy.node import Node
from rclpy.publisher import Publisher

from lasso_motion_ros.config.stream import StreamConfig
from lasso_motion_ros.geometry.frames import PLANES, Frame, FramePair, Plane, UncalibratedFrame
from lasso_motion_ros.initialisation.proposal import Proposal
from lasso_motion_ros.nodes.qos import topic_publisher
from lasso_motion_ros.nodes.standard_views import StandardViews, TransformPublisher
from lasso_motion_ros.nodes.worker import Worker
from lasso_motion_ros.overlay.tracking_picture import PROPOSAL_COLOUR, draw_tracking
from lasso_motion_ros.stream.outputs import Output
from lasso_motion_ros.tracking.tracker import TrackerState
from msg_adapters.images import encode_image
from msg_adapters.markers import encode_delete, encode_line_strip
from msg_adapters.messages import MessageFactory, header_fields
from msg_adapters.poses import decode_pose
from msg_adapters.topics import (
    DIAGNOSTICS,
    IMAGE_TYPE,
    MOTION,
    OUTPUTS,
    PROPOSAL,
    STATE,
    STATE_RENEWED_S,
    Topic,
    tracking_topic,
)

GOODBYE_WAIT_S = 1.0


@dataclass(frozen=True, eq=False)
class TrackingPicture:
    """What `plane_x/tracking` is to show.

    Attributes:
        frames: the planes' images, of one pair, or the newest while there is no calibration.
        loop: (N, 3) the catheter's curve, world metres, or None.
        state: the state.
        reason: why, in a few words.
        clicks: per plane (N, 2) pixels; empty where none are collected.
        frame_ids: per plane, of the images.
        held: the pair is frozen: no other is shown after it.
        remark: a further line under the reason, or empty.
    """

    frames: dict[Plane, Frame | UncalibratedFrame]
    loop: npt.NDArray[np.float64] | None
    state: TrackerState
    reason: str
    clicks: dict[Plane, npt.NDArray[np.float64]]
    frame_ids: dict[Plane, str]
    held: bool = False
    remark: str = ""


class TrackerPublishers:
    """Ordinary publishers that live as long as the node, so that INACTIVE is seen too; pictures in their own thread.

    Args:
        node: the node.
        messages: makes the messages.
        on_error: takes what drawing raised.
        on_change: called when another state than the last was published.
        config: names the frames, and says whether /tf is published.
    """

    def __init__(
        self,
        node: Node,
        messages: MessageFactory,
        on_error: Callable[[Exception], None],
        on_change: Callable[[], None],
        config: StreamConfig,
    ) -> None:
        self._messages = messages
        self._on_change = on_change
        self._showing = threading.Lock()
        self._held = False
        # What belongs to one pair goes out together: no state of another thread comes between a pair's state and pose.
        self._publishing = threading.RLock()
        self._stated_s = 0.0
        self._proposed: tuple[npt.NDArray[np.float64], ...] = ()  # curves of the rings, world metres
        self.state = ""
        self._publishers: dict[str, Publisher] = {
            topic.name: topic_publisher(node, messages, topic)
            for topic in (*OUTPUTS, PROPOSAL, DIAGNOSTICS, *(tracking_topic(plane) for plane in PLANES))
        }
        self._world_frame, self._atrium_frame = config.world_frame, config.atrium_frame
        self._transforms = TransformPublisher(node, messages, config.publish_tf)
        self._standard = StandardViews(node, messages, self._transforms, config.world_frame, on_error)
        # One picture may wait: a viewer wants the newest, and the tracker must not wait for the drawing.
        self._pictures: Worker[TrackingPicture] = Worker(
            self._draw, capacity=1, burst_capacity=1, takes_long=lambda _: False, on_error=on_error, name="pictures"
        )

    def publish(self, outputs: Iterable[Output]) -> None:
        """Publish answers, in their order."""
        changed = False
        with self._publishing:
            for output in outputs:
                if output.topic is STATE:
                    changed = changed or output.fields["data"] != self.state
                    self.state = output.fields["data"]
                    self._stated_s = time.monotonic()
                self._publishers[output.topic.name].publish(output.data)
                if output.topic is MOTION and self._transforms.is_active:
                    transform = decode_pose(self._messages.make(MOTION.type_name, output.fields))
                    self._transforms.publish(output.stamp_ns, self._world_frame, self._atrium_frame, transform)
        if changed:
            self._on_change()

    def publish_state(self, state: TrackerState) -> None:
        """Publish a state, unless it is the last one published."""
        if state.value != self.state:
            self.publish([self._state_output(state.value)])

    def renew_state(self) -> None:
        """Publish the last state again, if that was long ago: a state that nobody renews is no state."""
        with self._publishing:
            if self.state and time.monotonic() - self._stated_s >= STATE_RENEWED_S:
                self.publish([self._state_output(self.state)])

    def _state_output(self, state: str) -> Output:
        return Output(STATE, lambda: {"data": state}, 0)

    def publish_fields(self, topic: Topic, fields: dict[str, Any]) -> None:
        """Publish a message of any of the topics."""
        self._publishers[topic.name].publish(self._messages.make(topic.type_name, fields))

    def publish_proposals(self, proposals: Sequence[Proposal]) -> None:
        """Publish the rings that are proposed, best first, in place of those before."""
        header = header_fields(0, self._world_frame)
        red, green, blue = (part / 255.0 for part in PROPOSAL_COLOUR)
        with self._publishing:
            for number in range(len(self._proposed)):
                self.publish_fields(PROPOSAL, encode_delete(header, "proposal") | {"id": number})
            for number, one in enumerate(proposals):
                header = header_fields(one.pair.stamp_ns, self._world_frame)
                fields = encode_line_strip(one.points, header, "proposal", (red, green, blue, 1.0)) | {"id": number}
                self.publish_fields(PROPOSAL, fields)
            self._proposed = tuple(one.points for one in proposals)

    @property
    def watched(self) -> bool:
        """Whether anybody subscribes to a picture."""
        return any(self._publishers[tracking_topic(plane).name].get_subscription_count() > 0 for plane in PLANES)

    def show(self, picture: TrackingPicture) -> None:
        """Have pictures drawn and published; does not wait for the drawing.

        Once this has returned for a held pair, no picture of another pair is published: whoever freezes a pair takes
        the next picture for the frozen one's.
        """
        with self._showing:
            self._held = picture.held
        self._pictures.put([picture])

    def show_standard(self, pair: FramePair | None) -> None:
        """Have a pair's film published with its plain cameras, while somebody looks; does not wait."""
        if pair is not None:
            self._standard.show(pair.frames)

    def close(self) -> None:
        """Stop drawing, and wait until those who listen have the last state."""
        self._pictures.stop()
        self._standard.close()
        self._publishers[STATE.name].wait_for_all_acked(Duration(seconds=GOODBYE_WAIT_S))

    def _draw(self, picture: TrackingPicture) -> None:
        for plane in PLANES:
            publisher, frame = self._publishers[tracking_topic(plane).name], picture.frames.get(plane)
            if frame is None or publisher.get_subscription_count() == 0:
                continue
            clicks = picture.clicks.get(plane)
            drawn = draw_tracking(
                frame,
                picture.loop,
                picture.state,
                picture.reason,
                clicks=clicks,
                remark=picture.remark,
                proposed=self._proposed,
            )
            fields = encode_image(drawn, header_fields(frame.stamp_ns, picture.frame_ids.get(plane, "")))
            message = self._messages.make(IMAGE_TYPE, fields)
            with self._showing:
                if self._held and not picture.held:
                    return
                publisher.publish(message)
