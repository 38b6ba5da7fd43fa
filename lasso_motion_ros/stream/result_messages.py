"""The messages that a result is published as, in the order in which consumers need them."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

from lasso_motion_ros.stream.heartbeat_separation import PublishedMotion
from lasso_motion_ros.stream.outputs import Output
from lasso_motion_ros.tracking.tracker import TrackerState, TrackResult
from msg_adapters.markers import encode_delete, encode_line_strip
from msg_adapters.messages import MessageFactory, header_fields
from msg_adapters.poses import encode_pose_stamped, encode_pose_with_covariance_stamped
from msg_adapters.topics import CATHETER, MOTION, MOTION_RAW, MOTION_WITH_COVARIANCE, REFERENCE, STATE, Topic

_CATHETER_NAMESPACE = "catheter"


class ResultMessages:
    """Makes the published messages, and remembers what consumers know: the reference, and whether a loop is shown.

    Args:
        messages: makes the messages.
        world_frame: frame of poses and loop.
    """

    def __init__(self, messages: MessageFactory, world_frame: str) -> None:
        self._messages = messages
        self._world_frame = world_frame
        self._shown = False
        self.reference_ns: int | None = None

    def of_state(self, state: TrackerState, stamp_ns: int) -> Output:
        """The state alone, at a pair's stamp; 0 where no pair brought it."""
        return self._output(STATE, lambda: {"data": state.value}, stamp_ns)

    def of_loss(self) -> list[Output]:
        """LOST, and no loop, where no pair brought it; what consumers know of the next pair's does not change."""
        return [self.of_state(TrackerState.LOST, 0), self._delete_output(0)]

    def of_result(
        self, result: TrackResult, published: PublishedMotion | None, *, is_new: bool = False
    ) -> list[Output]:
        """Reference (where it changes), state, poses, catheter, in this order.

        Args:
            result: the tracker's answer.
            published: what `motion` is to say; None where it is not updated.
            is_new: the model was built on this pair.
        """
        stamp = result.stamp_ns
        header = header_fields(stamp, self._world_frame)
        outputs: list[Output] = []
        if is_new or result.reference_stamp_ns != self.reference_ns:
            self.reference_ns = result.reference_stamp_ns
            reference = header_fields(result.reference_stamp_ns, self._world_frame)
            outputs.append(self._output(REFERENCE, lambda: reference, stamp))
        outputs.append(self.of_state(result.state, stamp))
        if published is not None:
            outputs.append(self._output(MOTION, partial(encode_pose_stamped, published.motion, header), stamp))
        if result.state.has_pose and result.motion is not None:
            outputs.append(self._output(MOTION_RAW, partial(encode_pose_stamped, result.motion, header), stamp))
        if published is not None and published.covariance is not None:
            fields = partial(encode_pose_with_covariance_stamped, published.motion, published.covariance, header)
            outputs.append(self._output(MOTION_WITH_COVARIANCE, fields, stamp))
        if result.loop is not None:
            fields = partial(encode_line_strip, result.loop, header, _CATHETER_NAMESPACE)
            outputs.append(self._output(CATHETER, fields, stamp))
        else:
            # Sent for every such pair: it is the only stamped message of a pair without a pose.
            outputs.append(self._delete_output(stamp))
        self._shown = result.loop is not None
        return outputs

    def take_catheter_away(self, stamp_ns: int) -> list[Output]:
        """The message that removes the loop, if one is shown."""
        if not self._shown:
            return []
        self._shown = False
        return [self._delete_output(stamp_ns)]

    def _delete_output(self, stamp_ns: int) -> Output:
        header = header_fields(stamp_ns, self._world_frame)
        return self._output(CATHETER, partial(encode_delete, header, _CATHETER_NAMESPACE), stamp_ns)

    def _output(self, topic: Topic, fields: Callable[[], dict[str, Any]], stamp_ns: int) -> Output:
        return Output(topic, lambda: self._messages.make(topic.type_name, fields()), stamp_ns)
