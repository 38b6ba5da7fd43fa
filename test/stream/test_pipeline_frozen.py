"""Clicks on a pair that is held, and parameters that change on the way."""

from __future__ import annotations

import numpy as np
import pytest
from support.message_inputs import FakeTracker, image, seed, stamp, stream
from support.pipeline_inputs import message

from lasso_motion_ros.config.parameters import configuration_from_values
from lasso_motion_ros.config.stream import StreamConfig
from lasso_motion_ros.core.errors import TrackingError
from lasso_motion_ros.geometry.frames import Seed
from lasso_motion_ros.stream.pipeline import TrackingPipeline
from msg_adapters.messages import stamp_to_ns

SEED = Seed(np.zeros((6, 2)), np.zeros((6, 2)))


def pipeline(tracker: FakeTracker) -> TrackingPipeline:
    config = configuration_from_values(StreamConfig, {"seed_buffer_pairs": 3})
    return TrackingPipeline(config, tracker)


def feed(line: TrackingPipeline, start: int, pairs: int) -> None:
    for topic, _, given, _ in stream(pairs, seeded=None, start=start):
        plane = topic[7]
        add = line.intake.add_image if "image" in topic else line.intake.add_camera_info
        for task in add(plane, given):
            line.session.process(task)


def test_a_pair_that_the_buffer_has_lost_is_seeded_while_it_is_held() -> None:
    tracker = FakeTracker()
    line = pipeline(tracker)
    feed(line, 0, 2)
    assert line.intake.freeze().stamp_ns == stamp(1)
    feed(line, 2, 6)
    ready = line.intake.seed_frozen(SEED)
    assert ready.pair.stamp_ns == stamp(1)
    assert [pair.stamp_ns for pair in ready.later] == [stamp(5), stamp(6), stamp(7)]
    motions = [stamp_to_ns(message(o).header.stamp) for o in line.session.process(ready) if o.topic.name == "motion"]
    assert motions == [stamp(1), stamp(5), stamp(6), stamp(7)]
    assert line.session.last_refusal == ""


def test_one_that_the_buffer_still_has_is_not_gone_through_twice() -> None:
    line = pipeline(FakeTracker())
    feed(line, 0, 3)
    line.intake.freeze()
    feed(line, 3, 1)
    ready = line.intake.seed_frozen(SEED)
    assert (ready.pair.stamp_ns, [pair.stamp_ns for pair in ready.later]) == (stamp(2), [stamp(3)])


def test_seed_messages_on_the_held_pair_are_taken_too() -> None:
    line = pipeline(FakeTracker())
    feed(line, 0, 1)
    line.intake.freeze()
    feed(line, 1, 5)
    assert line.intake.add_seed("a", seed(stamp(0))) == []
    (ready,) = line.intake.add_seed("b", seed(stamp(0)))
    assert ready.pair.stamp_ns == stamp(0)
    line.intake.release()
    line.intake.add_seed("a", seed(stamp(0)))
    assert "is not among the last 3 pairs" in line.problems.take()[-1].text


def test_without_a_whole_pair_nothing_is_held_and_a_refusal_is_kept() -> None:
    tracker = FakeTracker(refuse=True)
    line = pipeline(tracker)
    for act in (line.intake.freeze, lambda: line.intake.seed_frozen(SEED)):
        with pytest.raises(TrackingError):
            act()
    feed(line, 0, 1)
    line.intake.freeze()
    ready = line.intake.seed_frozen(SEED)
    assert line.session.process(ready) == []
    assert line.session.last_refusal == "no loop here"


def test_tuning_reaches_the_tracker() -> None:
    tracker = FakeTracker()
    line = pipeline(tracker)
    line.session.reconfigure(configuration_from_values(StreamConfig, {"search.candidates": 7}))
    assert tracker.calls == [("reconfigure", 7)]


def test_an_image_without_a_stamp_is_refused() -> None:
    line = pipeline(FakeTracker())
    assert line.intake.add_image("a", image(0)) == []
    assert line.statistics().frames["a"].refused_images == 1
    assert "header.stamp: expected the time of exposure, found zero" in line.problems.take()[-1].text
