"""Child processes: a domain of their own, stopped in any case, their last words kept."""

from __future__ import annotations

import os
import signal
import socket
import threading
from pathlib import Path

import pytest

from lasso_motion_ros.core.errors import LassoMotionError
from lasso_motion_ros.core.signals import held_signals
from lasso_motion_ros.tools import processes
from lasso_motion_ros.tools.processes import Processes, free_domain

DEAF = "import signal, sys, time; signal.signal(signal.SIGINT, signal.SIG_IGN); print('up', flush=True); time.sleep(60)"


def module(directory: Path, name: str, code: str, monkeypatch: pytest.MonkeyPatch) -> str:
    (directory / f"{name}.py").write_text(code)
    monkeypatch.setenv("PYTHONPATH", str(directory))
    return name


def test_a_domain_in_which_somebody_talks_is_not_taken() -> None:
    domain = free_domain()
    assert 1 <= domain <= 100
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as taken:
        taken.bind(("", 7400 + 250 * domain + 10))
        other = free_domain()
    assert other != domain
    assert free_domain() == domain


def test_a_child_that_does_not_hear_is_killed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(processes, "STOP_WAIT_S", 0.2)
    name = module(tmp_path, "deaf_child", DEAF, monkeypatch)
    with Processes({}, tmp_path) as children:
        child = children.start("deaf", name)
        ready = threading.Event()
        while not children.log("deaf"):
            assert not ready.wait(0.02)
            assert child.poll() is None
        assert children.ended() == {}
    assert child.returncode == -signal.SIGKILL


def test_the_exit_status_and_the_last_words_are_kept(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    code = "import os, sys\nprint('first')\nprint(os.environ['GIVEN'])\nsys.exit('last words')"
    name = module(tmp_path, "talking_child", code, monkeypatch)
    with Processes({"GIVEN": "seen"}, tmp_path) as children:
        children.start("talker", name)
        assert children.wait("talker", 30.0) == 1
        assert children.ended() == {"talker": 1}
        assert sorted(children.log("talker").splitlines()) == ["first", "last words", "seen"]
        assert len(children.log("talker", 1).splitlines()) == 1


def test_a_child_that_does_not_end_is_said_so(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    name = module(tmp_path, "slow_child", "import time; time.sleep(60)", monkeypatch)
    with Processes({}, tmp_path) as children:
        children.start("slow", name)
        with pytest.raises(LassoMotionError, match=r"slow has not ended within 0.05 s"):
            children.wait("slow", 0.05)


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_held_signal_is_an_event_and_no_exception(number: signal.Signals) -> None:
    before = signal.getsignal(number)
    with held_signals() as interrupted:
        os.kill(os.getpid(), number)
        assert interrupted.wait(10)
    assert signal.getsignal(number) is before
