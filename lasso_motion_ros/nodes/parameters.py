"""ROS parameters from the parameter table: declared with description, unit and range, read back."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Generic, TypeVar

from rcl_interfaces.msg import FloatingPointRange, IntegerRange, ParameterDescriptor, SetParametersResult
from rclpy.exceptions import ParameterNotDeclaredException
from rclpy.node import Node
from rclpy.parameter import Parameter

from lasso_motion_ros.config.parameters import (
    ParameterSpec,
    applicable_parameters,
    configuration_from_values,
    configuration_values,
)
from lasso_motion_ros.core.errors import ConfigurationError, LassoMotionError

Config = TypeVar("Config")

INTEGER_LIMIT = 2**63 - 1
FLOAT_LIMIT = 1.7976931348623157e308
BUILT_IN = ("use_sim_time", "start_type_description_service", "qos_overrides.")
"""Parameters, or prefixes of them, that belong to rclpy itself."""


def descriptor(spec: ParameterSpec) -> ParameterDescriptor:
    """What `ros2 param describe` shows of one row of the table."""
    described = ParameterDescriptor(
        name=spec.name,
        description=f"{spec.description} [{spec.unit}]" if spec.unit else spec.description,
        read_only=spec.read_only,
        additional_constraints=f"one of: {', '.join(spec.choices)}" if spec.choices else "",
    )
    bounded = spec.minimum is not None or spec.maximum is not None
    if bounded and isinstance(spec.default, float):
        described.floating_point_range = [
            FloatingPointRange(
                from_value=-FLOAT_LIMIT if spec.minimum is None else float(spec.minimum),
                to_value=FLOAT_LIMIT if spec.maximum is None else float(spec.maximum),
            )
        ]
    elif bounded and isinstance(spec.default, int):
        described.integer_range = [
            IntegerRange(
                from_value=-INTEGER_LIMIT if spec.minimum is None else int(spec.minimum),
                to_value=INTEGER_LIMIT if spec.maximum is None else int(spec.maximum),
            )
        ]
    return described


def declare_configuration(node: Node, config_type: type[Config]) -> Config:
    """Declare every parameter that applies on a node and give back what the user asked for.

    Which apply depends on the values given: `method` selects. The node must have been made with
    `automatically_declare_parameters_from_overrides=True`, or names that the table does not know would go unseen. Each
    parameter is declared anew with its type, range and description; a whole number is taken where a float is meant, as
    in a file read by the commands.

    Args:
        node: the node.
        config_type: the configuration dataclass.

    Raises:
        ConfigurationError: an unknown name, a parameter of another method, a wrong type, or a value out of range.
    """
    given = {
        name: parameter.value
        for name, parameter in node.get_parameters_by_prefix("").items()
        if not name.startswith(BUILT_IN)
    }
    values: dict[str, Any] = {}
    for name, spec in applicable_parameters(config_type, given).items():
        value = spec.checked(given[name]) if name in given else spec.default
        if name in given:
            node.undeclare_parameter(name)
        node.declare_parameter(name, value, descriptor(spec), ignore_override=True)
        values[name] = value
    return configuration_from_values(config_type, values)


class LiveParameters(Generic[Config]):
    """A node's configuration as its parameters change: all of a request is applied, or nothing and the reason is given.

    What is read-only is refused by rclpy before it comes here.

    Args:
        node: the node, its parameters declared.
        config: the configuration as it was declared.
        apply: called with each new configuration; what it raises as LassoMotionError refuses the change.

    Attributes:
        config: the configuration that holds now.
    """

    def __init__(self, node: Node, config: Config, apply: Callable[[Config], None]) -> None:
        self.config = config
        self._node = node
        self._apply = apply
        node.add_pre_set_parameters_callback(self._before_set)
        node.add_on_set_parameters_callback(self._on_set)

    def _before_set(self, changes: list[Parameter]) -> list[Parameter]:
        undeclared = {one.name: one.value for one in changes if not self._node.has_parameter(one.name)}
        try:
            applicable_parameters(type(self.config), configuration_values(self.config) | undeclared)
        except ConfigurationError as error:
            # The one exception that rclpy's service turns into an answer; by itself it would not say why.
            raise ParameterNotDeclaredException(str(error)) from error
        return changes

    def _on_set(self, changes: list[Parameter]) -> SetParametersResult:
        values = configuration_values(self.config)
        changed = {one.name: one.value for one in changes if one.name in values}  # not rclpy's own
        if not changed:
            return SetParametersResult(successful=True)
        try:
            config = configuration_from_values(type(self.config), values | changed)
            self._apply(config)
        except LassoMotionError as error:
            return SetParametersResult(successful=False, reason=str(error))
        self.config = config
        return SetParametersResult(successful=True)
