"""Starting without clicks: the ring that is found is proposed, accepted or started with, unless clicks come first."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial

from rclpy.node import Node
from std_srvs.srv import Trigger

from lasso_motion_ros.config.stream import StreamConfig
from lasso_motion_ros.core.errors import TrackingError
from lasso_motion_ros.geometry.frames import FramePair
from lasso_motion_ros.initialisation.proposal import Proposal
from lasso_motion_ros.nodes.automatic_initialisation import AutomaticInitialisation
from lasso_motion_ros.nodes.service_answer import answered
from lasso_motion_ros.tracking.tracker import TrackerState
from msg_adapters.messages import NANOSECONDS


class ClicklessStart:
    """What a node does with the rings that are found while it is active.

    `~/accept` starts with the one that is proposed first, `~/next` passes it over. Where there is a model that has lost
    its ring, that is a new beginning, with a reference of its own: it is asked for, whatever the mode.

    Args:
        node: serves `~/accept` and `~/next`.
        on_proposals: called in the lookout's thread, or the service's, with what is proposed from now on.
        start_with: has the tracker begin with a ring, or raises LassoMotionError.
        on_error: takes what a look raised.
    """

    def __init__(
        self,
        node: Node,
        on_proposals: Callable[[Sequence[Proposal]], None],
        start_with: Callable[[Proposal], None],
        on_error: Callable[[Exception], None],
    ) -> None:
        self._on_proposals, self._start_with, self._on_error = on_proposals, start_with, on_error
        self._automatic: AutomaticInitialisation | None = None
        self._state: Callable[[], TrackerState] = lambda: TrackerState.INACTIVE
        self._due: list[Proposal] = []  # to start with, unasked
        for name, action in (("~/accept", self._accept), ("~/next", self._pass_over)):
            node.create_service(Trigger, name, partial(_answer, action))

    @property
    def is_due(self) -> bool:
        """Whether there is a ring to start with unasked."""
        return bool(self._due)

    def begin(self, config: StreamConfig, state: Callable[[], TrackerState]) -> None:
        """Look from now on.

        Args:
            config: the parameters.
            state: gives the state that the last pair was answered with.
        """
        self._state = state
        self._automatic = AutomaticInitialisation(config, state, self._on_proposals, self._due.append, self._on_error)

    def end(self, patience_s: float) -> None:
        """Stop looking, and forget what was found."""
        if self._automatic is not None:
            self._automatic.stop(patience_s)
            self._automatic = None
            self._due.clear()

    def reconfigure(self, config: StreamConfig) -> None:
        """Go on with other parameters."""
        if self._automatic is not None:
            self._automatic.reconfigure(config)

    def add(self, pair: FramePair) -> None:
        """Take a pair that was answered; never waits."""
        if (automatic := self._automatic) is not None:  # which may end meanwhile
            automatic.add(pair)

    def overtake(self) -> None:
        """Clicks have come: give up what is being looked at; never waits."""
        if self._automatic is not None:
            self._automatic.overtake()

    def reset(self) -> None:
        """Give that up, and what was found with it."""
        self._due.clear()
        self.overtake()

    def start_unasked(self) -> None:
        """Start with the ring that is due, unless there is a model meanwhile; while no pair is being answered."""
        ring = self._due.pop()
        self._due.clear()
        if self._state() is TrackerState.WAITING_FOR_SEED:
            self._start_with(ring)

    def _looking(self) -> AutomaticInitialisation:
        if self._automatic is None:
            raise TrackingError("the node is not active")
        return self._automatic

    def _pass_over(self) -> str:
        ring = self._looking().pass_over()
        return f"the ring of {ring.pair.stamp_ns / NANOSECONDS:.3f} s is proposed first: {ring.text}"

    def _accept(self) -> str:
        ring, had_model = self._looking().accepted(), self._state().has_model
        self._start_with(ring)
        anew = ", and its pair is the new reference: a volume is to be registered there" if had_model else ""
        return f"the ring of {ring.pair.stamp_ns / NANOSECONDS:.3f} s is taken{anew}: {ring.text}"


def _answer(action: Callable[[], str], _: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
    return answered(response, action)
