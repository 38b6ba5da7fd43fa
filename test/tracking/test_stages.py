"""Stages: both trackers tell of theirs to whoever listens, and answer the same whether anybody does."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from typing import get_args

import numpy as np
import pytest
from support.suite_inputs import small

from lasso_motion_ros.config.tracker import TrackerConfig
from lasso_motion_ros.stream.tracker_factory import create_tracker
from lasso_motion_ros.tracking.stages import Stage, no_stages
from lasso_motion_ros.tracking.tracker import Tracker, TrackResult

PUBLISHED = {"features", "registration"}


def results(tracker: Tracker) -> list[TrackResult]:
    sequence = small()
    first = tracker.initialise(sequence.pairs[0], sequence.seed)
    return [first, *(tracker.track(pair) for pair in sequence.pairs[1:])]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("method", "expected"),
    [
        ("appearance", set(get_args(Stage)) - PUBLISHED),
        ("brost2009", PUBLISHED),
    ],
)
def test_a_tracker_tells_of_its_stages_and_answers_the_same(method: str, expected: set[str]) -> None:
    begun: Counter[str] = Counter()
    running: list[str] = []

    @contextmanager
    def listen(stage: Stage, /) -> Iterator[None]:
        begun[stage] += 1
        running.append(stage)
        yield
        assert running.pop() == stage

    config = TrackerConfig(method=method)
    told = results(create_tracker(config, listen))
    assert set(begun) == expected
    assert min(begun.values()) >= 2  # each of the two pairs that were tracked
    assert running == []
    for one, other in zip(told, results(create_tracker(config)), strict=True):
        assert (one.state, one.reason) == (other.state, other.reason)
        np.testing.assert_array_equal(one.motion, other.motion)
        np.testing.assert_array_equal(one.loop, other.loop)


def test_where_nobody_listens_a_stage_may_lie_within_itself() -> None:
    with no_stages("filter"), no_stages("filter"):
        pass
