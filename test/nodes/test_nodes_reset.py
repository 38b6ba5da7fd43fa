"""A reset while the tracker works, a tracker that fails, and one that rests: what is done, and in which order."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

pytest.importorskip("rclpy", reason="needs ROS 2")

import rclpy
from std_srvs.srv import Trigger
from support.message_inputs import stamp

from lasso_motion_ros.geometry.frames import FramePair, Seed
from lasso_motion_ros.nodes.tracker_node import TrackerNode
from lasso_motion_ros.nodes.tracker_services import RESET_MEANWHILE, TrackerServices
from lasso_motion_ros.stream.outputs import Output
from lasso_motion_ros.stream.pair_task import PairTask
from lasso_motion_ros.tools.processes import free_domain
from lasso_motion_ros.tracking.tracker import TrackerState
from msg_adapters.topics import STATE

pytestmark = pytest.mark.ros

TASK = PairTask(FramePair(stamp(0), None, None), number=1)


ANSWER, FORGOTTEN = Output(STATE, lambda: "TRACKING", 0), Output(STATE, lambda: "WAITING_FOR_SEED", 0)
LOSS = Output(STATE, lambda: "LOST", 0)


class FakePipeline:
    """Answers with words; fails when told."""

    last_refusal = ""
    last_pair = None
    last_result = None
    offset_ns = 0
    waiting_a: Any = None
    failure: Exception | None = None
    released = False

    def __init__(self) -> None:
        self.intake = self.session = self.problems = self
        self.prepared: list[Any] = []

    def prepare(self, frame: Any) -> None:
        self.prepared.append(frame)

    def answers(self, task: PairTask, in_hurry: Callable[[], bool]) -> Iterator[list[Output]]:
        if self.failure is not None:
            raise self.failure
        yield [ANSWER]

    def reset(self) -> list[Output]:
        return [FORGOTTEN]

    def loss_outputs(self) -> list[Output]:
        return [LOSS]

    def release(self) -> None:
        self.released = True

    def seed_frozen(self, seed: Seed) -> PairTask:
        return TASK

    def take(self) -> list[Any]:
        return []

    def take_remarks(self) -> list[Any]:
        return []


def worker(**other: Any) -> SimpleNamespace:
    """One that does nothing."""
    return SimpleNamespace(clear=lambda: None, stop=lambda _: True, **({"waiting": 0, "is_stopping": False} | other))


@pytest.fixture
def node() -> Iterator[TrackerNode]:
    rclpy.init(args=[], domain_id=free_domain())
    made = TrackerNode()
    made._answering.pipeline = FakePipeline()
    made._answering._worker = worker()
    made._state_watch.begin(0.5)
    yield made
    made.close()
    made.destroy_node()
    rclpy.shutdown()


def test_no_older_answer_is_published_after_a_reset(node: TrackerNode, monkeypatch: pytest.MonkeyPatch) -> None:
    published: list[Output] = []
    publishing, was_reset = threading.Event(), threading.Event()

    def publish(outputs: list[Output]) -> None:
        if outputs == [ANSWER]:
            publishing.set()
            was_reset.wait(0.3)
        published.extend(outputs)
        if outputs != [ANSWER]:
            was_reset.set()

    with monkeypatch.context() as patched:
        patched.setattr(node._tracker_publishers, "publish", publish)
        worker = threading.Thread(target=node._answering._track, args=(TASK,))
        worker.start()
        assert publishing.wait(5.0)
        node._reset()
        worker.join()
    assert published == [ANSWER, FORGOTTEN]


def test_a_tracker_that_fails_on_clicks_has_them_refused(node: TrackerNode, monkeypatch: pytest.MonkeyPatch) -> None:
    answers: list[str] = []
    monkeypatch.setattr(node._tracker_services, "seeded", lambda ready, refusal: answers.append(refusal))
    node._answering.pipeline.failure = RuntimeError("unforeseen")
    with pytest.raises(RuntimeError):
        node._answering._track(TASK)
    assert answers == ["the tracker failed on these clicks; its log says why"]


def test_a_tracker_that_fails_on_every_pair_is_lost(node: TrackerNode, monkeypatch: pytest.MonkeyPatch) -> None:
    said: list[Output] = []
    monkeypatch.setattr(node._tracker_publishers, "publish", said.extend)
    node._answering.pipeline.failure = IndexError("unforeseen")
    node._state_watch.timeout.asked(TASK.number, time.monotonic() - 2.0)
    with pytest.raises(IndexError):
        node._answering._track(TASK)
    node._state_watch.look(TrackerState.TRACKING)
    assert "the tracker has not answered for 2." in node._state_watch.look(TrackerState.TRACKING)
    assert said == [LOSS]


def test_a_thread_that_was_left_behind_says_nothing_more(node: TrackerNode, monkeypatch: pytest.MonkeyPatch) -> None:
    said: list[Any] = []
    monkeypatch.setattr(node._tracker_services, "seeded", lambda *answer: said.append(answer))
    monkeypatch.setattr(node._tracker_publishers, "publish", said.append)
    monkeypatch.setattr(node._tracker_publishers, "show_standard", said.append)

    def answers(task: PairTask, in_hurry: Callable[[], bool]) -> Iterator[list[Output]]:
        node._answering._worker = worker()  # deactivated, activated
        yield [ANSWER]

    node._answering.pipeline.answers = answers
    node._answering._track(TASK)
    assert said == []


@pytest.mark.parametrize(("is_stopping", "worked_out"), [(False, 3), (True, 1)])
def test_pairs_are_not_answered_again_for_a_node_that_stops(
    node: TrackerNode, is_stopping: bool, worked_out: int
) -> None:
    count = 0

    def answers(task: PairTask, in_hurry: Callable[[], bool]) -> Iterator[list[Output]]:
        nonlocal count
        for _ in range(3):
            count += 1
            yield []

    node._answering._worker, node._answering.pipeline.answers = worker(is_stopping=is_stopping), answers
    node._answering._track(TASK)
    assert count == worked_out


def test_nothing_is_answered_once_the_node_is_deactivated(node: TrackerNode, monkeypatch: pytest.MonkeyPatch) -> None:
    said: list[Any] = []
    monkeypatch.setattr(node._tracker_publishers, "publish", said.append)
    node._state_watch.end()
    node._state_watch.answer(1, [ANSWER])
    assert said == []


def test_a_state_is_not_renewed_by_a_look_that_was_held_up(node: TrackerNode, monkeypatch: pytest.MonkeyPatch) -> None:
    renewed: list[bool] = []
    monkeypatch.setattr(node._tracker_publishers, "renew_state", lambda: renewed.append(True))
    monkeypatch.setattr(node._state_watch, "_looked_s", time.monotonic() - 3.0)
    node._state_watch.look(TrackerState.WAITING_FOR_SEED)
    assert renewed == []
    node._state_watch.look(TrackerState.WAITING_FOR_SEED)
    assert renewed == [True]


def test_no_pair_is_held_beyond_deactivation(node: TrackerNode) -> None:
    pipeline = node._answering.pipeline
    node._deactivate()
    assert pipeline.released


def test_a_reset_answers_who_waits_for_a_model() -> None:
    stub = SimpleNamespace(create_service=lambda *_, **__: None, executor=None)
    pipeline = FakePipeline()
    calls = TrackerServices(stub, lambda: pipeline, lambda _: None, lambda: None, lambda: None, lambda: None)
    calls.board.seed = lambda: Seed(np.zeros((6, 2)), np.zeros((6, 2)))
    waiting = calls._on_initialize(Trigger.Request(), Trigger.Response())
    waiting.send(None)
    assert calls._on_reset(Trigger.Request(), Trigger.Response()).success
    calls.seeded(PairTask(TASK.pair, number=2), "")  # the next pair, on which no model stands
    with pytest.raises(StopIteration) as ended:
        waiting.send(None)
    answer = ended.value.value
    assert (answer.success, answer.message) == (False, RESET_MEANWHILE)


@pytest.mark.parametrize(("late_ms", "is_worked_on"), [(33, True), (4, False)])
def test_plane_a_is_worked_on_once_while_a_plane_b_that_is_not_right_behind_is_to_come(
    node: TrackerNode, late_ms: int, is_worked_on: bool
) -> None:
    roused: list[int] = []
    node._answering._worker = worker(rouse=lambda: roused.append(1))
    pipeline, frame = node._answering.pipeline, object()
    node._enqueue([])
    pipeline.offset_ns, pipeline.waiting_a = late_ms * 1_000_000, frame
    for _ in range(2):
        node._enqueue([])
        node._answering._use_rest()
    assert (len(roused), pipeline.prepared) == ((1, [frame]) if is_worked_on else (0, []))
