"""The lookout in its thread: what it starts with, and that a look gives up which clicks overtake."""

from __future__ import annotations

import queue
import threading
import time
from collections.abc import Sequence

import numpy as np
import pytest
from support.breathing_lasso import pair
from support.lasso_inputs import PERIOD_NS, lasso_pair
from support.proposed_ring import ring

from lasso_motion_ros.config.stream import StreamConfig
from lasso_motion_ros.geometry.frames import FramePair
from lasso_motion_ros.initialisation.proposal import Proposal
from lasso_motion_ros.initialisation.ring_finder import PAIRS, Look
from lasso_motion_ros.nodes.automatic_initialisation import AutomaticInitialisation
from lasso_motion_ros.stream.ring_need import LONG_NS
from lasso_motion_ros.tracking.tracker import TrackerState

PATIENCE_S = 120.0  # a look may take long on a busy machine


def test_a_look_that_clicks_overtake_gives_up() -> None:
    asked, proposed = list[float](), list[Proposal]()

    def state() -> TrackerState:
        if threading.current_thread().name == "lookout":
            asked.append(time.monotonic())
        return TrackerState.WAITING_FOR_SEED

    automatic = AutomaticInitialisation(
        StreamConfig(polarity="dark"), state, proposed.extend, proposed.extend, lambda _: None
    )
    try:
        for index in range(PAIRS):
            automatic.add(pair(index))
        until = time.monotonic() + PATIENCE_S
        while len(asked) < 5 and time.monotonic() < until:
            time.sleep(0.01)
        automatic.overtake()
        before = len(asked)
        time.sleep(max(1.0, 2.0 * max(np.diff(asked))))  # in which it would ask again
        assert len(asked) <= before + 1
        assert not proposed
    finally:
        automatic.stop(PATIENCE_S)


def test_a_ring_that_was_passed_over_is_not_started_with_unasked(monkeypatch: pytest.MonkeyPatch) -> None:
    one, other = ring(0.0), ring(0.03)
    looks = iter([[one, other], [one], [other]])
    monkeypatch.setattr("lasso_motion_ros.stream.automatic_start.find_rings", lambda *_, **__: Look(next(looks), []))
    proposed, started = queue.Queue[list[Proposal]](), queue.Queue[Proposal]()
    config = StreamConfig(automatic_initialisation="start")
    waiting = TrackerState.WAITING_FOR_SEED
    automatic = AutomaticInitialisation(config, lambda: waiting, proposed.put, started.put, lambda _: None)

    def look(number: int) -> list[Proposal]:
        for index in range(PAIRS):
            automatic.add(pair(PAIRS * number + index))
        return proposed.get(timeout=PATIENCE_S)

    try:
        assert look(0) == [one, other]
        assert automatic.pass_over() is other
        assert proposed.get(timeout=PATIENCE_S) == [other, one]
        assert look(1) == [one]
        assert look(2) == [other]
        assert started.get(timeout=PATIENCE_S) is other
    finally:
        automatic.stop(PATIENCE_S)


@pytest.mark.parametrize("lost", [TrackerState.LOST, TrackerState.DISPLACED])
def test_where_a_model_has_lost_its_ring_for_long_one_is_proposed_never_started_with_and_withdrawn_with_the_next_pose(
    monkeypatch: pytest.MonkeyPatch, lost: TrackerState
) -> None:
    looks = queue.Queue[int]()

    def found(pairs: Sequence[FramePair], *_: object, **__: object) -> Look:
        looks.put(pairs[0].stamp_ns // PERIOD_NS)
        return Look([ring(0.0)], [])

    monkeypatch.setattr("lasso_motion_ros.stream.automatic_start.find_rings", found)
    proposed, started = queue.Queue[list[Proposal]](), list[Proposal]()
    config, state = StreamConfig(automatic_initialisation="start"), lost
    automatic = AutomaticInitialisation(config, lambda: state, proposed.put, started.append, lambda _: None)
    long = LONG_NS // PERIOD_NS + 1  # pairs
    try:
        for index in range(long + PAIRS):
            automatic.add(lasso_pair(index, None))
        assert looks.get(timeout=PATIENCE_S) == long
        assert len(proposed.get(timeout=PATIENCE_S)) == 1
        state = TrackerState.TRACKING
        automatic.add(lasso_pair(long + PAIRS, None))
        assert proposed.get(timeout=PATIENCE_S) == []
        state = lost
        for index in range(long + PAIRS + 1, 2 * long):
            automatic.add(lasso_pair(index, None))
    finally:
        automatic.stop(PATIENCE_S)
    assert not started
    assert looks.empty()
