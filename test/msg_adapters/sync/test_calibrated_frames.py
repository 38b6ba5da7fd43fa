"""Images and calibrations of one plane: per frame or latched, in any order of arrival."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from support.message_inputs import PERIOD_NS, camera_info, image, projection, stamp

from lasso_motion_ros.core.errors import MessageError
from lasso_motion_ros.geometry.frames import Frame
from msg_adapters.sync.calibrated_frames import CalibratedFrames


def info(index: int | None, turned: int = 0) -> Any:
    """A calibration for image `index` (None: stamp 0), of a view that `turned` tells from others."""
    matrix = projection("a").matrix.copy()
    matrix[0] += 1e-3 * turned * matrix[2]
    return camera_info("a", 0 if index is None else stamp(index), p=matrix.reshape(-1))


def feed(frames: CalibratedFrames, *messages: Any) -> list[Frame]:
    found = []
    for message in messages:
        found += frames.add_image(message) if hasattr(message, "encoding") else frames.add_camera_info(message)
    return found


def views(found: list[Frame]) -> list[tuple[int, int]]:
    """(image, turn of its view) of each frame."""
    start = projection("a").matrix
    return [
        (
            round((frame.stamp_ns - stamp(0)) / PERIOD_NS),
            round(float((frame.projection.matrix - start)[0, 3] / (1e-3 * start[2, 3]))),
        )
        for frame in found
    ]


def test_per_frame_each_image_uses_its_own() -> None:
    messages = [m for k in range(5) for m in (info(k, k), image(stamp(k)))]
    assert views(feed(CalibratedFrames(), *messages)) == [(k, k) for k in range(5)]


def test_per_frame_behind_their_images() -> None:
    messages = [m for k in range(5) for m in (image(stamp(k)), info(k, k))]
    assert views(feed(CalibratedFrames(), *messages)) == [(k, k) for k in range(5)]


@given(st.lists(st.integers(0, 3), min_size=6, max_size=20))
def test_arrival_within_a_frame_of_each_other_changes_nothing(delays: list[int]) -> None:
    count = len(delays)
    arrivals = [(2 * k, 1, image(stamp(k))) for k in range(count)]
    arrivals += [(max(2 * k - 1 + delay, 0), 0, info(k, k)) for k, delay in enumerate(delays)]
    order = sorted(arrivals, key=lambda entry: (entry[0], entry[1]))
    own = [entry[2] for entry in order if entry[1] == 0]
    if [m.header.stamp.sec * 10**9 + m.header.stamp.nanosec for m in own] != [stamp(k) for k in range(count)]:
        return  # one topic keeps its order
    frames = CalibratedFrames()
    assert views(feed(frames, *(entry[2] for entry in order)) + frames.flush()) == [(k, k) for k in range(count)]


@pytest.mark.parametrize("index", [None, -7])
def test_latched_the_last_one_holds(index: int | None) -> None:
    frames = CalibratedFrames()
    found = feed(frames, info(index, 1), *(image(stamp(k)) for k in range(3)), info(index, 2), image(stamp(3)))
    assert views(found) == [(0, 1), (1, 1), (2, 1), (3, 2)]


def test_latched_heard_after_the_first_images() -> None:
    frames = CalibratedFrames()
    assert feed(frames, image(stamp(0)), image(stamp(1))) == []
    assert views(feed(frames, info(None, 3), image(stamp(2)))) == [(0, 3), (1, 3), (2, 3)]


@pytest.mark.parametrize("index", [0, -50, None])
@pytest.mark.parametrize("heard_twice", [False, True])
def test_of_a_latched_publisher_no_image_waits_whatever_the_stamp(index: int | None, heard_twice: bool) -> None:
    frames = CalibratedFrames()
    if heard_twice:  # a volatile subscription hears it as well
        frames.add_camera_info(info(index, 3))
    frames.add_camera_info(info(index, 3), latched=True)
    for k in range(4):
        assert views(feed(frames, image(stamp(k)))) == [(k, 3)]
    frames.add_camera_info(info(4, 5), latched=True)
    assert views(feed(frames, image(stamp(4)))) == [(4, 5)]


def test_a_latching_publisher_may_calibrate_every_frame() -> None:
    frames = CalibratedFrames()
    found = []
    for k in range(3):
        found += frames.add_camera_info(info(k, k), latched=True) + feed(frames, image(stamp(k)))
    for k in range(3, 6):  # two have shown it: from then on an image waits for its own
        found += feed(frames, image(stamp(k))) + frames.add_camera_info(info(k, k), latched=True)
    assert views(found) == [(k, k) for k in range(6)]


def test_the_first_image_waits_for_its_own_calibration_though_an_older_one_is_known() -> None:
    messages = [info(-1, 9), image(stamp(0)), info(0, 2), image(stamp(1)), info(1, 3)]
    assert views(feed(CalibratedFrames(), *messages)) == [(0, 2), (1, 3)]


def test_without_any_calibration_images_are_left_out_and_counted() -> None:
    frames = CalibratedFrames()
    assert feed(frames, *(image(stamp(k)) for k in range(10))) == []
    assert frames.counts.uncalibrated == 7  # 1 s at 3 images/s is waited for
    assert len(frames.take_complaints()) == 7


def test_a_lost_calibration_is_made_up_for_where_nothing_moved() -> None:
    messages = [info(0), image(stamp(0)), image(stamp(1)), info(2), image(stamp(2))]
    assert views(feed(CalibratedFrames(), *messages)) == [(0, 0), (1, 0), (2, 0)]


def test_a_lost_calibration_leaves_its_image_out_while_something_moves() -> None:
    frames = CalibratedFrames()
    messages = [info(0, 0), image(stamp(0)), image(stamp(1)), info(2, 5), image(stamp(2))]
    assert views(feed(frames, *messages)) == [(0, 0), (2, 5)]
    assert frames.take_complaints() == ["an image was left out: there is no calibration for it"]


def test_a_refused_calibration_is_not_replaced_by_an_older_one() -> None:
    frames = CalibratedFrames()
    bad = info(1)
    bad.d = np.array([0.5])
    assert views(feed(frames, info(0), image(stamp(0)), bad, image(stamp(1)), info(2), image(stamp(2)))) == [
        (0, 0),
        (2, 0),
    ]
    assert frames.counts.refused_calibrations == 1
    assert frames.counts.uncalibrated == 1
    latched = CalibratedFrames()
    bad.header.stamp.sec = bad.header.stamp.nanosec = 0
    assert views(feed(latched, info(None), image(stamp(0)), bad, image(stamp(1)))) == [(0, 0)]
    assert not latched.calibrated


def test_an_image_of_another_size_is_left_out() -> None:
    frames = CalibratedFrames()
    assert feed(frames, info(None), image(stamp(0), side=16)) == []
    (complaint,) = frames.take_complaints()
    assert "the calibration is for an image of 32×32" in complaint
    assert "16×16" in complaint


def test_when_calibrations_stop_the_last_one_holds() -> None:
    frames = CalibratedFrames()
    found = feed(frames, info(0, 4), *(image(stamp(k)) for k in range(6)))
    assert views(found + frames.flush()) == [(k, 4) for k in range(6)]


def test_a_recording_played_again_is_read_as_the_first_time() -> None:
    frames = CalibratedFrames()
    messages = [m for k in range(6) for m in (image(stamp(k)), info(k, k))]
    first, second = feed(frames, *messages), feed(frames, *messages)
    assert views(first) == views(second) == [(k, k) for k in range(6)]


def test_the_same_calibration_is_the_same_object() -> None:
    found = feed(CalibratedFrames(), *(m for k in range(3) for m in (info(k), image(stamp(k)))))
    assert found[0].projection is found[2].projection


def test_a_latched_camera_matrix_is_posed_at_each_image() -> None:
    """The C-arm turns by TF alone: the pose is that of the image's stamp, not of the calibration's."""
    full = projection("a")
    k, rotation, translation = full.decompose()
    plain = info(None)
    plain.p = np.column_stack([k, np.zeros(3)]).reshape(-1)
    asked: list[int] = []

    def extrinsics(frame_id: str, stamp_ns: int) -> np.ndarray:
        asked.append(stamp_ns)
        if stamp_ns == stamp(1):
            raise MessageError("TF does not know")
        pose = np.eye(4)
        pose[:3, :3], pose[:3, 3] = rotation, translation + 1e-3 * len(asked)
        return pose

    frames = CalibratedFrames(extrinsics)
    found = feed(frames, plain, *(image(stamp(k)) for k in range(4)))
    assert asked == [stamp(k) for k in range(4)]
    assert [frame.stamp_ns for frame in found] == [stamp(0), stamp(2), stamp(3)]
    assert not np.allclose(found[0].projection.matrix, found[1].projection.matrix)
    assert frames.take_complaints() == ["TF does not know"]
    assert frames.counts.uncalibrated == 1
