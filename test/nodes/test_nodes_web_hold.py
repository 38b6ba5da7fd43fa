"""A page closed while the tracker still answers it, and one that accepts a ring: a real page's server over DDS."""

from __future__ import annotations

import asyncio
import threading
from functools import partial
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("rclpy", reason="needs ROS 2")
pytest.importorskip("aiohttp", reason="needs the web extra")

import aiohttp
import numpy as np
from std_srvs.srv import SetBool, Trigger
from support.drawn_recording import SIDE, projections
from support.node_harness import PATIENCE_S, Graph
from support.page_client import Client

from lasso_motion_ros.nodes.qos import topic_publisher
from msg_adapters import topics
from msg_adapters.calibrations import encode_camera_info
from msg_adapters.images import encode_image
from msg_adapters.markers import encode_line_strip
from msg_adapters.messages import RosMessages, header_fields

pytestmark = pytest.mark.ros

STAMP_NS = 1_760_000_000_000_000_000


class SlowTracker:
    """The service `lasso_tracker/freeze` of a tracker that takes its time to hold a pair."""

    def __init__(self, graph: Graph) -> None:
        self.asked, self.may_answer = threading.Event(), threading.Event()
        self.calls: list[bool] = []
        graph.listener.node.create_service(SetBool, "lasso_tracker/freeze", self._freeze)

    def _freeze(self, request: SetBool.Request, response: SetBool.Response) -> SetBool.Response:
        self.calls.append(request.data)
        self.asked.set()
        self.may_answer.wait(PATIENCE_S)
        response.success = request.data
        return response


def send_pair(graph: Graph) -> None:
    for plane in "ab":
        header = header_fields(STAMP_NS, f"detector_{plane}")
        for topic, fields in (
            (topics.camera_info_topic(plane), encode_camera_info(projections()[plane], header)),
            (topics.image_topic(plane), encode_image(np.full((SIDE, SIDE), 90, np.uint8), header)),
        ):
            publisher = graph.publisher(topic)
            graph.wait_until(lambda publisher=publisher: publisher.get_subscription_count() > 0)
            publisher.publish(RosMessages().make(topic.type_name, fields))


def served(graph: Graph) -> str:
    """Start the page's server; its address."""
    graph.processes.start("web", "lasso_motion_ros.cli.main", ["web", "--port", "0"])
    graph.wait_until(lambda: "the page is at" in graph.processes.log("web"))
    return graph.processes.log("web").partition("the page is at ")[2].split()[0]


def status(client: Client) -> dict[str, Any]:
    said = client.of("status")
    return said[-1] if said else {}


def test_a_page_shows_the_ring_that_is_proposed_asks_for_the_next_and_accepts_it(tmp_path: Path) -> None:
    with Graph((), tmp_path) as graph:
        called: list[str] = []

        def called_for(name: str, _: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
            called.append(name)
            response.success = True
            return response

        for name in ("next", "accept"):
            graph.listener.node.create_service(Trigger, f"lasso_tracker/{name}", partial(called_for, name))
        url = served(graph)
        ring = encode_line_strip(np.eye(3), header_fields(STAMP_NS, "patient_table"), "proposal")
        for topic, fields in ((topics.PROPOSAL, ring), (topics.STATE, {"data": "WAITING_FOR_SEED"})):
            publisher = topic_publisher(graph.listener.node, RosMessages(), topic)
            graph.wait_until(lambda publisher=publisher: publisher.get_subscription_count() > 0)
            publisher.publish(RosMessages().make(topic.type_name, fields))

        async def visit() -> None:
            async with aiohttp.ClientSession() as session:
                client = Client(await session.ws_connect(f"{url}live", origin=url.rstrip("/")))
                await client.hear(lambda: status(client).get("proposed"))
                for number, name in enumerate(("next", "accept"), start=1):
                    await client.send(type=name, id=number)
                    await client.hear(lambda number=number: len(client.of("answer")) == number)
                    assert client.of("answer")[-1]["done"], client.of("answer")

        asyncio.run(visit())
        assert called == ["next", "accept"]


def test_a_page_that_is_closed_while_it_is_answered_holds_nothing(tmp_path: Path) -> None:
    with Graph((), tmp_path) as graph:
        tracker = SlowTracker(graph)
        url = served(graph)
        send_pair(graph)

        async def visit() -> None:
            async with aiohttp.ClientSession() as session:
                first = await session.ws_connect(f"{url}live", origin=url.rstrip("/"))
                client = Client(first)
                await client.hear(lambda: all(status(client).get("calibrated", {"a": False}).values()))
                await client.send(type="hold", id=1)
                await asyncio.to_thread(tracker.asked.wait, PATIENCE_S)
                await first.close()
                second = await session.ws_connect(f"{url}live", origin=url.rstrip("/"))
                client = Client(second)
                await client.hear(lambda: client.of("status"))
                tracker.may_answer.set()
                await asyncio.to_thread(graph.wait_until, lambda: tracker.calls == [True, False])
                assert not status(client)["held_elsewhere"]
                await client.send(type="hold", id=2)
                await client.hear(lambda: client.of("answer"))
                assert client.of("answer")[0]["done"], client.of("answer")
                await second.close()

        asyncio.run(visit())
        graph.wait_until(lambda: tracker.calls == [True, False, True, False])
