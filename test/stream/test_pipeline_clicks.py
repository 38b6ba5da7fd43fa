"""Clicks that come early, late, twice, on pairs that are gone, or on no loop."""

from __future__ import annotations

from dataclasses import replace

import pytest
from support.message_inputs import FakeTracker, camera_info, image, seed, stamp, stream
from support.pipeline_inputs import give, names, pipeline, poses, run, states

from lasso_motion_ros.geometry.frames import Frame


@pytest.mark.parametrize("late_by", [0, 1, 5])
def test_clicks_that_come_late_change_no_pose(late_by: int) -> None:
    expected = poses(run(pipeline(), stream(8)))
    messages = list(stream(8))
    clicks = [entry for entry in messages if entry[0].endswith("seed")]
    messages = [entry for entry in messages if not entry[0].endswith("seed")]
    place = 4 * (1 + late_by)  # behind so many pairs
    assert poses(run(pipeline(), messages[:place] + clicks + messages[place:])) == expected
    assert expected == {stamp(k): float(k) for k in range(8)}


def test_a_model_is_answered_at_once_and_in_a_hurry_followed_at_four_pairs_a_second() -> None:
    tracker = FakeTracker()
    line = pipeline(tracker)
    run(line, stream(12, seeded=None))
    line.intake.add_seed("a", seed(stamp(0)))
    (task,) = line.intake.add_seed("b", seed(stamp(0)))
    begin = stamp(0)
    later = [replace(pair, stamp_ns=begin + k * 100_000_000) for k, pair in enumerate(task.later, start=1)]
    answers = line.session.answers(replace(task, later=tuple(later)), lambda: True)
    assert poses(next(answers)) == {begin: 0.0}
    assert tracker.calls == [("initialise", begin)]
    rest = [stamp_ns for outputs in answers for stamp_ns in poses(outputs)]
    assert [(stamp_ns - begin) // 100_000_000 for stamp_ns in rest] == [3, 6, 9, 11]
    # Of those between, the tracker is told in their place.
    followed = [what for what, _ in tracker.calls[1:]]
    assert followed == (["leave_out"] * 2 + ["track"]) * 3 + ["leave_out", "track"]
    assert [stamp_ns for _, stamp_ns in tracker.calls] == [begin, *(pair.stamp_ns for pair in later)]


def test_answers_that_nobody_waits_for_any_more_are_not_worked_out() -> None:
    tracker = FakeTracker()
    line = pipeline(tracker)
    run(line, stream(12, seeded=None))
    line.intake.add_seed("a", seed(stamp(0)))
    (task,) = line.intake.add_seed("b", seed(stamp(0)))
    answers = line.session.answers(task)
    next(answers)
    answers.close()  # the node is told to stop
    assert tracker.calls == [("initialise", stamp(0))]
    assert poses(run(line, stream(1, seeded=None, start=12))) == {stamp(12): 1.0}  # and nothing is held back


def test_clicks_with_stamp_zero_are_for_the_next_pair() -> None:
    line = pipeline()
    run(line, stream(3, seeded=None))
    assert line.intake.add_seed("a", seed(0)) == line.intake.add_seed("b", seed(0)) == []
    assert poses(run(line, stream(2, seeded=None, start=3))) == {stamp(3): 0.0, stamp(4): 1.0}


def test_clicks_on_two_pairs_are_refused_and_can_be_completed() -> None:
    line = pipeline()
    run(line, stream(4, seeded=None))
    assert line.intake.add_seed("a", seed(stamp(1))) == line.intake.add_seed("b", seed(stamp(2))) == []
    problem = line.problems.take()[-1]
    assert problem.topic == "plane_a/seed"
    assert "one pair" in problem.text
    assert [ready.pair.stamp_ns for ready in line.intake.add_seed("a", seed(stamp(2)))] == [stamp(2)]


@pytest.mark.parametrize("stray", [("a", 1), ("a", 999), ("a", 0), ("b", 1), ("b", 999), ("b", 0)])
@pytest.mark.parametrize("order", ["ab", "ba"])
def test_a_stray_click_does_not_spoil_the_next_seed(stray: tuple[str, int], order: str) -> None:
    """One plane's click of long ago, of a clock that is ahead, or for the next pair; then both planes of pair 3."""
    plane, at = stray
    line = pipeline()
    run(line, stream(4, seeded=None))
    assert line.intake.add_seed(plane, seed(0 if at == 0 else stamp(at))) == []
    assert line.intake.add_seed(order[0], seed(stamp(3))) == []
    (ready,) = line.intake.add_seed(order[1], seed(stamp(3)))
    assert (ready.pair.stamp_ns, ready.seed is not None) == (stamp(3), True)
    assert line.statistics().waiting_clicks == ""


def test_clicks_for_the_next_pair_give_way_to_later_ones_on_an_earlier() -> None:
    line = pipeline()
    run(line, stream(4, seeded=None))
    line.intake.add_seed("b", seed(0))
    line.intake.add_seed("a", seed(stamp(2)))
    run(line, stream(1, seeded=None, start=4))
    assert [problem.topic for problem in line.problems.take()] == ["plane_b/seed"]
    assert [ready.pair.stamp_ns for ready in line.intake.add_seed("b", seed(stamp(2)))] == [stamp(2)]


def test_what_is_kept_is_said_until_it_is_judged() -> None:
    line = pipeline()
    line.intake.add_seed("b", seed(stamp(1)))
    assert line.statistics().reason == (
        "no calibration yet; plane A has no clicks yet, plane B's clicks wait for the image at "
        f"{stamp(1) // 10**9}.{stamp(1) % 10**9:09d} s; no calibrated image has come"
    )
    run(line, stream(1, seeded=None))
    assert line.statistics().reason.endswith(f"the newest is at {stamp(0) // 10**9}.{stamp(0) % 10**9:09d} s")
    run(line, stream(1, seeded=None, start=1))
    assert line.statistics().reason == line.statistics().waiting_clicks == "plane A has no clicks yet"
    line.intake.add_seed("a", seed(0))
    line.reset()
    assert line.statistics().reason == "the model was forgotten"
    assert line.statistics().waiting_clicks == ""


def test_clicks_on_an_image_that_is_gone_are_refused() -> None:
    line = pipeline(seed_buffer_pairs=3)
    run(line, stream(6, seeded=None))
    assert line.intake.add_seed("a", seed(stamp(1))) == []
    assert "not among the last 3 pairs" in line.problems.take()[-1].text
    line.intake.add_seed("a", seed(stamp(4)))
    assert [ready.pair.stamp_ns for ready in line.intake.add_seed("b", seed(stamp(4)))] == [stamp(4)]


def test_clicks_that_fit_no_loop_are_reported_and_leave_the_state() -> None:
    line = pipeline(FakeTracker(refuse=True))
    outputs = run(line, stream(3))
    assert set(states(outputs)) == {"WAITING_FOR_SEED"}
    assert [problem.text for problem in line.problems.take()] == ["no loop here"]
    assert len(states(outputs)) == 3, "one answer a pair"


def test_refused_clicks_do_not_disturb_a_running_track() -> None:
    tracker = FakeTracker()
    line = pipeline(tracker)
    run(line, stream(3))
    tracker.refuse = True
    line.intake.add_seed("a", seed(stamp(1)))
    (ready,) = line.intake.add_seed("b", seed(stamp(1)))
    assert line.session.process(ready) == []
    assert poses(run(line, stream(1, seeded=None, start=3))) == {stamp(3): 3.0}


def test_a_refusal_does_not_outlive_a_reset() -> None:
    line = pipeline(FakeTracker(refuse=True))
    run(line, stream(1))
    assert line.session.last_refusal == "no loop here"
    line.reset()
    assert line.session.last_refusal == ""


def test_clicks_of_the_run_before_are_forgotten() -> None:
    line = pipeline()
    run(line, stream(8))
    line.intake.add_seed("a", seed(stamp(9)))  # of a pair that never came
    run(line, stream(10, seeded=None))
    assert line.intake.add_seed("b", seed(stamp(9))) == []


def test_clicks_given_again_give_the_reference_again() -> None:
    line = pipeline()
    run(line, stream(2))
    line.intake.add_seed("a", seed(stamp(0)))
    (again,) = line.intake.add_seed("b", seed(stamp(0)))
    outputs = line.session.process(again)
    assert names(outputs)[0] == "reference"
    assert poses(outputs) == {stamp(0): 0.0, stamp(1): 1.0}
    assert line.statistics().pairs == 2


def test_a_busy_node_may_skip_pairs_but_loses_no_seed() -> None:
    line = pipeline()
    ready = [one for topic, _, message, _ in stream(6) for one in give(line, topic, message)]
    assert [one.seed is not None for one in ready] == [False, True, False, False, False, False, False]
    outputs = line.session.process(ready[-1])
    assert sorted(poses(outputs)) == [stamp(0), stamp(5)]


def test_clicks_given_while_one_plane_went_back_for_a_moment_are_used() -> None:
    line = pipeline()
    run(line, stream(4, seeded=None))
    run(line, [("/plane_a/image_raw", "", image(stamp(-30)), 0)])  # a stray one: A goes on forwards afterwards
    assert line.intake.add_seed("a", seed(stamp(1))) == line.intake.add_seed("b", seed(stamp(1))) == []
    assert poses(run(line, stream(1, seeded=None, start=4))) == {stamp(k): k - 1.0 for k in range(1, 5)}


def test_the_tracker_is_told_of_pairs_that_are_left_out() -> None:
    tracker = FakeTracker()
    line = pipeline(tracker)
    ready = [one for topic, _, message, _ in stream(8) for one in give(line, topic, message)]
    line.session.leave_out(ready[:1])  # no model yet
    line.session.process(ready[1])
    line.session.leave_out(ready[2:7])
    line.session.process(ready[7])
    times = [ready[number].pair.stamp_ns for number in (4, 5, 6)]  # the last three: what was before tells no more
    assert tracker.calls == [
        ("initialise", stamp(0)),
        *(("leave_out", time) for time in times),
        ("track", ready[7].pair.stamp_ns),
    ]


class HalfBlindTracker(FakeTracker):
    """Fails on plane A's frame alone."""

    def prepare(self, frame: Frame) -> None:
        super().prepare(frame)
        raise ValueError("no")


def test_work_ahead_is_for_a_model_and_no_failure_of_it_shows() -> None:
    tracker = HalfBlindTracker()
    line = pipeline(tracker)
    ready = [one for topic, _, message, _ in stream(3) for one in give(line, topic, message)]
    give(line, "/plane_a/camera_info", camera_info("a", stamp(3)))
    give(line, "/plane_a/image_raw", image(stamp(3)))
    frame = line.intake.waiting_a
    assert frame is not None
    line.session.prepare(frame)  # no model yet
    for task in ready[:2]:
        line.session.process(task)
    line.session.prepare(frame)
    assert tracker.calls == [("initialise", stamp(0)), ("prepare", stamp(3))]
    assert line.problems.take() == []
