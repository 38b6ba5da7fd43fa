"""What the tracker node tells of itself and of its stream: on /diagnostics, and in its log."""

from __future__ import annotations

import time
from collections.abc import Callable

from lasso_motion_ros.config.stream import StreamConfig
from lasso_motion_ros.geometry.frames import PLANES
from lasso_motion_ros.nodes.answering import Answering
from lasso_motion_ros.nodes.configured_node import ConfiguredNode
from lasso_motion_ros.nodes.diagnostics import heartbeat_status, plane_status, tracker_status
from lasso_motion_ros.nodes.running import guarded, kind_of
from lasso_motion_ros.nodes.state_watch import StateWatch
from lasso_motion_ros.nodes.tracker_inputs import TrackerInputs
from lasso_motion_ros.nodes.tracker_publishers import TrackerPublishers
from lasso_motion_ros.nodes.watch import StreamWatch
from lasso_motion_ros.stream.outputs import PipelineStatistics
from lasso_motion_ros.tracking.tracker import TrackerState
from msg_adapters.topics import DIAGNOSTICS, camera_info_topic, image_topic

_STREAM_COMPLAINT_S = 30.0  # between two complaints about a stream as a whole

_IMAGE_INPUTS = {make(plane).name for plane in PLANES for make in (image_topic, camera_info_topic)}


class TrackerReport:
    """Puts together what is known of the node; may be asked from its callbacks and from the tracker's thread.

    Args:
        node: of which it tells, and whose log it writes.
        answering: its pipeline, and how it keeps up.
        state_watch: the state as published.
        publishers: of the node.
        config: gives the parameters as they are now.

    Attributes:
        complaints: the node's log.
        inputs: what the node listens to; None while it is not active.
        watch: what has come since it was activated.
        silence: what has failed to come, by the last look; empty where all is well.
    """

    def __init__(
        self,
        node: ConfiguredNode[StreamConfig],
        answering: Answering,
        state_watch: StateWatch,
        publishers: TrackerPublishers,
        config: Callable[[], StreamConfig],
    ) -> None:
        self._node, self._answering, self._state_watch = node, answering, state_watch
        self._publishers, self._config = publishers, config
        self.complaints = node.complaints
        self.inputs: TrackerInputs | None = None
        self.watch = StreamWatch(time.monotonic())
        self.silence = ""

    def begin(self) -> None:
        """The node is being activated."""
        self.watch = StreamWatch(time.monotonic())

    def told(self) -> PipelineStatistics:
        """The pipeline's counts, with the state as published.

        Raises:
            TrackingError: the node is not active.
        """
        return self._state_watch.told(self._answering.active().statistics())

    def look(self) -> None:
        """See whether images still come and are answered, and tell where that has changed."""
        pipeline = self._answering.pipeline if self._answering.is_active else None
        state = TrackerState.INACTIVE if pipeline is None else pipeline.session.state
        before, self.silence = self.silence, self._state_watch.look(state)
        if kind_of(before) != kind_of(self.silence):
            self.tell_change()

    def tell_change(self) -> None:
        """The state is another one, or what fails to come."""
        if self._answering.is_active:
            self._state_watch.log_change(self.told())
        self.publish()

    def complain(self) -> None:
        """Write into the log what the pipeline has found wrong with its input."""
        pipeline = self._answering.pipeline
        if pipeline is None:
            return
        for problem in pipeline.problems.take():
            self.complaints.complain(problem.topic or "stream", problem.text, kind=kind_of(problem.text))
            if problem.topic in _IMAGE_INPUTS:
                self._state_watch.timeout.add_problem(f"{problem.topic}: {problem.text}")
        for remark in pipeline.problems.take_remarks():
            self.complaints.inform(remark.topic, remark.text)

    def complain_of_stream(self) -> None:
        """Write into the log what is wrong with the stream as a whole."""
        pipeline = self._answering.pipeline
        if self.inputs is None or pipeline is None or not self._answering.is_active:
            return
        statistics = pipeline.statistics()
        complaints = self.watch.complaints(
            time.monotonic(),
            self.inputs.offers(),
            statistics.calibrated,
            statistics.pairing["a"].paired,
            statistics.waiting_clicks,
            self._answering.dropped,
        )
        for subject, text in complaints:
            self.complaints.complain(subject, text, kind=kind_of(text), period_s=_STREAM_COMPLAINT_S)

    @guarded
    def publish(self) -> None:
        """Publish on /diagnostics what holds now."""
        name, inputs = self._node.get_fully_qualified_name(), self.inputs
        if inputs is None or not self._answering.is_active:
            statuses = [tracker_status(name, TrackerState.INACTIVE)]
        else:
            statistics, dropped = self.told(), self._answering.dropped
            age_s, posture = self._state_watch.pose_age_s, self._config().posture
            latencies = self._answering.latencies.words()
            statuses = [tracker_status(name, statistics.state, statistics, dropped, latencies, age_s, posture)]
            statuses += [plane_status(name, plane, statistics, inputs.reliable(plane), self.watch) for plane in PLANES]
            statuses += heartbeat_status(name, statistics)
        fields = {"header": {"stamp": self._node.get_clock().now().to_msg()}, "status": statuses}
        self._publishers.publish_fields(DIAGNOSTICS, fields)
