"""What every node begins with: declared parameters, throttled complaints, a message factory."""

from __future__ import annotations

from typing import Generic, TypeVar

from rclpy.node import Node

from lasso_motion_ros.nodes.parameters import declare_configuration
from lasso_motion_ros.nodes.running import ThrottledLog
from msg_adapters.messages import RosMessages

Config = TypeVar("Config")


class ConfiguredNode(Node, Generic[Config]):  # type: ignore[misc]
    """A node whose parameters are those of a configuration dataclass.

    Args:
        name: of the node.
        config_type: the dataclass.

    Attributes:
        complaints: what goes into the log, throttled.
        messages: makes the messages that are published.
        declared: the configuration at start.

    Raises:
        ConfigurationError: a parameter that is unknown, of the wrong type or out of range.
    """

    def __init__(self, name: str, config_type: type[Config]) -> None:
        super().__init__(name, automatically_declare_parameters_from_overrides=True)
        self.complaints = ThrottledLog(self.get_logger())
        self.messages = RosMessages()
        self.declared: Config = declare_configuration(self, config_type)
