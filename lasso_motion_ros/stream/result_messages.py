"""The messages that a result is published as, in the order in which consumers need them."""

from __future__ import annotations

from functools import partial

from lasso_motion_ros.stream.heartbeat_separation import PublishedMotion
from lasso_motion_ros.stream.outputs import Output
from lasso_motion_ros.tracking.tracker import TrackerState, TrackResult
from msg_adapters.markers import encode_delete, encode_line_strip
from msg_adapters.messages import header_fields
from msg_adapters.poses import encode_pose_stamped, encode_pose_with_covariance_stamped
from msg_adapters.topics import CATHETER, MOTION, MOTION_RAW, MOTION_WITH_COVARIANCE, REFERENCE, STATE

_CATHETER_NAMESPACE = "catheter"


class ResultMessages:
    """Makes the published messages, and remembers what consumers know: the reference, and whether a loop is shown.

    Args:
        world_frame: frame of poses and loop.
    """

    def __init__(self, world_frame: str) -> None:
        self._world_frame = world_frame
        self._shown = False
        self.reference_ns: int | None = None

    def of_state(self, state: TrackerState, stamp_ns: int) -> Output:
        """The state alone, at a pair's stamp; 0 where no pair brought it."""
        return Output(STATE, lambda: {"data": state.value}, stamp_ns)

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
            outputs.append(Output(REFERENCE, lambda: reference, stamp))
        outputs.append(self.of_state(result.state, stamp))
        if published is not None:
            outputs.append(Output(MOTION, partial(encode_pose_stamped, published.motion, header), stamp))
        if result.state.has_pose and result.motion is not None:
            outputs.append(Output(MOTION_RAW, partial(encode_pose_stamped, result.motion, header), stamp))
        if published is not None and published.covariance is not None:
            fields = partial(encode_pose_with_covariance_stamped, published.motion, published.covariance, header)
            outputs.append(Output(MOTION_WITH_COVARIANCE, fields, stamp))
        if result.loop is not None:
            fields = partial(encode_line_strip, result.loop, header, _CATHETER_NAMESPACE)
            outputs.append(Output(CATHETER, fields, stamp))
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
        return Output(CATHETER, partial(encode_delete, header, _CATHETER_NAMESPACE), stamp_ns)
