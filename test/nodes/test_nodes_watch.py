"""What is wrong with a stream is told from stamps, counts and offers."""

from __future__ import annotations

from lasso_motion_ros.nodes.watch import Offer, StreamWatch

PERIOD = 100_000_000
GOOD = Offer(("/player",), (), 1, True)
BOTH = ("a", "b")


def feed(watch: StreamWatch, numbers: list[int], *, ahead_ns: int = 0, planes: tuple = BOTH) -> None:
    for number in numbers:
        for plane in planes:
            watch.add_image(plane, number * PERIOD + (ahead_ns if plane == "b" else 0), number * PERIOD)


def complaints(
    watch: StreamWatch, now_s: float, offer: Offer = GOOD, calibrated: tuple = BOTH, pairs: int = 0, clicks: str = ""
) -> dict:
    return dict(watch.complaints(now_s, dict.fromkeys(BOTH, offer), calibrated, pairs, clicks))


def test_a_good_stream_is_not_complained_about() -> None:
    watch = StreamWatch(0.0)
    feed(watch, list(range(40)))
    assert complaints(watch, 4.0, pairs=40) == {}
    assert watch.missing("a") == (0, 40)
    assert watch.clock_offset_s() == 0.0


def test_nobody_publishes_is_said_after_two_seconds() -> None:
    nobody = Offer((), (), 0, None)
    assert complaints(StreamWatch(10.0), 11.9, nobody, ()) == {}
    assert set(complaints(StreamWatch(10.0), 12.0, nobody, ())) == {
        f"plane_{plane}/{name}" for plane in BOTH for name in ("image_raw", "camera_info")
    }


def test_images_without_calibration_are_said_after_two_seconds() -> None:
    watch = StreamWatch(0.0)
    feed(watch, list(range(40)))
    assert complaints(watch, 4.0, calibrated=("b",), pairs=1) == {}
    feed(watch, list(range(40, 61)))
    assert complaints(watch, 6.0, calibrated=("b",), pairs=2) == {
        "plane_a/camera_info": "images have come for 2 s without a valid calibration"
    }
    assert complaints(watch, 6.1, pairs=3) == {}


def test_a_tracker_that_is_too_slow_is_said_while_it_leaves_pairs_out() -> None:
    watch = StreamWatch(0.0)
    feed(watch, list(range(40)))
    said = [
        dict(watch.complaints(now_s, dict.fromkeys(BOTH, GOOD), BOTH, pairs, left_out=left_out))
        for now_s, pairs, left_out in ((3.0, 30, 0), (4.0, 45, 1), (4.5, 60, 7), (5.0, 75, 7))
    ]
    assert said[2] == {"tracker": "it cannot keep up with the stream: 6 pairs were left out while 15 came"}
    assert said[:2] == [{}, {}]  # one of fifteen is no lasting overload
    assert said[3] == {}


def test_images_that_have_stopped() -> None:
    watch = StreamWatch(0.0)
    feed(watch, list(range(10)))
    assert watch.silence_s("a", 2.8) == 0.0
    assert complaints(watch, 3.9, pairs=10)["plane_b/image_raw"] == "no images for 3 s"


def test_lost_images_are_a_best_effort_publishers_fault() -> None:
    watch = StreamWatch(0.0)
    feed(watch, [number for number in range(60) if number % 3 != 1])
    assert watch.missing("a") == (20, 60)
    said = complaints(watch, 5.9, Offer(("/bridge",), ("/bridge",), 1, False), pairs=40)["plane_a/image_raw"]
    assert said.startswith("20 of the last 60 images are missing: /bridge publishes best effort")
    assert "config/fastdds.xml" in said
    assert complaints(watch, 5.9, pairs=41) == {}


def test_a_reliable_subscription_hears_nothing_of_a_best_effort_publisher() -> None:
    said = complaints(StreamWatch(0.0), 0.1, Offer(("/bridge",), ("/bridge",), 1, True))
    assert "set image_reliability to auto" in said["plane_a/image_raw"]


def test_clocks_that_disagree_are_said_while_no_pair_comes_of_it() -> None:
    watch = StreamWatch(0.0)
    feed(watch, list(range(30)), ahead_ns=-3_700_000_000)
    assert watch.clock_offset_s() == -3.7
    assert "B's stamps are -3.700 s from A's" in complaints(watch, 3.0)["sync"]
    assert complaints(watch, 3.1) == {}  # nothing has come since
    feed(watch, list(range(30, 33)), ahead_ns=-3_700_000_000)
    assert complaints(watch, 3.3, pairs=3) == {}  # pairs come: whatever the clocks say


def test_a_new_run_begins_anew() -> None:
    watch = StreamWatch(0.0)
    feed(watch, list(range(100, 140)))
    feed(watch, list(range(3)))
    assert watch.missing("a") == (0, 3)


def test_clicks_that_are_kept_are_said_after_two_seconds() -> None:
    watch = StreamWatch(0.0)
    feed(watch, list(range(40)))
    assert complaints(watch, 4.0, clicks="plane B has no clicks yet", pairs=1) == {}
    feed(watch, list(range(40, 61)))
    assert complaints(watch, 6.0, clicks="plane B has no clicks yet", pairs=2) == {"seed": "plane B has no clicks yet"}
    assert complaints(watch, 6.1, pairs=3) == {}
    assert complaints(watch, 6.2, clicks="plane B has no clicks yet", pairs=4) == {}
