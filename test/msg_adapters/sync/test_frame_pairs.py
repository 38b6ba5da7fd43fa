"""Pairs of calibrated frames: decided by the images' stamps, whenever the calibrations come."""

from __future__ import annotations

import random
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from support.message_inputs import START_NS, camera_info, image, projection

from lasso_motion_ros.geometry.frames import Frame, FramePair, Plane
from msg_adapters.sync.frame_pairs import FramePairs
from msg_adapters.sync.partner import PartnerRule

PERIOD_NS = 66_666_667
TURN = 1e-3
Message = tuple[Plane, str, Any]


def at(index: int) -> int:
    return START_NS + index * PERIOD_NS


def info(plane: Plane, index: int) -> Message:
    """The calibration of a frame of a gantry that turns: no two are equal."""
    matrix = projection(plane).matrix.copy()
    matrix[0] += TURN * index * matrix[2]
    return plane, "info", camera_info(plane, at(index), p=matrix.reshape(-1))


def picture(plane: Plane, index: int) -> Message:
    return plane, "image", image(at(index))


def feed(pairs: FramePairs, *messages: Message) -> list[FramePair]:
    found = []
    for plane, kind, message in messages:
        found += pairs.add_image(plane, message) if kind == "image" else pairs.add_camera_info(plane, message)
    return found


def indices(found: list[FramePair]) -> list[tuple[int | None, int | None]]:
    """Which frames the pairs are of; each with its own calibration."""
    return [(_index("a", pair.a), _index("b", pair.b)) for pair in found]


def _index(plane: Plane, frame: Frame | None) -> int | None:
    if frame is None:
        return None
    index = round((frame.stamp_ns - START_NS) / PERIOD_NS)
    start = projection(plane).matrix
    turned = float((frame.projection.matrix - start)[0, 3] / (TURN * start[2, 3]))
    np.testing.assert_allclose(turned, index, atol=1e-6)
    return index


def test_calibrations_that_come_nine_frames_late_cost_no_pair() -> None:
    """As a reliable publisher behaves whose small messages were pushed out: all at once, when they are sent again."""
    pairs = FramePairs(PartnerRule())
    messages = [message for k in range(3) for plane in "ab" for message in (info(plane, k), picture(plane, k))]
    messages += [message for k in range(3, 13) for message in (info("b", k), picture("a", k), picture("b", k))]
    assert indices(feed(pairs, *messages)) == [(k, k) for k in range(3)]
    assert indices(feed(pairs, *(info("a", k) for k in range(3, 13)))) == [(k, k) for k in range(3, 13)]
    assert pairs.pairing.counts["a"].paired == pairs.pairing.counts["b"].paired == 13


def test_an_image_without_calibration_leaves_the_other_plane_alone_at_once() -> None:
    pairs = FramePairs(PartnerRule())
    feed(pairs, *(message for plane in "ab" for message in (info(plane, 0), picture(plane, 0))))
    bad = info("a", 1)
    bad[2].d = np.array([0.5])
    assert feed(pairs, bad, picture("a", 1)) == []
    assert indices(feed(pairs, info("b", 1), picture("b", 1))) == [(None, 1)]
    assert pairs.frames["a"].counts.uncalibrated == 1


def test_a_new_run_is_said_with_its_first_pair_that_is_left() -> None:
    pairs = FramePairs(PartnerRule())
    feed(pairs, *(message for k in range(30, 33) for plane in "ab" for message in (info(plane, k), picture(plane, k))))
    bad: list[Message] = [info(plane, 0) for plane in "ab"]
    for _, _, message in bad:
        message.d = np.array([0.5])
    first = feed(pairs, *bad, *(picture(plane, 0) for plane in "ab"))
    found = feed(pairs, *(message for plane in "ab" for message in (info(plane, 1), picture(plane, 1))))
    assert first == []
    assert indices(found) == [(1, 1)]
    assert [pair.new_run for pair in found] == [True]


def test_images_that_wait_for_their_calibration_do_not_hold_up_a_new_run() -> None:
    pairs = FramePairs(PartnerRule())
    feed(pairs, *(message for k in range(30, 33) for plane in "ab" for message in (info(plane, k), picture(plane, k))))
    feed(pairs, picture("a", 33), info("b", 33), picture("b", 33))
    found = feed(pairs, *(message for plane in "ab" for message in (info(plane, 0), picture(plane, 0))))
    assert indices(found) == [(None, 33), (0, 0)]
    assert [pair.new_run for pair in found] == [False, True]


def test_a_plane_that_stops_before_its_last_calibration_does_not_hold_up_the_other() -> None:
    pairs = FramePairs(PartnerRule())
    feed(pairs, *(message for k in range(3) for plane in "ab" for message in (info(plane, k), picture(plane, k))))
    found = feed(pairs, picture("b", 3))
    for k in range(3, 43):
        found += feed(pairs, info("a", k), picture("a", k))
    assert len(found) > 30
    # The first takes the last calibration that B had; then A goes on alone, a few images behind.
    assert indices(found[1:]) == [(k, None) for k in range(4, 3 + len(found))]


def test_what_waits_for_calibrations_is_bounded_whatever_the_stamps() -> None:
    """B's last image without calibration; A's stamps stand almost still."""
    pairs = FramePairs(PartnerRule())
    feed(pairs, *(message for k in range(3) for plane in "ab" for message in (info(plane, k), picture(plane, k))))
    feed(pairs, picture("a", 3), info("a", 3), picture("b", 3))
    given_out = 0
    for k in range(1000):
        stamp_ns = at(3) + 10_000 + 1_000 * k
        calibration = ("a", "info", camera_info("a", stamp_ns))
        given_out += len(feed(pairs, calibration, ("a", "image", image(stamp_ns))))
    assert given_out > 800


@pytest.mark.slow
@given(st.integers(0, 2**32 - 1), st.integers(0, 9))
@settings(max_examples=25, deadline=None)
def test_any_lateness_up_to_nine_frames_changes_no_pair(seed: int, latest: int) -> None:
    generator, count = random.Random(seed), 24
    arrivals = []
    for topic, (plane, make) in enumerate((plane, make) for plane in "ab" for make in (info, picture)):
        delayed = 0.0
        for k in range(count):
            # Each topic keeps its order; what calibrations may, images may up to half as long.
            late = generator.random() * latest * (1.0 if make is info else 0.5)
            delayed = max(delayed, k + late if k > 0 else 0.0)
            arrivals.append((delayed, topic, k, make(plane, k)))
    arrivals.sort(key=lambda arrival: arrival[:3])
    pairs = FramePairs(PartnerRule())
    found = feed(pairs, *(message for *_, message in arrivals)) + pairs.flush()
    assert indices(found) == [(k, k) for k in range(count)]


def test_a_frame_of_a_waits_for_b_once_it_has_its_calibration() -> None:
    pairs = FramePairs(PartnerRule())
    feed(pairs, *(message for plane in "ab" for message in (info(plane, 0), picture(plane, 0))))
    told = []
    for message in (picture("a", 1), info("a", 1), picture("b", 1), info("b", 1)):
        found = feed(pairs, message)
        told.append(pairs.waiting_a)
    assert told[0] is None
    assert told[1] is found[0].a
    assert told[2:] == [None, None]


def test_while_a_pair_waits_for_its_calibrations_no_later_frame_is_the_next() -> None:
    pairs = FramePairs(PartnerRule())
    feed(pairs, *(message for plane in "ab" for message in (info(plane, 0), picture(plane, 0))))
    feed(pairs, picture("a", 1), info("a", 1), picture("b", 1), picture("a", 2), info("a", 2))
    assert pairs.waiting_a is None
    assert indices(feed(pairs, info("b", 1))) == [(1, 1)]
    assert pairs.waiting_a is not None
