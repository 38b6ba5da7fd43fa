"""What the page shows of a live graph: picture and loop of one pair, never an older loop; latency; trace."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from support.drawn_recording import SIDE, loop, projections, shift, stamp
from support.stream_bench import MAKE, WORLD, StreamBench

from lasso_motion_ros.core.errors import ConfigurationError, MessageError
from lasso_motion_ros.geometry.transforms import apply
from lasso_motion_ros.web.motion_trace import TRACE_S
from msg_adapters import topics
from msg_adapters.markers import encode_line_strip
from msg_adapters.messages import header_fields
from msg_adapters.poses import encode_pose_stamped, encode_pose_with_covariance_stamped


@pytest.fixture
def bench() -> StreamBench:
    return StreamBench()


def test_before_there_is_a_pose_pictures_are_shown_at_once(bench: StreamBench) -> None:
    assert bench.shown() is None
    bench.stream.add_state("WAITING_FOR_SEED")
    bench.pair(1)
    assert bench.shown() == (1, False)


def test_a_pair_waits_for_its_own_loop_and_is_drawn_with_it(bench: StreamBench) -> None:
    bench.tracks()
    bench.pair(0)
    bench.catheter(0, 0.0)
    bench.pair(1)
    assert bench.shown() == (0, True)
    bench.catheter(1, 5.0)
    assert bench.shown() == (1, True)
    picture = bench.stream.picture("film")
    for plane, projection in projections().items():
        expected = projection.project(apply(shift(5.0), loop()))
        np.testing.assert_allclose(picture.planes[plane].loop, expected, atol=1e-9)


def test_without_an_answer_it_is_shown_late_and_without_any_loop(bench: StreamBench) -> None:
    bench.tracks()
    bench.pair(0)
    bench.catheter(0, 0.0)
    bench.pair(1)
    bench.now += 0.16
    before = bench.stream.picture("film").number
    assert bench.shown() == (1, False)
    bench.catheter(1, 0.0)
    assert bench.shown() == (1, True)
    assert bench.stream.picture("film").number != before  # so that the page gets it again


@pytest.mark.parametrize("state", ["LOST", "DISPLACED", "WAITING_FOR_SEED", "INACTIVE"])
def test_no_loop_in_a_state_without_a_pose(bench: StreamBench, state: str) -> None:
    bench.tracks()
    bench.pair(0)
    bench.catheter(0, 0.0)
    bench.stream.add_state(state)
    assert bench.shown() == (0, False)
    assert not bench.stream.status()["has_pose"]


@pytest.mark.parametrize("state", ["WAITING_FOR_SEED", "LOST", "DISPLACED"])
def test_a_proposed_ring_is_shown_while_there_is_none_to_follow_and_until_it_is_withdrawn(
    bench: StreamBench, state: str
) -> None:
    bench.stream.add_state(state)
    bench.pair(0)
    assert bench.shown() == (0, False)
    bench.proposal(0.0)
    assert bench.shown() == (0, True)
    assert bench.stream.status()["proposed"] == 1
    bench.stream.add_state("TRACKING")
    assert not bench.stream.status()["proposed"]
    bench.stream.add_state(state)
    bench.proposal(None)
    assert bench.shown() == (0, False)
    assert not bench.stream.status()["proposed"]
    with pytest.raises(MessageError, match="proposal is in frame 'map'"):
        bench.proposal(1.0, frame="map")


def test_half_a_pair_shows_the_plane_that_is_there(bench: StreamBench) -> None:
    for pair in range(4):
        bench.image("a", pair)
    assert set(bench.stream.picture("film").planes) == {"a"}


def test_a_held_pair_stays_and_has_no_loop_on_it(bench: StreamBench) -> None:
    bench.tracks()
    for pair in range(3):
        bench.pair(pair)
        bench.catheter(pair, 0.0)
    pairs = bench.stream.whole_pairs()
    bench.stream.hold(pairs, {"a": stamp(1), "b": stamp(1)})
    assert bench.held() == (1, False)
    assert bench.stream.picture("overlay", held=True).held
    bench.pair(3)
    assert bench.held() == (1, False)
    assert bench.shown() == (2, True)  # who looks on sees the stream
    held = bench.stream.picture("film", held=True).number
    bench.stream.release()
    bench.catheter(3, 0.0)
    assert bench.shown() == (3, True)
    assert bench.stream.picture("film").number > held
    bench.stream.hold(bench.stream.whole_pairs(), {"a": stamp(77), "b": stamp(77)})  # not among them: the newest
    assert bench.held() == (3, False)


def test_without_a_whole_pair_none_can_be_held(bench: StreamBench) -> None:
    bench.image("a", 0)
    with pytest.raises(MessageError, match="no image pair to click in"):
        bench.stream.hold(bench.stream.whole_pairs())


def test_a_new_run_forgets_the_loops_of_the_last_one_though_stamps_are_the_same(bench: StreamBench) -> None:
    bench.stream.add_state("TRACKING")
    for pair in range(8):
        bench.pair(pair)
        bench.catheter(pair, 0.0)
    for pair in range(2):
        bench.pair(pair)
    assert (bench.stream.new_runs, bench.stream.pairs_of_run) == (1, 2)
    bench.now += 1.0
    assert bench.shown() == (1, False)


def test_the_overlays_pictures_are_shown_while_they_keep_up(bench: StreamBench) -> None:
    bench.tracks()
    bench.pair(1)
    bench.catheter(1, 0.0)
    assert bench.shown("overlay") == (1, True)  # the film, there is nothing else yet
    bench.overlay("a", 1)
    assert bench.stream.picture("overlay").planes["a"].pixels.ndim == 2  # both planes or none
    bench.overlay("b", 1)
    assert bench.stream.picture("overlay").planes["a"].pixels.shape == (SIDE, SIDE, 3)
    assert bench.shown("overlay") == (1, True)
    for pair in range(2, 9):
        bench.pair(pair)
    bench.catheter(8, 0.0)
    assert bench.stream.picture("overlay").planes["a"].pixels.ndim == 2  # 1.75 s behind


def test_an_overlay_that_contradicts_the_headline_or_the_other_plane_is_not_shown(bench: StreamBench) -> None:
    bench.tracks()
    for pair in (1, 2, 3):
        bench.pair(pair)
        bench.catheter(pair, 0.0)
    for plane in "ab":
        bench.overlay(plane, 1)
        bench.static_overlay(plane, 3)
    bench.overlay("a", 2)
    bench.static_overlay("b", 2)
    assert bench.shown("overlay") == (1, True)  # the last of which both planes are compensated
    bench.stream.add_state("LOST")
    picture = bench.stream.picture("overlay")
    assert {one.stamp_ns for one in picture.planes.values()} == {stamp(3)}
    assert picture.planes["a"].pixels.ndim == 3
    bench.stream.add_state("TRACKING")
    bench.motion(4, 0.0)
    bench.now += 0.9
    assert bench.stream.status()["state"] == "TRACKING"
    bench.now += 0.2  # no pose any more
    assert bench.stream.status()["state"] != "TRACKING"
    assert {one.stamp_ns for one in bench.stream.picture("overlay").planes.values()} == {stamp(3)}


def test_an_overlay_that_is_drawn_anew_as_static_is_not_shown_as_it_was(bench: StreamBench) -> None:
    bench.tracks()
    bench.pair(1)
    bench.catheter(1, 0.0)
    for plane in "ab":
        bench.overlay(plane, 1)
    assert bench.stream.picture("overlay").planes["a"].pixels.ndim == 3
    bench.stream.add_state("LOST")
    for plane in "ab":
        bench.drawn(plane, 1, "")  # its picture is on the way
    assert bench.stream.picture("overlay").planes["a"].pixels.ndim == 2
    for plane in "ab":
        bench.static_overlay(plane, 1)
    assert bench.stream.picture("overlay").planes["a"].pixels.ndim == 3


@pytest.mark.parametrize("other", [{"encoding": "bgr8"}, {"step": 3 * SIDE + 1}, {"height": SIDE - 1}])
def test_an_overlay_of_another_kind_is_refused(bench: StreamBench, other: dict[str, Any]) -> None:
    with pytest.raises(MessageError, match="overlay"):
        bench.overlay("a", 0, **other)


def test_another_frame_is_refused(bench: StreamBench) -> None:
    with pytest.raises(MessageError, match="motion is in frame 'map', expected 'patient_table'"):
        bench.motion(0, 1.0, frame="map")
    with pytest.raises(MessageError, match="catheter is in frame 'map'"):
        bench.catheter(0, 1.0, frame="map")
    assert bench.stream.trace(0) == []


def test_latency_is_of_pairs_that_came_while_there_was_a_pose(bench: StreamBench) -> None:
    bench.pair(0)
    bench.now += 30.0  # someone clicks
    bench.stream.add_state("TRACKING")
    bench.motion(0, 0.0)
    assert bench.stream.status()["latency_ms"] is None
    for pair, took in ((1, 0.010), (2, 0.020), (3, 0.060)):
        bench.pair(pair)
        bench.now += took
        bench.motion(pair, 0.0)
    assert bench.stream.status()["latency_ms"] == pytest.approx(20.0)
    assert bench.stream.status()["worst_latency_ms"] == pytest.approx(60.0)


def test_the_trace_has_each_pose_at_its_images_time_a_gap_at_a_loss_and_30_s(bench: StreamBench) -> None:
    bench.stream.add_state("TRACKING")
    bench.pair(0)
    bench.now += 0.5
    bench.motion(0, 4.0)
    bench.stream.add_state("LOST")
    first, gap = bench.stream.trace(0)
    assert (first.time_s, gap.time_s, gap.shift_mm) == (100.0, 100.5, None)
    assert first.shift_mm == pytest.approx((0.0, 0.0, 4.0))
    assert bench.stream.trace(first.number) == [gap]
    bench.now += TRACE_S - 0.25
    assert bench.stream.trace(0) == [gap]


def test_a_turn_about_the_worlds_origin_counts_as_what_it_moves_the_loop(bench: StreamBench) -> None:
    bench.stream.add_state("TRACKING")
    turn = np.array([[0, -1, 0, 0], [1, 0, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1.0]])
    away = loop() + np.array([0.05, 0.0, 0.0])
    for pair in (0, 1):
        header = header_fields(stamp(pair), WORLD)
        self_motion = MAKE(topics.MOTION.type_name, encode_pose_stamped(turn, header))
        bench.stream.add_motion(self_motion)
        fields = encode_line_strip(apply(turn, away), header, "c")
        bench.stream.add_catheter(MAKE(topics.CATHETER.type_name, fields))
    # The ring's centre goes from (50, 0, 0) mm to (0, 50, 0) mm.
    assert bench.stream.trace(0)[-1].shift_mm == pytest.approx((-50.0, 50.0, 0.0), abs=0.2)


def test_planes_are_named_by_their_angles_so_that_exchanged_calibrations_are_seen(bench: StreamBench) -> None:
    assert bench.stream.status()["angles"] == {"a": None, "b": None}
    bench.pair(0)
    assert bench.stream.status()["angles"] == {"a": "RAO 30°", "b": "LAO 60°"}
    assert bench.stream.status()["axes"] == ("left", "posterior", "head")
    bench.image("a", 1, calibration="b")
    bench.image("b", 1, calibration="a")
    assert bench.stream.status()["angles"] == {"a": "LAO 60°", "b": "RAO 30°"}
    assert bench.stream.status()["axes"] == ("left", "posterior", "head")


def test_nothing_is_named_where_the_worlds_axes_are_not_known(bench: StreamBench) -> None:
    bench.image("a", 0)
    unnamed = {"axes": None, "angles": {"a": None, "b": None}}
    assert bench.stream.status() | unnamed == bench.stream.status()  # one calibration is too little
    bench.pair(1)
    bench.diagnostics("/lasso_tracker: tracker", "TRACKING", **{topics.POSTURE_KEY: "prone"})
    assert bench.stream.status() | unnamed == bench.stream.status()
    told_nothing, told = StreamBench("unknown"), StreamBench("RAS")
    for one in (told_nothing, told):
        one.pair(0)
    assert told_nothing.stream.status() | unnamed == told_nothing.stream.status()
    assert told.stream.status()["axes"] == ("right", "anterior", "head")
    assert told.stream.status()["angles"] == {"a": "LAO 150°", "b": "RAO 120°"}  # as it was told, so it is seen
    with pytest.raises(ConfigurationError, match="axes: expected"):
        StreamBench("LPX")


def test_sigma_is_of_the_loops_place_in_its_worst_direction_and_goes_with_the_pose(bench: StreamBench) -> None:
    def cover(pair: int) -> None:
        # 0.3 mm along z, and 1 mrad about y: the loop's centre is 0.4 m from the origin along x.
        spread = np.diag([0.1e-3, 0.1e-3, 0.3e-3, 0.0, 1e-3, 0.0]) ** 2
        fields = encode_pose_with_covariance_stamped(shift(2.0), spread, header_fields(stamp(pair), WORLD))
        bench.stream.add_motion_with_covariance(MAKE(topics.MOTION_WITH_COVARIANCE.type_name, fields))

    bench.stream.add_state("TRACKING")
    for pair in (0, 1):
        bench.motion(pair, 2.0)
        cover(pair)
        assert bench.stream.status()["sigma_mm"] == (None, 0.5)[pair]  # the loop comes behind
        points = apply(shift(2.0), loop() - loop()[:-1].mean(axis=0) + np.array([0.4, 0.0, -0.002]))
        fields = encode_line_strip(points, header_fields(stamp(pair), WORLD), "c")
        bench.stream.add_catheter(MAKE(topics.CATHETER.type_name, fields))
    bench.motion(6, 2.0)  # 1.25 s later, and nobody says how sure it is
    assert bench.stream.status()["sigma_mm"] is None
    cover(6)
    assert bench.stream.status()["sigma_mm"] == 0.5
    bench.stream.add_state("LOST")
    assert bench.stream.status()["sigma_mm"] is None
