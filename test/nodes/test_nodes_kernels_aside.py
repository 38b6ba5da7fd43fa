"""The first start with the extra `fast`: the node tracks at once, and pairs take less once all is compiled."""

from __future__ import annotations

import os
import signal
import threading
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

pytest.importorskip("rclpy", reason="needs ROS 2")

from support.child_processes import children_of, is_running
from support.node_harness import Graph
from support.ring_stream import HEARD, RingStream, start_tracker

from lasso_motion_ros.core.compiled import NotKept, arithmetic, has_kernels, hold_back
from lasso_motion_ros.nodes import kernels_aside
from lasso_motion_ros.nodes.kernels_aside import KernelsAside

pytestmark = pytest.mark.skipif(not has_kernels(), reason="the extra `fast` is not installed")


@pytest.mark.ros
def test_nobody_waits_for_the_first_start(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path / "nothing is compiled"))
    with Graph(HEARD, tmp_path) as graph:
        stream = RingStream(graph)
        start_tracker(graph)
        stream.connect()
        stream.seeded()
        stream.expect(stream.pairs(5))
        stream.nothing_wrong()
        stream.said("the extra `fast` is being compiled for this machine, once, beside the work")
        assert stream.values("tracker")["arithmetic"].startswith("plain numpy: the extra `fast` is being compiled")
        (compiling,) = [child for node in children_of(os.getpid()) for child in children_of(node)]
        graph.processes.send("tracker", signal.SIGINT)
        assert graph.wait_for_end("tracker") == 0
        assert not is_running(compiling)


class FakeCompilation:
    """Compiles when the test says so."""

    def __init__(self) -> None:
        self.may_end, self.problem, self.is_closed = threading.Event(), "", False

    def wait(self) -> str:
        assert self.may_end.wait(60)
        return self.problem

    def close(self) -> None:
        self.is_closed = True
        self.may_end.set()


@pytest.fixture
def compilation(monkeypatch: pytest.MonkeyPatch) -> Iterator[FakeCompilation]:
    """What a node waits for that finds no kernels."""
    fake = FakeCompilation()
    missing = [NotKept("a folder")]

    def load_kept() -> None:
        if missing:
            raise missing.pop()

    monkeypatch.setattr(kernels_aside, "load_kept", load_kept)
    monkeypatch.setattr(kernels_aside, "Compilation", lambda niceness: fake)
    yield fake
    hold_back("")


def begun(dry_run: Callable[[], object]) -> tuple[KernelsAside, list[str]]:
    said: list[str] = []
    aside = KernelsAside(said.append, said.append, dry_run)
    aside.begin()
    return aside, said


def waited_for(aside: KernelsAside) -> None:
    assert aside._waiting is not None
    aside._waiting.join(60)


def test_the_kernels_run_once_they_are_compiled_and_tried(compilation: FakeCompilation) -> None:
    tried: list[tuple[bool, str]] = []

    def dry_run() -> None:
        others: list[str] = []
        thread = threading.Thread(target=lambda: others.append(arithmetic()))
        thread.start()
        thread.join()
        tried.append((has_kernels(), *others))

    aside, said = begun(dry_run)
    assert not has_kernels()
    aside.begin()  # a node is configured more than once
    assert len(said) == 1
    compilation.may_end.set()
    waited_for(aside)
    assert tried == [(True, "plain numpy: the extra `fast` is being compiled for this machine, once")]
    assert has_kernels()
    assert said[1:] == ["compiled after 0 s: a pair takes less from now on"]


def test_what_could_not_be_compiled_is_said_and_the_plain_version_stays(compilation: FakeCompilation) -> None:
    def dry_run() -> None:
        raise OSError("is not reached where it is not kept")

    aside, said = begun(dry_run)
    compilation.problem = "OSError: no space left on device"
    compilation.may_end.set()
    waited_for(aside)
    assert not has_kernels()
    words = "plain numpy: the extra `fast` could not be compiled: OSError: no space left on device"
    assert (arithmetic(), said[1:]) == (words, [words])


def test_a_node_that_ends_meanwhile_says_nothing_more(compilation: FakeCompilation) -> None:
    aside, said = begun(lambda: None)
    aside.close()
    waited_for(aside)
    assert compilation.is_closed
    assert len(said) == 1


def test_where_nothing_can_be_kept_the_plain_version_stays(monkeypatch: pytest.MonkeyPatch) -> None:
    def load_kept() -> None:
        raise NotKept(None)

    monkeypatch.setattr(kernels_aside, "load_kept", load_kept)
    try:
        _, said = begun(lambda: None)
        assert "NUMBA_CACHE_DIR may name a folder that can be written" in said[0]
        assert arithmetic().startswith("plain numpy: what is compiled can be kept nowhere")
    finally:
        hold_back("")
