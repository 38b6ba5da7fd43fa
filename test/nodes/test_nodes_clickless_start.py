"""A live stream without clicks: the ring is proposed, and started with when somebody says yes, or at once."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

pytest.importorskip("rclpy", reason="needs ROS 2")

from rcl_interfaces.msg import Parameter, ParameterType, ParameterValue
from rcl_interfaces.srv import SetParameters
from std_srvs.srv import Trigger
from support.node_harness import Graph
from support.ring_stream import HEARD, PERIOD_NS, RIGHT_MM, RingStream, start_tracker

from lasso_motion_ros.initialisation.ring_finder import PAIRS
from lasso_motion_ros.stream.ring_need import LONG_NS
from msg_adapters.messages import stamp_to_ns
from msg_adapters.topics import PROPOSAL

pytestmark = pytest.mark.ros

PATIENCE_S = 120.0  # a look may take long on a busy machine
ADD, DELETE = 0, 2
ASIDE_MM = (15.0, -10.0, 0.0)


@pytest.fixture
def graph(tmp_path: Path) -> Iterator[Graph]:
    with Graph([*HEARD, PROPOSAL], tmp_path) as started:
        yield started


def test_a_ring_is_proposed_unless_clicks_come_and_tracked_once_accepted_and_by_start_without(graph: Graph) -> None:
    start_tracker(graph, "polarity:=dark")
    for name in ("accept", "next"):
        graph.client(Trigger, f"/lasso_tracker/{name}")
    graph.client(SetParameters, "/lasso_tracker/set_parameters")
    stream = RingStream(graph)
    stream.connect()
    shown = graph.heard.messages["proposal"]
    # Clicks on a pair that is being looked at: they win, and what they lead to is tracked as ever.
    clicked = stream.pairs(PAIRS)[0]
    stream.clicks(clicked)
    stream.await_state("TRACKING")
    # Of those since the clicked one, which had an answer, some are left out where these come before they are done.
    last = stream.pairs(2)[-1]
    graph.heard.wait_for(lambda: last in stream.errors_mm(), PATIENCE_S)
    assert max(stream.errors_mm().values()) < RIGHT_MM
    assert stream.references() == [clicked]
    refused = graph.call(Trigger, "/lasso_tracker/accept", Trigger.Request())
    assert not refused.success
    assert refused.message == "no ring is proposed"
    assert not shown

    stream.reset()
    stream.pairs(PAIRS)
    graph.heard.wait_for(lambda: len(shown) > 0, PATIENCE_S)
    assert shown[-1].action == ADD
    assert len(shown[-1].points) >= 64
    assert stream.states()[-1] == "WAITING_FOR_SEED"
    no_other = graph.call(Trigger, "/lasso_tracker/next", Trigger.Request())
    assert not no_other.success
    assert no_other.message == "no other ring is proposed"
    taken = graph.call(Trigger, "/lasso_tracker/accept", Trigger.Request())
    assert taken.success, taken.message
    stream.await_state("TRACKING")
    stream.pairs(2)
    graph.heard.wait_for(lambda: shown[-1].action == DELETE, PATIENCE_S)
    errors = [error for at, error in stream.errors_mm().items() if at > last]
    assert errors
    assert np.mean(errors) < RIGHT_MM

    value = ParameterValue(type=ParameterType.PARAMETER_STRING, string_value="start")
    request = SetParameters.Request(parameters=[Parameter(name="automatic_initialisation", value=value)])
    assert graph.call(SetParameters, "/lasso_tracker/set_parameters", request).results[0].successful
    stream.reset()
    before = len(stream.references())
    stream.pairs(PAIRS)
    graph.heard.wait_for(lambda: len(stream.references()) > before, PATIENCE_S)
    stream.await_state("TRACKING")


def test_a_ring_that_was_moved_is_proposed_after_a_while_and_is_its_own_reference_once_somebody_takes_it(
    graph: Graph,
) -> None:
    # Not by start either: where a ring that was moved lies, nobody has registered a volume.
    start_tracker(graph, "polarity:=dark", "automatic_initialisation:=start")
    graph.client(Trigger, "/lasso_tracker/accept")
    stream = RingStream(graph)
    stream.connect()
    stream.seeded()
    answered(stream, 40)
    before = stream.references()
    shown = graph.heard.messages["proposal"]
    answered(stream, LONG_NS // PERIOD_NS + 10, aside_mm=ASIDE_MM)
    graph.heard.wait_for(lambda: len(shown) > 0 and shown[-1].action == ADD, PATIENCE_S)
    stream.await_state("DISPLACED")
    stream.said("state: DISPLACED: ")
    assert stream.references() == before
    taken = graph.call(Trigger, "/lasso_tracker/accept", Trigger.Request())
    assert taken.success, taken.message
    assert "its pair is the new reference: a volume is to be registered there" in taken.message
    graph.heard.wait_for(lambda: len(stream.references()) > len(before), PATIENCE_S)
    last = stream.pairs(3, aside_mm=ASIDE_MM)[-1]
    graph.heard.wait_for(lambda: last in stream.errors_mm(), PATIENCE_S)
    stream.await_state("TRACKING")
    graph.heard.wait_for(lambda: shown[-1].action == DELETE, PATIENCE_S)
    stream.nothing_wrong()


def answered(stream: RingStream, count: int, **spoils: Any) -> None:
    """Some pairs more, five at a time: none is lost to a queue."""
    shown = stream.graph.heard.messages["catheter"]  # of every pair, with its stamp
    for _ in range(count // 5):
        last = stream.pairs(5, **spoils)[-1]
        stream.graph.heard.wait_for(lambda at=last: any(stamp_to_ns(one.header.stamp) == at for one in shown))
