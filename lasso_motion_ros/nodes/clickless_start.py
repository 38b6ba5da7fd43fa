"""Starting without clicks: the ring that is found is proposed, accepted or started with, unless clicks come first."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial

from rclpy.node import Node
from std_srvs.srv import Trigger

from lasso_motion_ros.config.stream import StreamConfig
from lasso_motion_ros.core.errors import TrackingError
from lasso_motion_ros.geometry.frames import FramePair
from lasso_motion_ros.initialisation.ring_finder import Proposal
from lasso_motion_ros.nodes.automatic_initialisation import AutomaticInitialisation
from lasso_motion_ros.nodes.service_answer import answered
from msg_adapters.messages import NANOSECONDS


class ClicklessStart:
    """What a node does with the rings that are found while it is active.

    `~/accept` starts with the one that is proposed first, `~/next` passes it over.

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
        self._is_wanted: Callable[[], bool] = lambda: False
        self._due: list[Proposal] = []  # to start with, unasked
        for name, action in (("~/accept", self._accept), ("~/next", self._pass_over)):
            node.create_service(Trigger, name, partial(_answer, action))

    @property
    def is_due(self) -> bool:
        """Whether there is a ring to start with unasked."""
        return bool(self._due)

    def begin(self, config: StreamConfig, is_wanted: Callable[[], bool]) -> None:
        """Look from now on.

        Args:
            config: the parameters.
            is_wanted: whether a ring is waited for.
        """
        self._is_wanted = is_wanted
        self._automatic = AutomaticInitialisation(
            config, is_wanted, self._on_proposals, self._due.append, self._on_error
        )

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
        """Start with the ring that is due, unless clicks have come meanwhile; while no pair is being answered."""
        ring = self._due.pop()
        self._due.clear()
        if self._is_wanted():
            self._start_with(ring)

    def _looking(self) -> AutomaticInitialisation:
        if self._automatic is None:
            raise TrackingError("the node is not active")
        return self._automatic

    def _pass_over(self) -> str:
        ring = self._looking().pass_over()
        return f"the ring of {ring.pair.stamp_ns / NANOSECONDS:.3f} s is proposed first: {ring.text}"

    def _accept(self) -> str:
        ring = self._looking().accepted()
        self._start_with(ring)
        return f"the ring of {ring.pair.stamp_ns / NANOSECONDS:.3f} s is taken: {ring.text}"


def _answer(action: Callable[[], str], _: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
    return answered(response, action)
