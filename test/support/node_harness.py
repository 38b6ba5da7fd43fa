"""Real processes over DDS for the tests of the nodes: each test in a domain of its own, waiting for events only."""

from __future__ import annotations

import os
import threading
import time
from collections import defaultdict
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

from support.paths import SCRIPT_PATH

from lasso_motion_ros.nodes.fastdds import use_image_profile
from lasso_motion_ros.tools.processes import LOOPBACK, Processes, free_domain
from msg_adapters.messages import RosMessages
from msg_adapters.recordings.reader import RecordingReader
from msg_adapters.topics import Topic

PATIENCE_S = 60.0

# Fast DDS reads its profile once a process: before the first test makes a participant.
use_image_profile()


class Heard:
    """Messages by topic name, and all in the order in which they were published."""

    def __init__(self) -> None:
        self.messages: dict[str, list[Any]] = defaultdict(list)
        self._published: list[tuple[int, str, Any]] = []
        self._changed = threading.Condition()

    def __call__(self, topic: Topic, message: Any, published_ns: int) -> None:
        with self._changed:
            self.messages[topic.name].append(message)
            self._published.append((published_ns, topic.name, message))
            self._changed.notify_all()

    @property
    def order(self) -> list[tuple[str, Any]]:
        """(topic name, message) in the order of publication."""
        return [(name, message) for _, name, message in sorted(self._published, key=lambda entry: entry[0])]

    def wait_for(self, what: Callable[[], bool], patience_s: float = PATIENCE_S) -> None:
        """Wait until it holds; looked at again with every message."""
        with self._changed:
            if not self._changed.wait_for(what, patience_s):
                counts = {name: len(messages) for name, messages in self.messages.items()}
                raise AssertionError(f"did not happen within {patience_s} s; heard {counts}")


class Graph:
    """A domain with a listener in this process and any number of child processes; a context manager."""

    def __init__(self, topics: Iterable[Topic], logs: Path) -> None:
        from lasso_motion_ros.tools.listener import Listener

        self.domain = free_domain()
        self.heard = Heard()
        # The helpers of this folder run as modules, too.
        path = os.pathsep.join(filter(None, (SCRIPT_PATH, os.environ.get("PYTHONPATH"))))
        environment = {"ROS_DOMAIN_ID": str(self.domain), "PYTHONPATH": path, **LOOPBACK}
        self.processes = Processes(environment, logs)
        self.listener = Listener(topics, self.heard, domain=self.domain)
        self._clients: dict[str, Any] = {}

    def __enter__(self) -> Graph:
        self.listener.__enter__()
        return self

    def __exit__(self, *_: object) -> None:
        self.processes.stop()
        self.listener.__exit__()

    def publisher(self, topic: Topic, *, reliable: bool = True, latched: bool = False) -> Any:
        """A publisher in this process; its `publish` takes messages and serialised bytes."""
        from lasso_motion_ros.nodes.qos import qos

        message_class = type(RosMessages().make(topic.type_name, {}))
        return self.listener.node.create_publisher(
            message_class, topic.recorded_name, qos(depth=32, reliable=reliable, latched=latched)
        )

    def client(self, service_type: type, name: str) -> Any:
        """The client of a service, made once, and best before the node is started.

        A node answers into the void where it has not heard of the client within 100 ms of its request: a client that
        is made for each call is not heard of in time, now and then, on a busy machine.
        """
        if name not in self._clients:
            self._clients[name] = self.listener.node.create_client(service_type, name)
        return self._clients[name]

    def call(self, service_type: type, name: str, request: Any) -> Any:
        """Call a service, once it is there, and wait for its answer."""
        client = self.client(service_type, name)
        self.wait_until(client.service_is_ready)
        answered = threading.Event()
        future = client.call_async(request)
        future.add_done_callback(lambda _: answered.set())
        assert answered.wait(PATIENCE_S), f"{name} has not answered"
        return future.result()

    def wait_for_end(self, name: str, patience_s: float = PATIENCE_S) -> int:
        """The exit status of a child, once it has ended."""
        return self.processes.wait(name, patience_s)

    def wait_until(self, what: Callable[[], bool], patience_s: float = PATIENCE_S) -> None:
        """Wait for a change of the graph, which comes without a message."""
        deadline = time.monotonic() + patience_s
        tick = threading.Event()
        while not what():
            assert time.monotonic() < deadline, f"did not happen within {patience_s} s"
            tick.wait(0.02)


def recorded(path: Path, *topics: Topic) -> list[tuple[str, bytes]]:
    """(topic name, serialised message) of a recording, in its order."""
    reader = RecordingReader(path)
    return [
        (message.topic.removeprefix("/"), message.data)
        for message in reader.raw_messages([topic.recorded_name for topic in topics])
    ]
