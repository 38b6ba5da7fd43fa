"""A node that only listens, with its own context and thread: for the demonstration's recorder and for tests."""

from __future__ import annotations

import importlib
import threading
from collections.abc import Iterable
from typing import Any, Protocol

from rclpy.context import Context
from rclpy.executors import ExternalShutdownException, ShutdownException, SingleThreadedExecutor
from rclpy.node import Node

from lasso_motion_ros.nodes.qos import qos
from msg_adapters.topics import Topic


class Hear(Protocol):
    """What is called with each message, in the listener's thread."""

    def __call__(self, topic: Topic, message: Any, published_ns: int) -> None:
        """Take a message of a topic, or its bytes, and when it was published (ns since 1970)."""


class Listener:
    """Subscribes reliably to topics and hands on each message; a context manager.

    Between topics the order of arrival says nothing; the order of publication does.

    The subscriptions are announced in the order given, and a publisher learns of them in that order: when a latched
    message on the last topic has come, its node knows of all.

    Args:
        topics: what to listen to; a relative name is one in the root namespace.
        hear: called with each message.
        domain: the DDS domain.
        raw: hand on the serialised bytes instead of messages.
        depth: of each queue.
    """

    def __init__(
        self,
        topics: Iterable[Topic],
        hear: Hear,
        *,
        domain: int,
        raw: bool = False,
        depth: int = 64,
    ) -> None:
        self._context = Context()
        self._context.init(args=[], domain_id=domain)
        self.node = Node("lasso_listener", context=self._context, enable_rosout=False, start_parameter_services=False)
        for topic in topics:
            package, _, name = topic.type_name.partition("/msg/")
            self.node.create_subscription(
                getattr(importlib.import_module(f"{package}.msg"), name),
                topic.recorded_name,
                lambda message, info, topic=topic: hear(topic, message, info["source_timestamp"]),
                qos(depth=depth, latched=topic.latched),
                raw=raw,
            )
        self._executor = SingleThreadedExecutor(context=self._context)
        self._executor.add_node(self.node)
        self._thread = threading.Thread(target=self._spin, name="listener", daemon=True)

    def __enter__(self) -> Listener:
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._context.try_shutdown()
        self._thread.join()
        self._executor.shutdown()
        self.node.destroy_node()

    def publishers(self, topic: Topic) -> int:
        """How many publish on a topic, as far as is known."""
        return int(self.node.count_publishers(topic.recorded_name))

    def _spin(self) -> None:
        try:
            self._executor.spin()
        except (ExternalShutdownException, ShutdownException):
            return
