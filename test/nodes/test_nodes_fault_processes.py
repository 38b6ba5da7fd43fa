"""What can go wrong with processes, parameters and publishers around the tracker; each in a graph of its own."""

from __future__ import annotations

import signal
import threading
from pathlib import Path

import numpy as np
import pytest
import yaml

pytest.importorskip("rclpy", reason="needs ROS 2")

from geometry_msgs.msg import Point
from lifecycle_msgs.msg import State, Transition
from lifecycle_msgs.srv import ChangeState, GetState
from rcl_interfaces.msg import Parameter, ParameterType, ParameterValue
from rcl_interfaces.srv import SetParameters, SetParametersAtomically
from std_srvs.srv import SetBool, Trigger
from support.child_processes import signal_while_stopped
from support.node_harness import Graph
from support.ring_stream import HEARD, SIDE, RingStream, diagnosed, displacement_mm, stamp, start_tracker

from lasso_motion_ros.geometry.frames import PLANES
from lasso_motion_ros.stream.drawn_ring import ring_seed
from msg_adapters import topics
from msg_adapters.messages import stamp_to_ns

pytestmark = pytest.mark.ros
PICTURES = tuple(topics.tracking_topic(plane) for plane in "ab")


def test_a_tracker_that_is_killed_and_restarted_waits_for_a_seed(tmp_path: Path) -> None:
    with Graph(HEARD, tmp_path) as graph:
        stream = RingStream(graph)
        start_tracker(graph, name="killed")
        stream.connect()
        stream.seeded()
        graph.processes.send("killed", signal.SIGKILL)
        assert graph.wait_for_end("killed") == -signal.SIGKILL
        before = {name: len(graph.heard.messages[name]) for name in ("motion", "reference")}
        tracked, known = stamp(stream.number - 1), stream.listeners()
        start_tracker(graph)
        graph.wait_until(lambda: all(len(now - known[n]) >= len(known[n]) for n, now in stream.listeners().items()))
        stream.pairs(3)
        stream.await_state("WAITING_FOR_SEED")
        assert set(stream.states_since(tracked)) <= {
            "INACTIVE", "WAITING_FOR_CALIBRATION", "WAITING_FOR_SEED",
        }  # fmt: skip
        assert len(graph.heard.messages["motion"]) == before["motion"]
        assert len(graph.heard.messages["reference"]) == before["reference"]
        stream.seeded()
        stream.nothing_wrong()


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_that_comes_while_the_process_is_stopped_ends_it(tmp_path: Path, number: signal.Signals) -> None:
    """Ctrl-Z, then `kill %1`: the shell sends SIGTERM, then SIGCONT."""
    with Graph(HEARD, tmp_path) as graph:
        child = graph.processes.start_node("tracker", "lasso_tracker")
        graph.heard.wait_for(lambda: len(graph.heard.messages["state"]) > 2)  # it is up, and its main thread waits
        signal_while_stopped(child, number)
        assert graph.wait_for_end("tracker", 20.0) == 0
        graph.heard.wait_for(lambda: graph.heard.messages["state"][-1].data == "INACTIVE")


def test_a_publisher_that_is_killed_and_comes_again(tmp_path: Path) -> None:
    """Its stamps begin anew: a new run, which needs a seed of its own, and has one."""
    from support.drawn_recording import stamp as recorded_stamp
    from support.drawn_recording import write_input

    motions = [0.0, 1.0, 3.0, 5.0, 6.0, 5.0, 3.0, 1.0, 0.0, 1.0]
    recording = write_input(tmp_path / "ring.mcap", motions, truth=False)
    # Longer, so that it is still being played when it is to be killed, however late its pairs are answered.
    longer = write_input(tmp_path / "longer.mcap", motions * 12, truth=False)
    with Graph(HEARD, tmp_path) as graph:
        start_tracker(graph)
        heard = graph.heard.messages["motion"]
        graph.processes.start("killed", "lasso_motion_ros.cli.main", ["play", str(longer), "--wait", "30"])
        graph.heard.wait_for(lambda: len(heard) >= 6)
        graph.processes.send("killed", signal.SIGKILL)
        assert graph.wait_for_end("killed") == -signal.SIGKILL
        graph.heard.wait_for(lambda: diagnosed(graph, "plane_a").get("message", "").startswith("no images for "))
        before = len(heard)
        graph.processes.start("player", "lasso_motion_ros.cli.main", ["play", str(recording), "--wait", "30"])
        graph.heard.wait_for(lambda: len(heard) >= before + len(motions))
        assert graph.wait_for_end("player") == 0
        assert "a new run, which needs a seed of its own" in graph.processes.log("tracker", 100)
        again = graph.heard.messages["motion"][-len(motions) :]
        assert [stamp_to_ns(message.header.stamp) for message in again] == [
            recorded_stamp(pair) for pair in range(len(motions))
        ]
        np.testing.assert_allclose([1e3 * message.pose.position.z for message in again], motions, atol=0.5)


def test_images_without_a_stamp_are_tracked_by_their_arrival(tmp_path: Path) -> None:
    def unstamped(fields: dict) -> dict:
        return fields | {"header": fields["header"] | {"stamp": {"sec": 0, "nanosec": 0}}}

    with Graph(HEARD, tmp_path) as graph:
        stream = RingStream(graph)
        # On a busy machine a pair's two images come some time apart, and nothing but the next pair could tell more.
        start_tracker(graph, "stamp_source:=arrival", "sync.jitter_s:=0.05")
        stream.connect()
        for plane in PLANES:
            stream.frame(plane, 0, spoil_image=lambda fields: None, spoil_info=unstamped)
        stream.await_state("WAITING_FOR_SEED")
        stream.clicks(0)
        motions = graph.heard.messages["motion"]
        while len(motions) < 6:
            # One after the other: what comes together has no time of its own to be told apart by.
            threading.Event().wait(0.15)  # a stream's period: what comes together is one pair
            answered, posed = len(stream.states()), len(motions)
            stream.pairs(1, spoil_image=unstamped, spoil_info=unstamped)
            graph.heard.wait_for(lambda answered=answered: len(stream.states()) > answered)
            if stream.states()[-1:] == ["TRACKING"]:
                graph.heard.wait_for(lambda posed=posed: len(motions) > posed)
            assert stream.number < 12, stream.states()
        # The clicks may have been overtaken by the first pairs, on topics of their own.
        first = stream.number - len(motions)
        for number, message in enumerate(motions, first):
            position = message.pose.position
            expected = displacement_mm(stamp(number)) - displacement_mm(stamp(first))
            np.testing.assert_allclose(1e3 * np.array([position.x, position.y, position.z]), expected, atol=0.5)
        stamps = [stamp_to_ns(message.header.stamp) for message in motions]
        assert stamps == sorted(set(stamps))


def test_a_known_offset_pairs_what_is_more_than_half_a_period_apart(tmp_path: Path) -> None:
    """B follows its A by 80 of 100 ms: without the known offset it belongs to none."""
    behind_ns = 80_000_000
    with Graph(HEARD, tmp_path) as graph:
        stream = RingStream(graph)
        start_tracker(graph, "sync.plane_b_offset_s:=0.08")
        stream.connect()
        stream.clicks({"a": stamp(0), "b": stamp(0) + behind_ns})
        for number in range(8):
            stream.frame("a", number)
            stream.frame("b", number, stamp_ns=stamp(number) + behind_ns)
        stream.expect([stamp(number) for number in range(8)])
        stream.await_count("plane_b", "paired", 8)
        stream.nothing_wrong()


def test_a_best_effort_publisher_that_loses_images_is_named_with_the_cure(tmp_path: Path) -> None:
    with Graph(HEARD, tmp_path) as graph:
        stream = RingStream(graph, reliable=False)
        start_tracker(graph)
        stream.connect()
        graph.heard.wait_for(lambda: stream.values("plane_a").get("subscribed") == "best effort")
        for number in range(48):  # all but every third are lost on the way
            lost = {"spoil_image": lambda fields: None, "spoil_info": lambda fields: None} if number % 3 == 1 else {}
            stream.pairs(1, **lost)
            if number % 6 == 5:
                stream.await_count("plane_a", "images", stream.number // 2)
        stream.said("of the last ")
        said = graph.processes.log("tracker", 100)
        assert "images are missing: /lasso_listener publishes best effort" in said
        assert "FASTRTPS_DEFAULT_PROFILES_FILE" in said


def test_a_reliable_subscription_to_a_best_effort_publisher_is_named(tmp_path: Path) -> None:
    with Graph(HEARD, tmp_path) as graph:
        RingStream(graph, reliable=False)
        start_tracker(graph, "image_reliability:=reliable")
        graph.wait_until(
            lambda: "plane_a/image_raw: /lasso_listener publishes best effort" in graph.processes.log("tracker", 100)
        )


def test_what_nobody_publishes_is_named_and_what_has_no_calibration_is_named_and_shown_as_it_is(tmp_path: Path) -> None:
    with Graph((*PICTURES, *HEARD), tmp_path) as graph:
        start_tracker(graph)
        graph.wait_until(lambda: "plane_b/camera_info: nobody publishes it" in graph.processes.log("tracker", 100))
        said = graph.processes.log("tracker", 100)
        assert all(f"plane_{plane}/image_raw: nobody publishes it" in said for plane in "ab")
        stream = RingStream(graph)
        stream.connect()
        named = "plane_a/camera_info: images have come for"
        while named not in graph.processes.log("tracker", 500):
            stream.pairs(1, spoil_info=lambda fields: None)
            stream.await_count("plane_a", "images", stream.number)
            assert stream.number < 60
        assert said.count("plane_a/image_raw: nobody publishes it") == 1
        stream.await_state("WAITING_FOR_CALIBRATION")
        shown = graph.heard.messages["plane_b/tracking"]
        graph.heard.wait_for(lambda: bool(shown))
        assert (shown[-1].encoding, shown[-1].height, shown[-1].width) == ("rgb8", SIDE, SIDE)
        assert set(stream.states()) <= {"INACTIVE", "WAITING_FOR_CALIBRATION"}, stream.states()
        stream.seeded()


def test_a_frozen_pair_is_clicked(tmp_path: Path) -> None:
    with Graph((*PICTURES, *HEARD), tmp_path) as graph:
        stream = RingStream(graph)
        mouse = {plane: graph.publisher(topics.click_topic(plane)) for plane in "ab"}
        start_tracker(graph, "seed_buffer_pairs:=4")
        stream.connect()
        assert "no pair with calibrated images" in freeze(graph, True).message
        assert "call ~/freeze" in initialize(graph).message
        stream.pairs(3)
        stream.await_count("tracker", "pairs answered", stream.number)  # the newest is the last sent
        graph.heard.wait_for(lambda: len(graph.heard.messages["plane_b/tracking"]) > 0)
        assert freeze(graph, True).message == f"the pair of {stamp(2) / 1e9:.3f} s is held: click in both planes"
        for _ in range(2):  # further than the buffer reaches: the frozen pair is held nonetheless
            stream.pairs(5)
            stream.await_count("tracker", "pairs answered", stream.number)
        frozen = stamp(2)
        pictures = graph.heard.messages["plane_a/tracking"]
        graph.heard.wait_for(lambda: stamp_to_ns(pictures[-1].header.stamp) == frozen)

        click(mouse, [(100.0, 100.0)] * 6)  # on nothing
        graph.wait_until(lambda: "expected 6 or more clicks" not in initialize(graph).message)
        refused = initialize(graph)
        assert not refused.success
        assert refused.message
        stream.await_state("WAITING_FOR_SEED")

        assert freeze(graph, True).success  # once more: the newest pair, without clicks
        frozen = stamp(stream.number - 1)
        graph.heard.wait_for(lambda: stamp_to_ns(pictures[-1].header.stamp) == frozen)
        seed, before = ring_seed(SIDE, displacement_mm(frozen)), len(pictures)
        click(mouse, seed.points_a, planes="a")
        click(mouse, seed.points_b, planes="b")
        graph.heard.wait_for(lambda: len(pictures) >= before + 3)  # the clicks are shown
        stream.pairs(3)
        graph.wait_until(lambda: initialize(graph).success)
        graph.heard.wait_for(lambda: stream.references()[-1:] == [frozen])
        stream.expect([frozen, *stream.pairs(2)])
        stream.nothing_wrong()


def test_clicks_from_a_file_start_an_unattended_run(tmp_path: Path) -> None:
    seed = ring_seed(SIDE)
    path = tmp_path / "seeds.yaml"
    path.write_text(yaml.safe_dump({f"plane_{plane}": {"points": seed.points(plane).tolist()} for plane in "ab"}))
    with Graph(HEARD, tmp_path) as graph:
        stream = RingStream(graph)
        start_tracker(graph, f"seeds_file:={path}")
        stream.connect()
        stream.expect(stream.pairs(3))


def test_parameters_live_and_the_whole_managed_life(tmp_path: Path) -> None:
    with Graph(HEARD, tmp_path) as graph:
        stream = RingStream(graph)
        start_tracker(graph)
        stream.connect()
        stream.seeded()
        (constant,) = set_parameters(graph, seed_buffer_pairs=8)
        assert not constant.successful
        assert "read-only" in constant.reason
        (bad,) = set_parameters(graph, **{"judgement.lost_gap_mm": 0.01})
        assert not bad.successful
        assert "judgement.lost_gap_mm" in bad.reason
        both = set_parameters(graph, atomically=True, **{"search.near_mm": 10.0, "judgement.degraded_gap_mm": 0.0})
        assert not both[0].successful
        assert set_parameters(graph, **{"search.near_mm": 10})[0].successful  # a whole number serves as a float
        assert all(
            result.successful for result in set_parameters(graph, catheter="auto", posture="prone", polarity="dark")
        )
        stream.said("posture: prone holds from the next clicks on")
        assert "catheter: auto" not in graph.processes.log("tracker", 100)  # it was so before
        stream.expect(stream.pairs(2))
        graph.heard.wait_for(lambda: diagnosed(graph, "tracker").get(topics.POSTURE_KEY) == "prone")

        # Without R peaks no motion is updated; the tracker goes on.
        assert set_parameters(graph, **{"heartbeat.mode": "gate"})[0].successful
        raw, (gated,) = graph.heard.messages["motion_raw"], stream.pairs(1)
        graph.heard.wait_for(lambda: stamp_to_ns(raw[-1].header.stamp) == gated)
        graph.heard.wait_for(
            lambda: "the heart's phase is not known" in diagnosed(graph, "heartbeat").get("message", "")
        )
        assert set_parameters(graph, **{"heartbeat.mode": "filter"})[0].successful
        stream.expect(stream.pairs(2))
        assert set_parameters(graph, **{"heartbeat.mode": "none"})[0].successful
        stream.expect(stream.pairs(1))
        assert gated not in stream.errors_mm()

        for transition, state, says in (
            (Transition.TRANSITION_DEACTIVATE, State.PRIMARY_STATE_INACTIVE, "INACTIVE"),
            (Transition.TRANSITION_ACTIVATE, State.PRIMARY_STATE_ACTIVE, "LOST"),  # until a pair comes
            (Transition.TRANSITION_DEACTIVATE, State.PRIMARY_STATE_INACTIVE, "INACTIVE"),
            (Transition.TRANSITION_CLEANUP, State.PRIMARY_STATE_UNCONFIGURED, "INACTIVE"),
            (Transition.TRANSITION_UNCONFIGURED_SHUTDOWN, State.PRIMARY_STATE_FINALIZED, "INACTIVE"),
        ):
            request = ChangeState.Request(transition=Transition(id=transition))
            assert graph.call(ChangeState, "/lasso_tracker/change_state", request).success
            assert graph.call(GetState, "/lasso_tracker/get_state", GetState.Request()).current_state.id == state
            graph.heard.wait_for(lambda says=says: stream.states()[-1:] == [says])
        graph.processes.send("tracker", signal.SIGINT)
        assert graph.wait_for_end("tracker") == 0


def test_a_configuration_that_fails_leaves_it_unconfigured(tmp_path: Path) -> None:
    with Graph(HEARD, tmp_path) as graph:
        start_tracker(graph, "autostart:=false", "seeds_file:=/none.yaml")
        request = ChangeState.Request(transition=Transition(id=Transition.TRANSITION_CONFIGURE))
        assert not graph.call(ChangeState, "/lasso_tracker/change_state", request).success
        state = graph.call(GetState, "/lasso_tracker/get_state", GetState.Request()).current_state.id
        assert state == State.PRIMARY_STATE_UNCONFIGURED
        assert "/none.yaml: cannot be read" in graph.processes.log("tracker", 20)


def freeze(graph: Graph, on: bool) -> SetBool.Response:
    return graph.call(SetBool, "/lasso_tracker/freeze", SetBool.Request(data=on))


def initialize(graph: Graph) -> Trigger.Response:
    return graph.call(Trigger, "/lasso_tracker/initialize", Trigger.Request())


def click(mouse: dict, points: object, planes: str = "ab") -> None:
    for plane in planes:
        for x, y in points:
            mouse[plane].publish(Point(x=float(x), y=float(y)))


def set_parameters(graph: Graph, *, atomically: bool = False, **values: float | str) -> list:
    kinds = {
        str: (ParameterType.PARAMETER_STRING, "string_value"),
        int: (ParameterType.PARAMETER_INTEGER, "integer_value"),
        float: (ParameterType.PARAMETER_DOUBLE, "double_value"),
    }
    parameters = []
    for name, value in values.items():
        kind, field = kinds[type(value)]
        parameters.append(Parameter(name=name, value=ParameterValue(type=kind, **{field: value})))
    if atomically:
        request = SetParametersAtomically.Request(parameters=parameters)
        return [graph.call(SetParametersAtomically, "/lasso_tracker/set_parameters_atomically", request).result]
    return graph.call(
        SetParameters, "/lasso_tracker/set_parameters", SetParameters.Request(parameters=parameters)
    ).results
