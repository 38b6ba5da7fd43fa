"""Held pictures: what a frame grabber repeats is no new exposure, what a clock changes in it neither."""

from __future__ import annotations

import numpy as np
import pytest
from support.message_inputs import MESSAGES, SIDE, FakeTracker, camera_info, seed, stamp
from support.method_inputs import draw_curve
from support.pipeline_inputs import pipeline, poses

from lasso_motion_ros.geometry.frames import PLANES, Plane
from lasso_motion_ros.stream.outputs import Output
from lasso_motion_ros.stream.pipeline import TrackingPipeline
from msg_adapters.images import encode_image
from msg_adapters.messages import header_fields
from msg_adapters.sync.held_picture import HeldPicture, shows_the_same

QUANTA = np.random.default_rng(1)


def exposure(noise: float = 2.0, dtype: type = np.uint8) -> np.ndarray:
    return np.clip(np.rint(QUANTA.normal(100.0, noise, (256, 256))), 0, 255).astype(dtype)


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16])
def test_exposures_differ_and_repeats_do_not(dtype: type) -> None:
    one = exposure(dtype=dtype)
    assert shows_the_same(one, one.copy())
    assert not shows_the_same(one, exposure(dtype=dtype))
    assert not shows_the_same(one, one[:128])


def test_a_display_with_hardly_any_noise_shows_exposures_nonetheless() -> None:
    """A filter over time leaves a third of a grey value, and collimation a quarter of the field."""
    before, now = (np.zeros((256, 256), np.uint8) for _ in range(2))
    for picture in (before, now):
        picture[64:192, 64:192] = exposure(0.3)[64:192, 64:192]
    assert not shows_the_same(before, now)


def test_a_clock_may_change_and_a_ring_that_moves_is_an_exposure() -> None:
    one = exposure()
    clock = one.copy()
    clock[4:14, 190:250] = QUANTA.integers(0, 255, (10, 60))
    assert shows_the_same(one, clock)
    clock[240:250, 4:64] = 0  # two of them span the picture
    assert not shows_the_same(one, clock)
    angle = np.linspace(0.0, 2.0 * np.pi, 60)
    curve = 128.0 + 30.0 * np.column_stack([np.cos(angle), np.sin(angle)])
    still, moved = (draw_curve(curve + shift, (256, 256), background=180.0) for shift in (0.0, 0.4))
    assert not shows_the_same(still, moved)


def test_each_held_picture_knows_its_exposure() -> None:
    picture, one = HeldPicture(), exposure()
    shown = [picture.shows_again(at, pixels) for at, pixels in ((1, one), (2, one), (3, one), (4, exposure()))]
    assert shown == [False, True, True, False]
    assert [picture.exposure_of(at) for at in (1, 2, 3, 4)] == [1, 1, 1, 4]
    assert not picture.shows_again(2, exposure())  # a new run
    assert not picture.held


def give(line: TrackingPipeline, shown: dict[Plane, np.ndarray], number: int) -> list[Output]:
    """A pair of pictures, through the pipeline."""
    outputs: list[Output] = []
    for plane in PLANES:
        header = header_fields(stamp(number), "xray")
        image = MESSAGES.make("sensor_msgs/msg/Image", encode_image(shown[plane], header))
        for task in line.intake.add_image(plane, image):
            outputs += line.session.process(task)
    return outputs


def small() -> dict[Plane, np.ndarray]:
    return {plane: QUANTA.integers(0, 255, (SIDE, SIDE), dtype=np.uint8) for plane in PLANES}


def test_a_held_picture_is_not_tracked_and_clicks_on_it_are_on_its_exposure() -> None:
    tracker = FakeTracker()
    line = pipeline(tracker)
    for plane in PLANES:
        line.intake.add_camera_info(plane, camera_info(plane))
    outputs, held = [], small()
    for number, shown in enumerate([small(), held, held, held]):
        outputs += give(line, shown, number)
    assert line.intake.held == PLANES
    for plane in PLANES:
        for task in line.intake.add_seed(plane, seed(stamp(3))):
            outputs += line.session.process(task)
    for number in (4, 5):
        outputs += give(line, small(), number)
    assert tracker.calls == [("initialise", stamp(1)), ("track", stamp(4)), ("track", stamp(5))]
    assert list(poses(outputs)) == [stamp(1), stamp(4), stamp(5)]
    assert {plane: counts.held for plane, counts in line.intake.frame_counts.items()} == {"a": 2, "b": 2}


def test_a_plane_that_is_held_is_missing() -> None:
    line = pipeline()
    for plane in PLANES:
        line.intake.add_camera_info(plane, camera_info(plane))
    held = small()
    for number in range(12):
        give(line, small() | ({"b": held["b"]} if number else held), number)
    for task in line.intake.flush():
        line.session.process(task)
    assert line.statistics().half_pairs == 11
    assert line.intake.pairing_counts["b"].received == 1
