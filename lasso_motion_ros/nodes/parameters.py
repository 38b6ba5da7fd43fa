"""ROS parameters from the parameter table: declared with description, unit and range, read back."""

from __future__ import annotations

import contextlib
import sys
from collections.abc import Callable, Sequence
from itertools import pairwise
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
    inapplicable_parameters,
    parameter_sections,
)
from lasso_motion_ros.core.errors import ConfigurationError, LassoMotionError

Config = TypeVar("Config")

BUILT_IN = ("use_sim_time", "start_type_description_service", "qos_overrides.")
"""Parameters, or prefixes of them, that belong to rclpy itself."""


def descriptor(spec: ParameterSpec) -> ParameterDescriptor:
    """What `ros2 param describe` shows of one row of the table."""
    description = f"{spec.description} [{spec.unit}]" if spec.unit else spec.description
    constraints = []
    if spec.holds_from:
        constraints.append(f"a change holds {spec.holds_from}")
    if spec.choices:
        constraints.append(f"one of: {', '.join(spec.choices)}")
    described = ParameterDescriptor(name=spec.name, description=description, read_only=spec.read_only)
    if spec.minimum is not None and spec.maximum is not None:
        if isinstance(spec.default, float):
            limits = FloatingPointRange(from_value=float(spec.minimum), to_value=float(spec.maximum))
            described.floating_point_range = [limits]
        else:
            described.integer_range = [IntegerRange(from_value=int(spec.minimum), to_value=int(spec.maximum))]
    # A range has two ends; one limit is said in words, and is kept all the same.
    elif spec.minimum is not None:
        constraints.append(f"at least {spec.minimum:g}")
    elif spec.maximum is not None:
        constraints.append(f"at most {spec.maximum:g}")
    described.additional_constraints = "; ".join(constraints)
    return described


def declare_configuration(node: Node, config_type: type[Config], arguments: Sequence[str] | None = None) -> Config:
    """Declare every parameter that applies on a node and give back what the user asked for.

    Which apply depends on the values given: `method` selects. The node must have been made with
    `automatically_declare_parameters_from_overrides=True`, or names that the table does not know would go unseen. Each
    parameter is declared anew with its type, range and description; a whole number is taken where a float is meant, as
    in a file read by the commands. What a file has for all nodes (`/**`) may be meant for another one: where the table
    does not know it, that is a warning, and the parameter is not declared.

    Args:
        node: the node.
        config_type: the configuration dataclass.
        arguments: the process's, ROS arguments included; None takes `sys.argv`.

    Raises:
        ConfigurationError: an unknown name, a parameter of another method, a wrong type, or a value out of range.
    """
    given = {
        name: parameter.value
        for name, parameter in node.get_parameters_by_prefix("").items()
        if not name.startswith(BUILT_IN)
    }
    inapplicable = inapplicable_parameters(config_type, given)
    to_all = (
        _given_to_all_nodes(node.get_name(), sys.argv if arguments is None else arguments) if inapplicable else set()
    )
    for name, why in inapplicable.items():
        if name in to_all:
            node.get_logger().warning(f"passed over, for it is given to all nodes: {why}")
            node.undeclare_parameter(name)
            del given[name]
    values: dict[str, Any] = {}
    for name, spec in applicable_parameters(config_type, given).items():
        value = spec.checked(given[name]) if name in given else spec.default
        if name in given:
            node.undeclare_parameter(name)
        node.declare_parameter(name, value, descriptor(spec), ignore_override=True)
        values[name] = value
    return configuration_from_values(config_type, values)


def _given_to_all_nodes(node_name: str, arguments: Sequence[str]) -> set[str]:
    """Parameters that stand in sections for all nodes of the parameter files, and nowhere under the node's own name."""
    ours, everybodys = set[str](), set[str]()
    for word, value in pairwise(arguments):
        if word in ("-p", "--param"):
            ours.add(value.partition(":=")[0].rpartition(":")[2])
        elif word == "--params-file":
            with contextlib.suppress(ConfigurationError):  # ROS itself has read it, by rules of its own
                for section, parameters in parameter_sections(value):
                    last = section.rpartition("/")[2]
                    (everybodys if last in ("*", "**") else ours if last == node_name else set()).update(parameters)
    return everybodys - ours


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
            table = applicable_parameters(type(self.config), configuration_values(self.config) | undeclared)
        except ConfigurationError as error:
            # The one exception that rclpy's service turns into an answer; by itself it would not say why.
            raise ParameterNotDeclaredException(str(error)) from error
        # `ros2 param set … 20` is an integer, and rclpy would refuse it where a float is meant.
        return [
            Parameter(one.name, value=float(one.value))
            if one.type_ is Parameter.Type.INTEGER and one.name in table and type(table[one.name].default) is float
            else one
            for one in changes
        ]

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
        for name, spec in applicable_parameters(type(config), values).items():
            if name in changed and changed[name] != values[name] and spec.holds_from:
                # In the log, since rclpy forgets the reason of a result that is a success.
                self._node.get_logger().info(f"{name}: {changed[name]} holds {spec.holds_from}")
        return SetParametersResult(successful=True)
