"""What the page's headline says of a live graph: state, reason, silence, and one alarm for one fault."""

from __future__ import annotations

import pytest
from support.stream_bench import StreamBench

from msg_adapters import topics


@pytest.fixture
def bench() -> StreamBench:
    return StreamBench()


def test_a_state_that_nobody_has_renewed_is_no_state(bench: StreamBench) -> None:
    assert bench.said() == ("NO_TRACKER", False)
    bench.stream.add_state("TRACKING")  # latched, perhaps by a process that has died
    assert bench.said() == ("NO_POSE", False)
    assert bench.stream.status()["alarm"] == ""
    for pair in range(12):
        bench.now += 0.1
        bench.pair(pair)
    assert bench.said() == ("NO_POSE", False)
    assert bench.stream.status()["alarm"] == "No pose comes. Nothing is compensated."
    bench.motion(11, 0.0)
    assert bench.said() == ("TRACKING", True)
    assert bench.stream.status()["pose_age_s"] == 0.0
    bench.now += 1.6
    assert bench.said() == ("NO_IMAGES", False)
    assert bench.stream.status()["pose_age_s"] == 2
    bench.now += 2.0
    assert bench.said() == ("TRACKER_SILENT", False)
    bench.stream.tracker_is_present(False)
    assert bench.said() == ("NO_TRACKER", False)
    assert bench.stream.status()["alarm"] == "The tracker is gone. Nothing is tracked."
    bench.stream.tracker_is_present(True)
    bench.stream.add_state("WAITING_FOR_SEED")
    assert bench.said() == ("WAITING_FOR_SEED", False)
    assert bench.stream.status()["pose_age_s"] is None


def test_a_tracker_that_waits_is_heard_by_its_diagnostics(bench: StreamBench) -> None:
    bench.stream.add_state("WAITING_FOR_SEED")
    for _ in range(5):
        bench.now += 1.0
        bench.diagnostics("/lasso_tracker: tracker", "WAITING_FOR_SEED: no seed yet")
        assert bench.said()[0] == "WAITING_FOR_SEED"
    bench.now += 2.6
    assert bench.said()[0] == "TRACKER_SILENT"


def test_at_a_slow_rate_a_pose_is_fresh_for_longer(bench: StreamBench) -> None:
    for pair in range(0, 16, 4):
        bench.now += 1.0
        bench.pair(pair)
    bench.tracks()
    bench.now += 2.5
    assert bench.said() == ("TRACKING", True)
    bench.diagnostics("/lasso_tracker: tracker", "TRACKING")
    bench.now += 2.4
    assert bench.said()[0] == "NO_IMAGES"


def test_images_that_end_and_come_again_are_one_alarm(bench: StreamBench) -> None:
    alarms = []
    for pair in range(60):
        bench.now += 0.1
        if not 20 <= pair < 40:  # two seconds without images
            bench.pair(pair)
        bench.diagnostics("/lasso_tracker: tracker", "TRACKING")
        if pair == 0:
            bench.stream.add_state("TRACKING")
        if not 20 <= pair < 43:  # the first pose comes a little later
            bench.motion(pair, 0.0)
        status = bench.stream.status()
        alarms += [status["alarm"]] if status["alarm"] not in ("", *alarms[-1:]) else []
        assert not (status["alarm"] and status["has_pose"])
    assert alarms == ["No images. What is on the screen is old."]
    assert bench.said() == ("TRACKING", True)


def test_images_that_end_in_one_plane_a_moment_earlier_are_one_alarm(bench: StreamBench) -> None:
    bench.stream.add_state("TRACKING")
    alarms = []
    for step in range(250):  # of 10 ms
        bench.now += 0.01
        for plane, last in (("a", 100), ("b", 103)):
            if step % 10 == last % 10 and step <= last:
                bench.image(plane, step // 10)
        if step % 10 == 4 and step <= 104:
            bench.motion(step // 10, 0.0)
        bench.diagnostics("/lasso_tracker: tracker", "TRACKING")  # which has not noticed yet
        status = bench.stream.status()
        alarms += [status["alarm"]] if status["alarm"] not in ("", *alarms[-1:]) else []
    assert alarms == ["No images. What is on the screen is old."]


@pytest.mark.parametrize(
    ("planes", "state", "alarm"),
    [
        ("ab", "NO_IMAGES", "The picture is held. What is on the screen is old."),
        ("b", "DEGRADED", "The picture of plane B is held: no new exposure."),
    ],
)
def test_a_held_picture_is_no_image(bench: StreamBench, planes: str, state: str, alarm: str) -> None:
    bench.stream.add_state("DEGRADED")
    for pair in range(40):
        bench.now += 0.1
        for plane in "ab":
            bench.image(plane, pair, shown=20 if plane in planes and pair > 20 else None)
        if pair <= 20 or planes == "b":
            bench.motion(pair, 0.0)
        bench.diagnostics("/lasso_tracker: tracker", "DEGRADED")
    assert bench.said()[0] == state
    assert bench.stream.status()["alarm"] == alarm
    assert bench.stream.status()["held_pictures"] == {plane: plane in planes for plane in "ab"}


def test_a_plane_that_this_page_alone_does_not_get_is_said_so(bench: StreamBench) -> None:
    for pair in range(4):
        bench.now += 0.25
        bench.pair(pair)
    bench.now += 1.4
    bench.image("a", 10)
    bench.tracks()
    bench.now += 0.2
    assert bench.said() == ("TRACKING", True)
    assert bench.stream.status()["alarm"] == "The tracker has images of plane B, this page has not. The picture is old."
    bench.stream.add_state("DEGRADED")
    assert bench.stream.status()["alarm"] == "No images of plane B. The picture is old."


def test_silence_is_counted_from_the_last_image(bench: StreamBench) -> None:
    assert bench.stream.status()["stopped_s"] == {"a": None, "b": None}
    for pair in range(4):
        bench.now += 0.25
        bench.image("a", pair)
    bench.now += 0.9
    assert bench.stream.status()["stopped_s"] == {"a": None, "b": None}
    bench.now += 3.1
    assert bench.stream.status()["stopped_s"] == {"a": 4, "b": None}
    assert bench.stream.status()["seen"] == {"a": True, "b": False}


def test_at_one_image_a_second_two_seconds_are_no_silence(bench: StreamBench) -> None:
    for pair in range(0, 16, 4):
        bench.now += 1.0
        bench.image("a", pair)
    bench.now += 2.0
    assert bench.stream.status()["stopped_s"]["a"] is None


def test_the_reason_is_the_trackers_own_and_of_this_state(bench: StreamBench) -> None:
    bench.tracks()
    bench.stream.add_state("DEGRADED")
    bench.diagnostics("/lab/other: tracker", "DEGRADED: not this one")
    bench.diagnostics("/lab/lasso_tracker: plane_a", "DEGRADED: nor this")
    assert bench.stream.status()["reason"] == ""
    bench.diagnostics("/lab/lasso_tracker: tracker", "DEGRADED: one plane only", **{topics.LAST_LATENCY_KEY: "12.5"})
    assert bench.stream.status()["reason"] == "One plane only"
    assert bench.stream.status()["tracker_latency_ms"] == 12.5
    bench.stream.add_state("LOST")
    assert bench.stream.status()["reason"] == ""
    bench.diagnostics("/lasso_tracker: tracker", "DEGRADED: late", **{topics.LAST_LATENCY_KEY: "?"})
    assert (bench.stream.status()["reason"], bench.stream.status()["tracker_latency_ms"]) == ("", None)
