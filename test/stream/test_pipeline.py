"""Messages in, messages out: order, new runs, bad messages, lost pairs."""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np
import pytest
from support.message_inputs import MESSAGES, PERIOD_NS, FakeTracker, camera_info, image, seed, stamp, stream
from support.pipeline_inputs import give, message, names, pipeline, poses, run, states

from lasso_motion_ros.core.errors import TrackingError
from lasso_motion_ros.geometry.frames import FramePair, Seed
from lasso_motion_ros.stream.outputs import Output
from lasso_motion_ros.tracking.tracker import TrackerState, TrackResult
from msg_adapters.markers import ADD, DELETE
from msg_adapters.messages import header_fields, stamp_to_ns
from msg_adapters.poses import decode_pose


def test_the_first_seeded_pair_gives_reference_state_and_identity_in_this_order() -> None:
    outputs = run(pipeline(), stream(2))
    assert names(outputs) == [
        "state",  # the pair is complete before its clicks in plane B
        "reference", "state", "motion", "motion_raw", "motion_with_covariance", "catheter",
        "state", "motion", "motion_raw", "motion_with_covariance", "catheter",
    ]  # fmt: skip
    assert states(outputs) == ["WAITING_FOR_SEED", "TRACKING", "TRACKING"]
    assert poses(outputs) == {stamp(0): 0.0, stamp(1): 1.0}
    reference = message(outputs[1])
    assert stamp_to_ns(reference.stamp) == stamp(0)
    motion = message(outputs[3])
    assert motion.header.frame_id == "patient_table"
    assert np.array_equal(decode_pose(motion), np.eye(4))
    assert np.array_equal(message(outputs[5]).pose.covariance, (np.eye(6) * 1e-8).reshape(-1))
    assert message(outputs[6]).action == ADD
    assert len(message(outputs[6]).points) >= 64
    assert [output.stamp_ns for output in outputs] == [stamp(0)] * 7 + [stamp(1)] * 5


def test_before_anything_comes_it_waits_for_calibration_and_then_for_a_seed() -> None:
    line = pipeline()
    assert states(line.session.initial_outputs()) == ["WAITING_FOR_CALIBRATION"]
    assert line.intake.add_camera_info("a", camera_info("a")) == []
    assert line.pending_outputs() == []
    line.intake.add_camera_info("b", camera_info("b"))
    assert states(line.pending_outputs()) == ["WAITING_FOR_SEED"]
    assert line.pending_outputs() == []


METHOD_FAILURES = [
    (ValueError("shapes differ"), "ValueError: shapes differ"),
    (ZeroDivisionError("division by zero"), "ZeroDivisionError: division by zero"),
    (np.linalg.LinAlgError("Singular matrix"), "LinAlgError: Singular matrix"),
    (cv2.error("bad\n argument"), "error: bad argument"),
]


class FailingTracker(FakeTracker):
    """Raises `error` while there is one."""

    error: Exception | None = None

    def initialise(self, pair: FramePair, seed: Seed) -> TrackResult:
        if self.error is not None:
            raise self.error
        return super().initialise(pair, seed)

    def track(self, pair: FramePair) -> TrackResult:
        if self.error is not None:
            raise self.error
        return super().track(pair)


@pytest.mark.parametrize(("error", "words"), METHOD_FAILURES)
def test_mathematics_that_fail_on_a_pair_are_a_reported_loss(error: Exception, words: str) -> None:
    tracker = FailingTracker()
    line = pipeline(tracker)
    run(line, stream(2))
    tracker.error = error
    assert states(run(line, stream(1, seeded=None, start=2))) == ["LOST"]
    assert [problem.text for problem in line.problems.take()] == [words]
    assert line.statistics().reason == words
    tracker.error = None
    assert states(run(line, stream(1, seeded=None, start=3))) == ["TRACKING"]


@pytest.mark.parametrize(("error", "words"), METHOD_FAILURES)
def test_mathematics_that_fail_on_clicks_refuse_them(error: Exception, words: str) -> None:
    tracker = FailingTracker()
    tracker.error = error
    line = pipeline(tracker)
    assert set(states(run(line, stream(2)))) == {"WAITING_FOR_SEED"}
    assert line.session.last_refusal == words
    assert [(problem.topic, problem.text) for problem in line.problems.take()] == [("seed", words)]


def test_a_model_from_before_the_start_is_lost_until_a_pair_comes() -> None:
    line = pipeline()
    run(line, stream(2))
    again = line.session.initial_outputs()
    assert names(again) == ["state", "catheter"]
    assert states(again) == ["LOST"]
    assert message(again[1]).action == DELETE
    assert line.statistics().reason == "no pair since activation"
    assert states(run(line, stream(1, seeded=None, start=2))) == ["TRACKING"]


def test_statistics_may_be_taken_while_a_state_is_counted_for_the_first_time(monkeypatch: pytest.MonkeyPatch) -> None:
    line = pipeline()
    run(line, stream(2, seeded=None))
    seeded = list(stream(1, seeded=2, start=2))

    def has_pose(state: TrackerState) -> bool:
        monkeypatch.undo()
        run(line, seeded)
        return False

    monkeypatch.setattr(TrackerState, "has_pose", property(has_pose))
    line.statistics()
    assert line.statistics().states[TrackerState.TRACKING] == 1


def test_a_missing_plane_is_answered_without_a_pose() -> None:
    line = pipeline()
    messages = [entry for entry in stream(5) if not (entry[0] == "/plane_b/image_raw" and entry[3] == stamp(2) + 1000)]
    outputs = run(line, messages)
    assert states(outputs)[-3:] == ["LOST", "TRACKING", "TRACKING"]
    assert sorted(poses(outputs)) == [stamp(0), stamp(1), stamp(3), stamp(4)]
    lost = [output for output in outputs if output.stamp_ns == stamp(2)]
    assert names(lost) == ["state", "catheter"]
    assert message(lost[1]).action == DELETE
    assert line.statistics().half_pairs == 1


def test_stamps_that_go_back_are_a_new_run() -> None:
    tracker = FakeTracker()
    line = pipeline(tracker)
    run(line, stream(8))
    outputs = run(line, stream(8))
    assert poses(outputs) == {stamp(k): float(k) for k in range(8)}
    assert names(outputs)[:2] == ["catheter", "state"]
    assert states(outputs)[0] == "WAITING_FOR_SEED"
    assert [problem.text for problem in line.problems.take()] == [
        "the stamps of both planes went back: a new run, which needs a seed of its own"
    ]


@pytest.mark.parametrize(("state", "posed"), [("LOST", False), ("DISPLACED", False), ("DEGRADED", True)])
def test_poses_are_published_in_tracking_and_degraded_only(state: str, posed: bool) -> None:
    tracker = FakeTracker()
    line = pipeline(tracker)
    run(line, stream(2))
    tracker.state = TrackerState(state)
    outputs = run(line, stream(1, seeded=None, start=2))
    assert states(outputs) == [state]
    assert bool(poses(outputs)) == posed
    assert ("motion_raw" in names(outputs)) == posed


def test_reset_forgets_and_set_reference_is_refused_then() -> None:
    tracker = FakeTracker()
    line = pipeline(tracker)
    run(line, stream(2))
    line.session.set_reference()
    assert tracker.calls[-1] == ("set_reference", 0)
    assert names(line.reset()) == ["catheter", "state"]
    with pytest.raises(TrackingError, match="WAITING_FOR_SEED"):
        line.session.set_reference()
    assert states(run(line, stream(1, seeded=None, start=2))) == ["WAITING_FOR_SEED"]


def test_a_displaced_lasso_can_be_made_the_reference_but_no_lost_one() -> None:
    tracker = FakeTracker()
    line = pipeline(tracker)
    run(line, stream(2))
    for state in (TrackerState.DEGRADED, TrackerState.LOST):
        tracker.state = state
        run(line, stream(1, seeded=None, start=line.statistics().pairs))
        with pytest.raises(TrackingError, match=state.value):
            line.session.set_reference()
    tracker.state = TrackerState.DISPLACED
    run(line, stream(1, seeded=None, start=line.statistics().pairs))
    line.session.set_reference()
    assert tracker.calls[-1] == ("set_reference", 0)


def _spoilt_image() -> Any:
    message = image(stamp(0))
    message.encoding = "32FC1"
    return message


@pytest.mark.parametrize(
    ("topic", "message", "text"),
    [
        ("/plane_a/image_raw", _spoilt_image, "encoding: expected mono8"),
        ("/plane_b/camera_info", lambda: camera_info("b", d=np.array([0.1, 0, 0, 0, 0])), "d: expected all zero"),
        ("/plane_b/seed", lambda: seed(0, count=4), "expected 6 clicks"),
    ],
)
def test_a_bad_message_is_one_problem_and_no_exception(topic: str, message: Any, text: str) -> None:
    line = pipeline()
    assert give(line, topic, message()) == []
    (problem,) = line.problems.take()
    assert problem.topic == topic[1:]
    assert text in problem.text
    assert line.statistics().problems == {topic[1:]: 1}


def test_statistics_count_what_came_and_what_became_of_it() -> None:
    line = pipeline()
    run(line, stream(5))
    statistics = line.statistics()
    assert (statistics.pairs, statistics.poses, statistics.half_pairs) == (5, 5, 0)
    assert {state.value: count for state, count in statistics.states.items()} == {"TRACKING": 5}
    assert statistics.pairing["a"].paired == 5
    assert statistics.frames["b"].images == 5
    assert statistics.residual_px == {"a": 0.5, "b": 0.4}
    assert statistics.temporal_filter == {"a": 0.35}


def test_a_pair_tells_of_the_r_peaks_that_were_known_when_it_was_complete() -> None:
    line = pipeline()
    for index in (-2, 1):
        line.intake.add_r_peak(MESSAGES.make("std_msgs/msg/Header", header_fields(stamp(index), "ecg")))
    run(line, stream(2))
    line.intake.add_r_peak(MESSAGES.make("std_msgs/msg/Header", header_fields(stamp(2), "ecg")))
    pair = line.session.last_pair
    assert pair is not None
    assert pair.r_peaks_ns == (stamp(-2), stamp(1))


def test_gated_motion_leaves_out_the_pairs_outside_the_window_and_raw_motion_none() -> None:
    line = pipeline(**{"heartbeat.mode": "gate", "heartbeat.window_start": 0.5, "heartbeat.window_end": 0.9})
    outputs: list[Output] = []
    # A beat of four periods, an R peak with pairs -4, 0, 4 …: pairs 2, 3, 6, 7 … lie at 0.5 and 0.75 of it.
    for index in (-4, 0):
        assert line.intake.add_r_peak(MESSAGES.make("std_msgs/msg/Header", header_fields(stamp(index), "ecg"))) == []
    for index in range(0, 8, 4):
        outputs += run(line, stream(4, start=index, seeded=0))
        line.intake.add_r_peak(MESSAGES.make("std_msgs/msg/Header", header_fields(stamp(index + 4), "ecg")))
    assert poses(outputs) == {stamp(k): float(k) for k in (0, 2, 3, 6, 7)}
    assert names(outputs).count("motion_with_covariance") == 5
    assert names(outputs).count("motion_raw") == 8
    heartbeat = line.statistics().heartbeat
    assert heartbeat is not None
    assert heartbeat.values["poses in the window"] == "4 of 8"
    line.reset()
    heartbeat = line.statistics().heartbeat
    assert heartbeat is not None
    assert heartbeat.text == "no pose yet"


def test_filtered_motion_differs_from_raw_motion_only_where_the_heart_can_be_told() -> None:
    line = pipeline(**{"heartbeat.mode": "filter"})
    outputs = run(line, stream(8))
    raw = [message(output) for output in outputs if output.topic.name == "motion_raw"]
    assert [decode_pose(one)[0, 3] for one in raw] == [1e-3 * x for x in poses(outputs).values()]
    heartbeat = line.statistics().heartbeat
    assert heartbeat is not None
    assert not heartbeat.works
    assert "3.0 pairs/s are too few" in heartbeat.text
    assert pipeline().statistics().heartbeat is None


@pytest.mark.slow
def test_images_are_released() -> None:
    import gc
    import weakref

    line = pipeline(seed_buffer_pairs=4)
    kept = []
    for topic, _, given, _ in stream(40, offset_ns=PERIOD_NS // 2):
        for ready in give(line, topic, given):
            line.session.process(ready)
            kept.append(weakref.ref(ready.pair))
        del given
    del ready
    gc.collect()
    assert sum(pair() is not None for pair in kept) <= 5
