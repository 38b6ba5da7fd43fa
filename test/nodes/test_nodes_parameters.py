"""The parameter table as ROS parameters: types, ranges, descriptions, refusals."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import pytest

pytest.importorskip("rclpy", reason="needs ROS 2")

from rclpy.context import Context
from rclpy.exceptions import ParameterNotDeclaredException
from rclpy.node import Node
from rclpy.parameter import Parameter

from lasso_motion_ros.config.parameters import applicable_parameters, group, parameter
from lasso_motion_ros.config.stream import StreamConfig
from lasso_motion_ros.core.errors import ConfigurationError
from lasso_motion_ros.nodes.parameters import LiveParameters, declare_configuration
from lasso_motion_ros.tools.processes import LOOPBACK, free_domain

pytestmark = pytest.mark.ros


@dataclass(frozen=True)
class InnerConfig:
    ratio: float = parameter(0.5, "a ratio", minimum=0.0, maximum=1.0, read_only=False)
    size: float = parameter(2.0, "a size", minimum=0.5, read_only=False, holds_from="tomorrow")


@dataclass(frozen=True)
class OuterConfig:
    count: int = parameter(3, "how many", unit="px", minimum=1)
    word: str = parameter("one", "which", choices=("one", "two"))
    inner: InnerConfig = group(InnerConfig)


@pytest.fixture
def make_node(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Iterator[Callable[[str], Node]]:
    for name, value in LOOPBACK.items():
        monkeypatch.setenv(name, value)
    context = Context()
    made: list[Node] = []

    def make(yaml: str = "{}", arguments: Sequence[str] = ()) -> Node:
        path = tmp_path / "parameters.yaml"
        path.write_text(f"tested:\n  ros__parameters: {yaml}\n" if yaml != "{}" else "")
        if yaml != "{}":
            arguments = ["--ros-args", "--params-file", str(path)]
        context.init(args=list(arguments), domain_id=free_domain())
        made.append(Node("tested", context=context, automatically_declare_parameters_from_overrides=True))
        return made[-1]

    yield make
    for node in made:
        node.destroy_node()
    context.try_shutdown()


def test_defaults_and_descriptions(make_node: Callable[..., Node]) -> None:
    node = make_node()
    assert declare_configuration(node, OuterConfig) == OuterConfig()
    count, word, ratio = (node.describe_parameter(name) for name in ("count", "word", "inner.ratio"))
    assert (count.description, count.read_only) == ("how many [px]", True)
    # A range has two ends in ROS: none that nobody set is made up.
    assert (count.integer_range, count.additional_constraints) == ([], "at least 1")
    size = node.describe_parameter("inner.size")
    assert (size.floating_point_range, size.additional_constraints) == ([], "a change holds tomorrow; at least 0.5")
    assert word.additional_constraints == "one of: one, two"
    assert (ratio.read_only, ratio.dynamic_typing) == (False, False)
    assert (ratio.floating_point_range[0].from_value, ratio.floating_point_range[0].to_value) == (0.0, 1.0)


def test_every_parameter_of_the_tracker_is_declared(make_node: Callable[..., Node]) -> None:
    node = make_node()
    assert declare_configuration(node, StreamConfig) == StreamConfig()
    for name, spec in applicable_parameters(StreamConfig, {}).items():
        assert node.get_parameter(name).value == spec.default
    assert not node.has_parameter("features.roi_px")


def test_the_method_decides_which_parameters_are_declared(make_node: Callable[..., Node]) -> None:
    node = make_node("{method: brost2009, features: {roi_px: 300}}")
    config = declare_configuration(node, StreamConfig)
    assert (config.method, config.features.roi_px) == ("brost2009", 300)
    assert node.get_parameter("features.roi_px").value == 300
    assert node.has_parameter("sync.jitter_s")
    assert not node.has_parameter("search.near_mm")


def test_a_parameter_of_the_other_method_is_refused_by_name(make_node: Callable[..., Node]) -> None:
    with pytest.raises(ConfigurationError) as refused:
        declare_configuration(make_node("{method: brost2009, search: {near_mm: 5.0}}"), StreamConfig)
    assert str(refused.value) == "search.near_mm is a parameter of the method appearance, but method is brost2009"


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("search.near_mm", "search.near_mm is a parameter of the method appearance, but method is brost2009"),
        ("features.scalse", "unknown parameter 'features.scalse'; did you mean features.scales?"),
    ],
)
def test_while_it_runs_too(make_node: Callable[..., Node], name: str, said: str) -> None:
    node = make_node("{method: brost2009}")
    LiveParameters(node, declare_configuration(node, StreamConfig), lambda config: None)
    with pytest.raises(ParameterNotDeclaredException, match=re.escape(said)):  # what rclpy's service answers with
        node.set_parameters([Parameter(name, value=5.0)])


def test_values_are_taken_and_a_whole_number_serves_as_a_float(make_node: Callable[..., Node]) -> None:
    node = make_node("{count: 7, word: two, inner: {ratio: 1}, use_sim_time: false}")
    expected = OuterConfig(7, "two", InnerConfig(1.0))
    assert declare_configuration(node, OuterConfig) == expected
    assert isinstance(node.get_parameter("inner.ratio").value, float)


@pytest.mark.parametrize(
    ("yaml", "message"),
    [
        ("{cuont: 7}", "unknown parameter 'cuont'; did you mean count?"),
        ("{count: 0}", "count must be at least 1 px, found 0"),
        ("{count: 2.5}", "count must be a int, found 2.5"),
        ("{word: three}", "word must be one of one, two, found 'three'"),
        ("{inner: {ratio: 1.5}}", "inner.ratio must be at most 1.0, found 1.5"),
    ],
)
def test_what_is_wrong_is_refused_by_name(make_node: Callable[..., Node], yaml: str, message: str) -> None:
    with pytest.raises(ConfigurationError) as refused:
        declare_configuration(make_node(yaml), OuterConfig)
    assert str(refused.value) == message


def test_a_constant_cannot_be_changed_and_a_range_holds_while_it_runs(make_node: Callable[..., Node]) -> None:
    node = make_node()
    applied: list[OuterConfig] = []
    live = LiveParameters(node, declare_configuration(node, OuterConfig), applied.append)
    assert not node.set_parameters([Parameter("count", value=5)])[0].successful
    assert not node.set_parameters([Parameter("inner.ratio", value=2.0)])[0].successful
    assert not node.set_parameters([Parameter("inner.size", value=0.25)])[0].successful
    assert applied == []
    assert node.set_parameters([Parameter("inner.ratio", value=0.25)])[0].successful
    assert node.set_parameters([Parameter("use_sim_time", value=False)])[0].successful  # rclpy's own
    assert [config.inner.ratio for config in applied] == [live.config.inner.ratio] == [0.25]
    assert node.get_parameter("inner.ratio").value == 0.25


def test_a_whole_number_is_taken_for_a_float_while_it_runs(make_node: Callable[..., Node]) -> None:
    """As `ros2 param set tested inner.size 20` sends it."""
    node = make_node()
    live = LiveParameters(node, declare_configuration(node, OuterConfig), lambda config: None)
    assert node.set_parameters([Parameter("inner.size", value=20)])[0].successful
    assert live.config.inner.size == 20.0
    assert isinstance(node.get_parameter("inner.size").value, float)
    assert node.set_parameters_atomically(
        [Parameter("inner.size", value=3), Parameter("inner.ratio", value=1)]
    ).successful
    assert live.config.inner == InnerConfig(1.0, 3.0)
    assert not node.set_parameters([Parameter("inner.size", value=True)])[0].successful


@pytest.mark.parametrize(
    ("sections", "words", "refused"),
    [
        ("/**: {ros__parameters: {frame_rate: 7, inner: {size: 3}}}", [], False),
        ("/*: {ros__parameters: {frame_rate: 7, inner: {size: 3}}}", [], False),
        ("/**: {ros__parameters: {frame_rate: 7}}\ntested: {ros__parameters: {frame_rate: 7}}", [], True),
        ("/**/tested: {ros__parameters: {frame_rate: 7}}", [], True),
        ("/**: {ros__parameters: {frame_rate: 7}}", ["-p", "frame_rate:=8"], True),
        ("/**: {ros__parameters: {count: 0}}", [], True),
    ],
)
def test_what_all_nodes_are_given_may_be_anothers(
    make_node: Callable[..., Node], tmp_path: Path, sections: str, words: list[str], refused: bool
) -> None:
    path = tmp_path / "site.yaml"
    path.write_text(sections)
    arguments = ["--ros-args", "--params-file", str(path), *words]
    node = make_node(arguments=arguments)
    if refused:
        with pytest.raises(ConfigurationError, match=r"unknown parameter 'frame_rate'|count must be at least 1 px"):
            declare_configuration(node, OuterConfig, arguments)
        return
    assert declare_configuration(node, OuterConfig, arguments).inner.size == 3.0
    assert not node.has_parameter("frame_rate")


def test_what_the_node_refuses_changes_nothing(make_node: Callable[..., Node]) -> None:
    node = make_node()

    def refuse(config: OuterConfig) -> None:
        raise ConfigurationError(f"not {config.inner.ratio}")

    live = LiveParameters(node, declare_configuration(node, OuterConfig), refuse)
    refused = node.set_parameters_atomically([Parameter("inner.ratio", value=0.125)])
    assert (refused.successful, refused.reason) == (False, "not 0.125")
    assert live.config == OuterConfig()
    assert node.get_parameter("inner.ratio").value == OuterConfig().inner.ratio
