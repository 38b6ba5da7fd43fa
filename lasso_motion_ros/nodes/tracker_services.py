"""The tracker node's services: freeze, initialize, reset, set_reference."""

from __future__ import annotations

import threading
from collections.abc import Callable, Sequence

from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.node import Node
from rclpy.task import Future
from std_srvs.srv import SetBool, Trigger

from lasso_motion_ros.core.errors import LassoMotionError
from lasso_motion_ros.nodes.clicking import ClickBoard
from lasso_motion_ros.nodes.service_answer import answered
from lasso_motion_ros.stream.pair_task import PairTask
from lasso_motion_ros.stream.pipeline import TrackingPipeline
from msg_adapters.messages import NANOSECONDS

RESET_MEANWHILE = "reset meanwhile"


class TrackerServices:
    """Answers each call with success and what was done, or with the reason why not.

    Args:
        node: the node.
        active: gives the pipeline, or raises LassoMotionError while the node is not active.
        enqueue: has tasks worked on.
        reset: forgets the model.
        set_reference: makes the present phase the reference.
        show: has the pictures drawn anew.
    """

    def __init__(
        self,
        node: Node,
        active: Callable[[], TrackingPipeline],
        enqueue: Callable[[Sequence[PairTask]], None],
        reset: Callable[[], None],
        set_reference: Callable[[], None],
        show: Callable[[], None],
    ) -> None:
        self.board = ClickBoard()
        self._node = node
        self._active, self._enqueue, self._show = active, enqueue, show
        self._reset, self._set_reference = reset, set_reference
        self._lock = threading.Lock()
        self._awaited: tuple[int, Future] | None = None
        node.create_service(Trigger, "~/reset", self._on_reset)
        node.create_service(Trigger, "~/set_reference", self._on_set_reference)
        node.create_service(SetBool, "~/freeze", self._on_freeze)
        # It is answered once the model stands, and must not block incoming images until then.
        node.create_service(Trigger, "~/initialize", self._on_initialize, callback_group=ReentrantCallbackGroup())

    def seeded(self, task: PairTask, refusal: str) -> None:
        """Tell the caller of `~/initialize` what became of the clicks; called by the worker after each pair."""
        with self._lock:
            awaited = self._awaited
            if awaited is None or task.number < awaited[0]:
                return
            self._awaited = None
        if not refusal:
            self.board.freeze(None)
            self._release()
        self._finish(awaited[1], refusal)

    def give_up(self, reason: str) -> None:
        """Answer whoever waits for a model, and show the stream again."""
        self.board.freeze(None)
        self._disappoint(reason)

    def _disappoint(self, reason: str) -> None:
        with self._lock:
            awaited, self._awaited = self._awaited, None
        if awaited is not None:
            self._finish(awaited[1], reason)

    def _finish(self, future: Future, refusal: str) -> None:
        future.set_result(refusal)
        if self._node.executor is not None:
            self._node.executor.wake()

    def _release(self) -> None:
        try:
            self._active().intake.release()
        except LassoMotionError:
            return  # no longer active: there is nothing to release

    def _on_reset(self, _: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        def reset() -> str:
            self._reset()
            self._disappoint(RESET_MEANWHILE)
            return "the model is forgotten: new clicks are needed"

        return answered(response, reset)

    def _on_set_reference(self, _: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        def set_reference() -> str:
            self._set_reference()
            return "the present phase is the reference"

        return answered(response, set_reference)

    def _on_freeze(self, request: SetBool.Request, response: SetBool.Response) -> SetBool.Response:
        def freeze() -> str:
            pipeline = self._active()
            if not request.data:
                pipeline.intake.release()
            pair = pipeline.intake.freeze() if request.data else None
            self.board.freeze(pair)
            self._show()
            if pair is None:
                return "no pair is held"
            return f"the pair of {pair.stamp_ns / NANOSECONDS:.3f} s is held: click in both planes"

        return answered(response, freeze)

    async def _on_initialize(self, _: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        try:
            pipeline, seed = self._active(), self.board.seed()
            future = Future(executor=self._node.executor)
            with self._lock:
                if self._awaited is not None:
                    raise LassoMotionError("the clicks before these are still being worked on")
                task = pipeline.intake.seed_frozen(seed)
                self._awaited = (task.number, future)
            self._enqueue([task])
            refusal = await future
        except LassoMotionError as error:
            refusal = str(error)
        response.success, response.message = not refusal, refusal or "the model stands"
        return response
