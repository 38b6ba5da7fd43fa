"""Keeps `state` true between the answers: LOST where none comes, renewed while nothing changes, told in the log."""

from __future__ import annotations

import dataclasses
import threading
import time
from collections.abc import Callable, Sequence

from lasso_motion_ros.nodes.running import ThrottledLog, kind_of
from lasso_motion_ros.nodes.state_words import state_words
from lasso_motion_ros.nodes.stream_timeout import StreamTimeout
from lasso_motion_ros.nodes.tracker_publishers import TrackerPublishers
from lasso_motion_ros.stream.outputs import Output, PipelineStatistics
from lasso_motion_ros.tracking.tracker import TrackerState
from msg_adapters.topics import MOTION_RAW

# Two looks that lie further apart were held up: images that came meanwhile still wait to be taken.
_HELD_UP_S = 0.5


class StateWatch:
    """What stands between the tracker's answers and the topic: they are published by it, and what they leave unsaid.

    It may be used from several threads, and waits for no pair that is being worked on.

    Args:
        publishers: of the node.
        complaints: the node's log.
        loss: makes what is published where the tracker is lost without an answer.

    Attributes:
        timeout: what has come, and what was answered, since the node was activated.
    """

    def __init__(
        self, publishers: TrackerPublishers, complaints: ThrottledLog, loss: Callable[[], Sequence[Output]]
    ) -> None:
        self._publishers, self._complaints, self._loss = publishers, complaints, loss
        self._lock = threading.RLock()
        self._silence = ""
        self._looked_s, self._was_held_up = 0.0, False
        self._posed_s: float | None = None
        self._alarm = ""  # the last one that the log was told of
        self._active = False
        self.timeout = StreamTimeout(0.0, time.monotonic())

    def begin(self, timeout_s: float) -> None:
        """The node was activated, with this `stream_timeout_s`."""
        with self._lock:
            self.timeout = StreamTimeout(timeout_s, time.monotonic())
            self._active, self._silence, self._posed_s = True, "", None

    def end(self) -> None:
        """The node was deactivated: nothing is expected to come."""
        with self._lock:
            self._active, self._silence = False, ""

    def answer(self, number: int, outputs: Sequence[Output]) -> None:
        """Publish the tracker's answer to the task with this number, unless the node was deactivated meanwhile."""
        with self._lock:
            if not self._active:
                return
            now_s = time.monotonic()
            self.timeout.answered(number, now_s)
            self._silence = ""
            if any(output.topic is MOTION_RAW for output in outputs):
                self._posed_s = now_s
            self._publishers.publish(outputs)

    def look(self, state: TrackerState) -> str:
        """See whether the tracker still answers; says LOST where it does not. To be called several times a second.

        Args:
            state: by the tracker's last answer.

        Returns:
            What has failed to come; empty where all is well.
        """
        with self._lock:
            now_s = time.monotonic()
            # One look only: where all of them are late, the machine is too slow to wait for.
            held_up = now_s - self._looked_s > _HELD_UP_S and not self._was_held_up
            self._looked_s, self._was_held_up = now_s, held_up
            if self._active and not held_up:
                began, silence = not self._silence, self.timeout.reason(now_s)
                if silence or not state.has_model:  # else what was said holds until a pair is answered
                    self._silence = silence
                if silence and began and state.has_model:
                    self._publishers.publish(self._loss())
            if not held_up:
                self._publishers.renew_state()
            return self._silence

    def told(self, statistics: PipelineStatistics) -> PipelineStatistics:
        """The pipeline's counts, with the state and reason that hold though the tracker has not said so."""
        with self._lock:
            silence = self._silence
        if not silence:
            return statistics
        if statistics.state.has_model:
            return dataclasses.replace(statistics, state=TrackerState.LOST, reason=silence)
        return dataclasses.replace(statistics, reason="; ".join(filter(None, (statistics.reason, silence))))

    @property
    def pose_age_s(self) -> float | None:
        """Seconds since the last pose was published (steady clock); None where none was."""
        posed_s = self._posed_s
        return None if posed_s is None else time.monotonic() - posed_s

    def log_change(self, statistics: PipelineStatistics) -> None:
        """Tell the log of a loss, and of its end; throttled.

        Args:
            statistics: as `told`, after a change of the state, or of what fails to come.
        """
        state = statistics.state
        words = state_words(state, statistics.reason, self.pose_age_s)
        with self._lock:
            before, self._alarm = self._alarm, kind_of(words) if state.is_alarm else ""
            if before == self._alarm:
                return
        if state.is_alarm:
            self._complaints.complain("state", words, kind=kind_of(words))
        elif state.has_pose:
            self._complaints.inform("state", f"{state.value} again", kind="again")
