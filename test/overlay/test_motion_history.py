"""Which motion an image of the overlay is drawn with."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from lasso_motion_ros.config.overlay import OverlayConfig
from lasso_motion_ros.config.stream import SyncConfig
from lasso_motion_ros.overlay.motion_history import MotionHistory

MS = 1_000_000
PERIOD = 300 * MS


def shift(millimetres: float) -> np.ndarray:
    motion = np.eye(4)
    motion[2, 3] = 1e-3 * millimetres
    return motion


def history(**sync: float) -> MotionHistory:
    made = MotionHistory(dataclasses.replace(OverlayConfig(), sync=SyncConfig(**sync)))
    made.add_state("TRACKING")
    for index in range(3):
        made.add_image("a", index * PERIOD)
    made.add_motion(0, shift(0))
    made.add_motion(PERIOD, shift(1))
    return made


def test_an_image_of_plane_a_takes_the_motion_with_its_stamp() -> None:
    made = history()
    assert made.answered("a", PERIOD)
    assert made.choose("a", PERIOD).status == ""
    np.testing.assert_array_equal(made.choose("a", PERIOD).motion, shift(1))
    assert not made.answered("a", 2 * PERIOD)


@pytest.mark.parametrize(("later_ms", "answered"), [(-6, False), (-5, True), (0, True), (155, True), (156, False)])
def test_an_image_of_plane_b_takes_that_of_the_a_before_it(later_ms: int, answered: bool) -> None:
    assert history().answered("b", PERIOD + later_ms * MS) is answered


@pytest.mark.parametrize(("later_ms", "answered"), [(-21, False), (-20, True), (100, True), (220, True), (221, False)])
def test_with_a_known_offset_the_nearest_a_counts(later_ms: int, answered: bool) -> None:
    assert history(plane_b_offset_s=0.1).answered("b", PERIOD + later_ms * MS) is answered


def test_the_last_motion_is_used_with_its_age_in_print() -> None:
    choice = history().choose("a", 2 * PERIOD)
    np.testing.assert_array_equal(choice.motion, shift(1))
    assert choice.status == "motion 0.30 s old"


def test_an_old_motion_is_not_used() -> None:
    made = history()
    assert made.choose("a", PERIOD + 1000 * MS).motion is not None
    choice = made.choose("a", PERIOD + 1100 * MS)
    assert choice.motion is None
    assert choice.status == "motion 1.1 s old"


def test_a_pause_is_not_taken_for_a_frame_period() -> None:
    made = history()
    resumed = 20_000 * MS
    made.add_image("a", resumed)
    made.add_motion(resumed, shift(2))
    assert made.answered("b", resumed + 155 * MS)
    assert not made.answered("b", resumed + 156 * MS)
    assert made.choose("b", resumed + 9_900 * MS).motion is None


def test_after_a_pause_at_the_start_the_period_is_a_second_at_most() -> None:
    made = MotionHistory(OverlayConfig())
    made.add_state("TRACKING")
    for stamp_ns in (0, 20_000 * MS):
        made.add_image("a", stamp_ns)
    made.add_motion(20_000 * MS, shift(2))
    assert made.answered("b", 20_505 * MS)
    assert not made.answered("b", 20_506 * MS)


def test_no_motion_older_than_the_timeout_is_an_image_s_own() -> None:
    made = MotionHistory(dataclasses.replace(OverlayConfig(), motion_timeout_s=0.1))
    made.add_state("TRACKING")
    for index in range(3):
        made.add_image("a", index * PERIOD)
    made.add_motion(2 * PERIOD, shift(2))
    assert made.answered("b", 2 * PERIOD + 100 * MS)
    assert not made.answered("b", 2 * PERIOD + 101 * MS)


def test_a_motion_of_the_future_is_not_used() -> None:
    made = history()
    assert made.choose("a", -100 * MS).motion is None


@pytest.mark.parametrize("state", ["LOST", "DISPLACED", "WAITING_FOR_SEED", "INACTIVE"])
def test_without_a_pose_the_state_is_the_word(state: str) -> None:
    made = history()
    made.add_state(state)
    choice = made.choose("a", PERIOD)
    assert choice.motion is None
    assert choice.status == state
    made.add_state("TRACKING")  # what was before it does not come back
    assert made.choose("a", PERIOD).motion is None


def test_degraded_is_a_remark() -> None:
    made = history()
    made.add_state("DEGRADED")
    assert made.choose("a", PERIOD).status == "DEGRADED"
    assert made.choose("a", 2 * PERIOD).status == "DEGRADED, motion 0.30 s old"


def test_before_anything_was_heard_there_is_no_motion() -> None:
    choice = MotionHistory(OverlayConfig()).choose("a", 0)
    assert choice.motion is None
    assert choice.status == ""


def test_a_new_run_forgets_the_motions_of_the_last() -> None:
    made = history()
    made.add_motion(PERIOD - 2000 * MS, shift(5))
    assert not made.answered("a", PERIOD)


def test_the_loop_is_that_of_the_motion_and_is_waited_for_once_loops_come() -> None:
    made = history()
    assert made.choose("a", PERIOD).loop is None
    loops = [np.full((64, 3), float(index)) for index in range(2)]
    made.add_loop(0, loops[0])
    assert made.answered("a", 0)
    assert not made.answered("a", PERIOD)
    made.add_loop(PERIOD, loops[1])
    assert made.answered("a", PERIOD)
    np.testing.assert_array_equal(made.choose("a", PERIOD).loop, loops[1])
    np.testing.assert_array_equal(
        made.choose("a", 2 * PERIOD).loop, loops[1]
    )  # drawn with the last motion, and its loop
    made.add_state("LOST")
    made.add_state("TRACKING")
    made.add_motion(2 * PERIOD, shift(2))
    assert made.answered("a", 2 * PERIOD)
    assert made.choose("a", 2 * PERIOD).loop is None


def test_a_covariance_is_that_of_the_images_own_motion_only() -> None:
    """An image that is drawn with an earlier motion has no band: how far off that one is by now nobody has said."""
    made = history()
    made.add_covariance(0, np.eye(6))
    assert made.answered("a", 0)
    assert not made.answered("a", PERIOD)
    np.testing.assert_array_equal(made.choose("a", 0).covariance, np.eye(6))
    made.add_covariance(PERIOD, 2.0 * np.eye(6))
    assert made.answered("a", PERIOD)
    assert made.choose("a", 2 * PERIOD).motion is not None
    assert made.choose("a", 2 * PERIOD).covariance is None
