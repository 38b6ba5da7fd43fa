"""What the page shows of a live graph: picture and loop of one pair, never an older loop; silence; latency; trace."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from support.drawn_recording import SIDE, loop, projections, shift, stamp

from lasso_motion_ros.config.stream import SyncConfig
from lasso_motion_ros.config.web import WebConfig
from lasso_motion_ros.core.errors import ConfigurationError, MessageError
from lasso_motion_ros.geometry.transforms import apply
from lasso_motion_ros.overlay.primitives import draw_banner
from lasso_motion_ros.web.live_stream import LiveStream
from lasso_motion_ros.web.motion_trace import TRACE_S
from msg_adapters import topics
from msg_adapters.calibrations import encode_camera_info
from msg_adapters.images import encode_image
from msg_adapters.markers import encode_delete, encode_line_strip
from msg_adapters.messages import header_fields
from msg_adapters.poses import encode_pose_stamped, encode_pose_with_covariance_stamped
from msg_adapters.recorded_messages import RecordedMessages
from msg_adapters.sync.plane_source import plane_sources

WORLD = "patient_table"
MAKE = RecordedMessages().make


class Bench:
    """A view with a clock that is set by hand."""

    def __init__(self, axes: str = "auto") -> None:
        self.now = 100.0
        self.stream = LiveStream(
            SyncConfig(), plane_sources(WebConfig()), "lasso_tracker", WORLD, 0.15, axes, clock=lambda: self.now
        )

    def image(self, plane: str, pair: int, calibration: str = "", shown: int | None = None) -> None:
        header = header_fields(stamp(pair), f"detector_{plane}")
        info = encode_camera_info(projections()[calibration or plane], header)
        assert self.stream.add_camera_info(plane, MAKE(topics.camera_info_topic(plane).type_name, info)) == []
        pixels = np.full((SIDE, SIDE), pair if shown is None else shown, np.uint8)
        assert self.stream.add_image(plane, MAKE(topics.IMAGE_TYPE, encode_image(pixels, header))) == []

    def pair(self, pair: int) -> None:
        self.image("a", pair)
        self.image("b", pair)

    def motion(self, pair: int, z_mm: float, frame: str = WORLD) -> None:
        fields = encode_pose_stamped(shift(z_mm), header_fields(stamp(pair), frame))
        self.stream.add_motion(MAKE(topics.MOTION.type_name, fields))

    def tracks(self) -> None:
        """A pose that belongs to no pair of the test."""
        self.stream.add_state("TRACKING")
        self.motion(1000, 0.0)

    def catheter(self, pair: int, z_mm: float | None, frame: str = WORLD) -> None:
        header = header_fields(stamp(pair), frame)
        points = apply(shift(z_mm or 0.0), loop())
        fields = encode_delete(header, "c") if z_mm is None else encode_line_strip(points, header, "c")
        self.stream.add_catheter(MAKE(topics.CATHETER.type_name, fields))

    def proposal(self, z_mm: float | None, frame: str = WORLD) -> None:
        header = header_fields(stamp(0), frame)
        points = apply(shift(z_mm or 0.0), loop())
        fields = encode_delete(header, "c") if z_mm is None else encode_line_strip(points, header, "c")
        self.stream.add_proposal(MAKE(topics.PROPOSAL.type_name, fields))

    def diagnostics(self, name: str, message: str, **values: str) -> None:
        entries = [{"key": key, "value": value} for key, value in values.items()]
        status = {"name": name, "message": message, "values": entries}
        self.stream.add_diagnostics(MAKE(topics.DIAGNOSTICS.type_name, {"status": [status]}))

    def overlay(self, plane: str, pair: int, **other: Any) -> None:
        fields = encode_image(np.full((SIDE, SIDE, 3), pair, np.uint8), header_fields(stamp(pair)))
        self.drawn(plane, pair, WORLD)
        self._overlay(plane, fields, **other)

    def static_overlay(self, plane: str, pair: int) -> None:
        """In grey words: a colour is not what tells it from the other."""
        picture = np.full((SIDE, SIDE, 3), pair, np.uint8)
        draw_banner(picture, "STATIC OVERLAY", (176, 176, 176))
        self._overlay(plane, encode_image(picture, header_fields(stamp(pair))))
        self.drawn(plane, pair, "")

    def drawn(self, plane: str, pair: int, frame: str) -> None:
        message = MAKE(topics.overlay_drawn_topic(plane).type_name, header_fields(stamp(pair), frame))
        self.stream.add_overlay_drawn(plane, message)

    def _overlay(self, plane: str, fields: dict[str, Any], **other: Any) -> None:
        self.stream.add_overlay(plane, MAKE(topics.IMAGE_TYPE, {**fields, **other}))

    def said(self) -> tuple[str, bool]:
        status = self.stream.status()
        return status["state"], status["has_pose"]

    def held(self) -> tuple[int, bool] | None:
        return self.shown(held=True)

    def shown(self, view: str = "film", *, held: bool = False) -> tuple[int, bool] | None:
        """Grey value of plane A's picture, which is its pair, and whether a loop is drawn."""
        picture = self.stream.picture(view, held=held)
        return (
            None if picture is None else (int(picture.planes["a"].pixels.flat[0]), picture.planes["a"].loop is not None)
        )


@pytest.fixture
def bench() -> Bench:
    return Bench()


def test_before_there_is_a_pose_pictures_are_shown_at_once(bench: Bench) -> None:
    assert bench.shown() is None
    bench.stream.add_state("WAITING_FOR_SEED")
    bench.pair(1)
    assert bench.shown() == (1, False)


def test_a_pair_waits_for_its_own_loop_and_is_drawn_with_it(bench: Bench) -> None:
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


def test_without_an_answer_it_is_shown_late_and_without_any_loop(bench: Bench) -> None:
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
def test_no_loop_in_a_state_without_a_pose(bench: Bench, state: str) -> None:
    bench.tracks()
    bench.pair(0)
    bench.catheter(0, 0.0)
    bench.stream.add_state(state)
    assert bench.shown() == (0, False)
    assert not bench.stream.status()["has_pose"]


def test_a_proposed_ring_is_shown_while_the_tracker_waits_for_clicks_and_until_it_is_withdrawn(bench: Bench) -> None:
    bench.stream.add_state("WAITING_FOR_SEED")
    bench.pair(0)
    assert bench.shown() == (0, False)
    bench.proposal(0.0)
    assert bench.shown() == (0, True)
    assert bench.stream.status()["proposed"]
    bench.stream.add_state("LOST")
    assert bench.shown() == (0, False)
    bench.stream.add_state("WAITING_FOR_SEED")
    bench.proposal(None)
    assert bench.shown() == (0, False)
    assert not bench.stream.status()["proposed"]
    with pytest.raises(MessageError, match="proposal is in frame 'map'"):
        bench.proposal(1.0, frame="map")


def test_half_a_pair_shows_the_plane_that_is_there(bench: Bench) -> None:
    for pair in range(4):
        bench.image("a", pair)
    assert set(bench.stream.picture("film").planes) == {"a"}


def test_a_held_pair_stays_and_has_no_loop_on_it(bench: Bench) -> None:
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


def test_without_a_whole_pair_none_can_be_held(bench: Bench) -> None:
    bench.image("a", 0)
    with pytest.raises(MessageError, match="no image pair to click in"):
        bench.stream.hold(bench.stream.whole_pairs())


def test_a_new_run_forgets_the_loops_of_the_last_one_though_stamps_are_the_same(bench: Bench) -> None:
    bench.stream.add_state("TRACKING")
    for pair in range(8):
        bench.pair(pair)
        bench.catheter(pair, 0.0)
    for pair in range(2):
        bench.pair(pair)
    assert (bench.stream.new_runs, bench.stream.pairs_of_run) == (1, 2)
    bench.now += 1.0
    assert bench.shown() == (1, False)


def test_the_overlays_pictures_are_shown_while_they_keep_up(bench: Bench) -> None:
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


def test_an_overlay_that_contradicts_the_headline_or_the_other_plane_is_not_shown(bench: Bench) -> None:
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


def test_an_overlay_that_is_drawn_anew_as_static_is_not_shown_as_it_was(bench: Bench) -> None:
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


def test_a_state_that_nobody_has_renewed_is_no_state(bench: Bench) -> None:
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


def test_a_tracker_that_waits_is_heard_by_its_diagnostics(bench: Bench) -> None:
    bench.stream.add_state("WAITING_FOR_SEED")
    for _ in range(5):
        bench.now += 1.0
        bench.diagnostics("/lasso_tracker: tracker", "WAITING_FOR_SEED: no seed yet")
        assert bench.said()[0] == "WAITING_FOR_SEED"
    bench.now += 2.6
    assert bench.said()[0] == "TRACKER_SILENT"


def test_at_a_slow_rate_a_pose_is_fresh_for_longer(bench: Bench) -> None:
    for pair in range(0, 16, 4):
        bench.now += 1.0
        bench.pair(pair)
    bench.tracks()
    bench.now += 2.5
    assert bench.said() == ("TRACKING", True)
    bench.diagnostics("/lasso_tracker: tracker", "TRACKING")
    bench.now += 2.4
    assert bench.said()[0] == "NO_IMAGES"


def test_images_that_end_and_come_again_are_one_alarm(bench: Bench) -> None:
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


def test_images_that_end_in_one_plane_a_moment_earlier_are_one_alarm(bench: Bench) -> None:
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
def test_a_held_picture_is_no_image(bench: Bench, planes: str, state: str, alarm: str) -> None:
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


def test_a_plane_that_this_page_alone_does_not_get_is_said_so(bench: Bench) -> None:
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


@pytest.mark.parametrize("other", [{"encoding": "bgr8"}, {"step": 3 * SIDE + 1}, {"height": SIDE - 1}])
def test_an_overlay_of_another_kind_is_refused(bench: Bench, other: dict[str, Any]) -> None:
    with pytest.raises(MessageError, match="overlay"):
        bench.overlay("a", 0, **other)


def test_another_frame_is_refused(bench: Bench) -> None:
    with pytest.raises(MessageError, match="motion is in frame 'map', expected 'patient_table'"):
        bench.motion(0, 1.0, frame="map")
    with pytest.raises(MessageError, match="catheter is in frame 'map'"):
        bench.catheter(0, 1.0, frame="map")
    assert bench.stream.trace(0) == []


def test_silence_is_counted_from_the_last_image(bench: Bench) -> None:
    assert bench.stream.status()["stopped_s"] == {"a": None, "b": None}
    for pair in range(4):
        bench.now += 0.25
        bench.image("a", pair)
    bench.now += 0.9
    assert bench.stream.status()["stopped_s"] == {"a": None, "b": None}
    bench.now += 3.1
    assert bench.stream.status()["stopped_s"] == {"a": 4, "b": None}
    assert bench.stream.status()["seen"] == {"a": True, "b": False}


def test_at_one_image_a_second_two_seconds_are_no_silence(bench: Bench) -> None:
    for pair in range(0, 16, 4):
        bench.now += 1.0
        bench.image("a", pair)
    bench.now += 2.0
    assert bench.stream.status()["stopped_s"]["a"] is None


def test_latency_is_of_pairs_that_came_while_there_was_a_pose(bench: Bench) -> None:
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


def test_the_trace_has_each_pose_at_its_images_time_a_gap_at_a_loss_and_30_s(bench: Bench) -> None:
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


def test_a_turn_about_the_worlds_origin_counts_as_what_it_moves_the_loop(bench: Bench) -> None:
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


def test_the_reason_is_the_trackers_own_and_of_this_state(bench: Bench) -> None:
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


def test_planes_are_named_by_their_angles_so_that_exchanged_calibrations_are_seen(bench: Bench) -> None:
    assert bench.stream.status()["angles"] == {"a": None, "b": None}
    bench.pair(0)
    assert bench.stream.status()["angles"] == {"a": "RAO 30°", "b": "LAO 60°"}
    assert bench.stream.status()["axes"] == ("left", "posterior", "head")
    bench.image("a", 1, calibration="b")
    bench.image("b", 1, calibration="a")
    assert bench.stream.status()["angles"] == {"a": "LAO 60°", "b": "RAO 30°"}
    assert bench.stream.status()["axes"] == ("left", "posterior", "head")


def test_nothing_is_named_where_the_worlds_axes_are_not_known(bench: Bench) -> None:
    bench.image("a", 0)
    unnamed = {"axes": None, "angles": {"a": None, "b": None}}
    assert bench.stream.status() | unnamed == bench.stream.status()  # one calibration is too little
    bench.pair(1)
    bench.diagnostics("/lasso_tracker: tracker", "TRACKING", **{topics.POSTURE_KEY: "prone"})
    assert bench.stream.status() | unnamed == bench.stream.status()
    told_nothing, told = Bench("unknown"), Bench("RAS")
    for one in (told_nothing, told):
        one.pair(0)
    assert told_nothing.stream.status() | unnamed == told_nothing.stream.status()
    assert told.stream.status()["axes"] == ("right", "anterior", "head")
    assert told.stream.status()["angles"] == {"a": "LAO 150°", "b": "RAO 120°"}  # as it was told, so it is seen
    with pytest.raises(ConfigurationError, match="axes: expected"):
        Bench("LPX")


def test_sigma_is_of_the_loops_place_in_its_worst_direction_and_goes_with_the_pose(bench: Bench) -> None:
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
