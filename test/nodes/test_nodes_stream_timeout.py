"""What has failed to come, by the steady clock."""

from __future__ import annotations

from lasso_motion_ros.nodes.stream_timeout import StreamTimeout


def fed(period_s: float, count: int, timeout_s: float = 0.0) -> StreamTimeout:
    """A stream of whole pairs, each answered at once."""
    timeout = StreamTimeout(timeout_s, 0.0)
    for number in range(count):
        for plane in ("a", "b"):
            timeout.add_image(plane, number * period_s)
        timeout.asked(number, number * period_s)
        timeout.answered(number, number * period_s)
    return timeout


def test_no_image_at_all() -> None:
    assert StreamTimeout(0.0, 10.0).reason(11.0) == ""
    assert StreamTimeout(0.0, 10.0).reason(11.1) == "no images yet"


def test_a_second_where_images_come_often() -> None:
    timeout = fed(0.1, 11)
    assert timeout.reason(2.0) == ""
    assert timeout.reason(2.25) == "no images for 1.2 s"


def test_three_periods_where_they_come_seldom() -> None:
    timeout = fed(0.5, 11)
    assert timeout.reason(6.5) == ""
    assert timeout.reason(6.6) == "no images for 1.6 s"


def test_two_images_with_a_long_pause_between_them_are_no_pace() -> None:
    timeout = fed(600.0, 2)
    assert timeout.reason(610.5) == "no images for 10.5 s"


def test_as_the_parameter_says() -> None:
    timeout = fed(0.1, 11, timeout_s=5.0)
    assert timeout.reason(6.0) == ""
    assert timeout.reason(6.1) == "no images for 5.1 s"
    timeout.reconfigure(0.5)
    assert timeout.reason(1.6) == "no images for 0.6 s"


def test_one_plane_is_enough_not_to_be_silent() -> None:
    timeout = fed(0.1, 11)
    for number in range(11, 40):
        timeout.add_image("a", 0.1 * number)
        timeout.asked(number, 0.1 * number)
        timeout.answered(number, 0.1 * number)
    assert timeout.reason(4.0) == ""


def test_images_that_make_no_pair_are_named_by_the_last_problem() -> None:
    timeout = fed(0.1, 11)
    for number in range(11, 30):
        timeout.add_image("a", 0.1 * number)
        timeout.add_problem("plane_a/image_raw: encoding: expected mono8")
    assert timeout.reason(2.1) == ""
    assert timeout.reason(2.9) == "no image could be used for 1.8 s: plane_a/image_raw: encoding: expected mono8"


def test_the_first_images_after_a_pause_have_their_time_to_pair() -> None:
    timeout = fed(0.1, 11)
    timeout.add_image("a", 1.1)
    timeout.add_image("a", 60.0)
    assert timeout.reason(60.1) == ""


def test_a_pair_that_is_not_answered_is_the_trackers_silence() -> None:
    timeout = fed(0.1, 11)
    timeout.asked(11, 1.1)
    timeout.asked(12, 1.2)
    assert timeout.reason(2.0) == ""
    assert timeout.reason(2.2) == "the tracker has not answered for 1.1 s"
    timeout.answered(11, 2.3)
    assert timeout.reason(2.4) == ""
    assert timeout.reason(3.4) == "the tracker has not answered for 1.1 s"
    timeout.answered(12, 3.5)
    assert timeout.reason(3.6) == "no images for 2.6 s"


def test_pairs_that_were_left_out_or_forgotten_are_not_waited_for() -> None:
    timeout = fed(0.1, 11)
    timeout.asked(11, 1.1)
    timeout.asked(14, 1.2)
    timeout.answered(14, 1.3)
    timeout.asked(15, 1.4)
    timeout.forget()
    assert timeout.reason(3.0) == "no images for 2.0 s"
