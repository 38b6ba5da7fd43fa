"""Waiting for a graph of children: until it holds, or until a child, the time or the user ends it."""

from __future__ import annotations

import os
import signal
from collections.abc import Iterator
from pathlib import Path

import pytest
from support.child_processes import children_of

from lasso_motion_ros.core.errors import LassoMotionError
from lasso_motion_ros.core.signals import Terminated
from lasso_motion_ros.tools.child_graph import ChildGraph, TooLateError, child_graph

DOMAIN = 7


@pytest.fixture
def graph(tmp_path: Path) -> Iterator[ChildGraph]:
    before = set(children_of(os.getpid()))  # multiprocessing's own, which an earlier test has started
    with child_graph(DOMAIN, tmp_path) as started:
        yield started
    assert set(children_of(os.getpid())) <= before


def test_children_are_in_the_graphs_domain(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "asked_child.py").write_text("import os\nprint(os.environ['ROS_DOMAIN_ID'])")
    monkeypatch.setenv("PYTHONPATH", str(tmp_path))
    with child_graph(DOMAIN, tmp_path) as graph:
        graph.start("child", "asked_child")
        graph.wait_until(lambda: graph.ended() == {"child": 0}, 60.0, may_end=["child"])
        assert graph.log("child") == str(DOMAIN)


@pytest.mark.slow
def test_a_child_that_fails_ends_the_wait_with_its_own_words(graph: ChildGraph) -> None:
    graph.start_command("tracking", "track", "none.mcap", "-o", "out.mcap")
    with pytest.raises(LassoMotionError, match=r"the tracking ended with status 2: lasso-motion track: none\.mcap"):
        graph.wait_until(lambda: False, 60.0, may_end=["tracking"])


def test_a_child_that_ends_too_early_is_a_failure_too(graph: ChildGraph) -> None:
    graph.start("child", "sysconfig")
    with pytest.raises(LassoMotionError, match="the child ended with status 0"):
        graph.wait_until(lambda: False, 60.0)


def test_what_does_not_happen_in_time_is_said(graph: ChildGraph) -> None:
    with pytest.raises(TooLateError, match="nothing came"):
        graph.wait_until(lambda: False, 0.0, lambda: "nothing came")


@pytest.mark.parametrize(("number", "kind"), [(signal.SIGINT, KeyboardInterrupt), (signal.SIGTERM, Terminated)])
def test_a_signal_ends_the_wait(graph: ChildGraph, number: signal.Signals, kind: type[KeyboardInterrupt]) -> None:
    os.kill(os.getpid(), number)
    with pytest.raises(KeyboardInterrupt) as raised:
        graph.wait_until(lambda: False, 60.0)
    assert raised.type is kind
