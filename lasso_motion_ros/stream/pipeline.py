"""Messages in, tracker, messages out: what the node and the offline command share.

The intake takes messages, which is cheap, and gives back the tasks that are due; the session runs the tracker on them,
in that order. Nothing here looks at a clock: the same messages give the same poses.
"""

from __future__ import annotations

from lasso_motion_ros.config.stream import StreamConfig
from lasso_motion_ros.geometry.frames import PLANES
from lasso_motion_ros.stream.intake import MessageIntake
from lasso_motion_ros.stream.outputs import Output, PipelineStatistics, SeedCounts
from lasso_motion_ros.stream.problem_log import ProblemLog
from lasso_motion_ros.stream.session import SEED_PROBLEMS, TrackingSession
from lasso_motion_ros.stream.tracker_factory import create_tracker
from lasso_motion_ros.tracking.tracker import Tracker, TrackerState
from msg_adapters.calibrations import Extrinsics
from msg_adapters.topics import seed_topic


class TrackingPipeline:
    """From messages to messages: intake, session and problem log, each with a lock of its own.

    The intake may be used from one thread and the session from another.

    Args:
        config: parameters of tracker and stream.
        tracker: the method; by default the one that `config` names.
        extrinsics: where the pose of a plain camera matrix comes from; without it such calibrations are refused.

    Attributes:
        intake: takes messages, gives tasks.
        session: takes tasks, gives messages.
        problems: what was wrong with what came in.
    """

    def __init__(
        self,
        config: StreamConfig,
        tracker: Tracker | None = None,
        extrinsics: Extrinsics | None = None,
    ) -> None:
        self.problems = ProblemLog()
        self.intake = MessageIntake(config, self.problems, extrinsics)
        self.session = TrackingSession(
            config,
            create_tracker(config) if tracker is None else tracker,
            phases=self.intake.phases,
            promised=self.intake.promised,
            problems=self.problems,
        )

    def pending_outputs(self) -> list[Output]:
        """State changes that no pair brings: the calibration of both planes has come."""
        if self.session.state is TrackerState.WAITING_FOR_CALIBRATION and len(self.intake.calibrated) == len(PLANES):
            return self.session.calibrated()
        return []

    def reset(self) -> list[Output]:
        """Forget model, motion and clicks: WAITING_FOR_SEED. Returns what is to be published."""
        return self.session.reset(self.intake.forget_clicks())

    def statistics(self) -> PipelineStatistics:
        """Counts since the start; never waits for the tracker."""
        session, intake = self.session, self.intake
        result = session.last_result
        refused, refusal = self.problems.of_topics((SEED_PROBLEMS, *(seed_topic(plane).name for plane in PLANES)))
        return PipelineStatistics(
            state=session.state,
            reason=self._reason(),
            pairs=session.counts.pairs,
            half_pairs=session.counts.half_pairs,
            poses=session.counts.poses,
            states=session.counts.states,
            problems=self.problems.counts,
            frames=intake.frame_counts,
            remarks=intake.remarks,
            pairing=intake.pairing_counts,
            seeds=SeedCounts(session.seeds_taken, refused, refusal),
            residual_px={} if result is None else dict(result.residual_px),
            temporal_filter={} if result is None else dict(result.temporal_filter),
            ring=None if result is None else result.ring,
            seed_gap_mm=None if result is None else result.seed_gap_mm,
            catheter=None if result is None else result.catheter,
            heartbeat=session.heartbeat.status,
            offset_ns=intake.offset_ns,
            calibrated=intake.calibrated,
            waiting_clicks=intake.waiting_clicks,
        )

    def _reason(self) -> str:
        """Why the state is what it is; while a seed is waited for, what there is of one."""
        reason, waiting = self.session.reason, self.intake.waiting_clicks
        if waiting and self.session.state is TrackerState.WAITING_FOR_SEED:
            return waiting
        if waiting and self.session.state is TrackerState.WAITING_FOR_CALIBRATION:
            return f"{reason}; {waiting}"
        return reason
