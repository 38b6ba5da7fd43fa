"""Child processes that never outlive their parent's work; and DDS domains for groups of them."""

from __future__ import annotations

import contextlib
import os
import signal
import socket
import subprocess
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import IO, Self

from lasso_motion_ros.core.errors import LassoMotionError

HIGHEST_DOMAIN = 100
"""Domains above it use UDP ports that Linux may give to anybody."""
PORT_BASE = 7400
PORTS_PER_DOMAIN = 250
FIRST_PARTICIPANT_PORTS = (10, 11)

LOOPBACK = {"ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST"}
"""Environment by which DDS looks for nobody beyond this machine."""
STOP_WAIT_S = 20.0
"""A node says goodbye before it ends, which takes its time on a busy machine; killed, it would count as failed."""


def stay_on_this_machine() -> None:
    """Keep this process's DDS, and that of its children, on this machine, unless the user has chosen otherwise."""
    for name, value in LOOPBACK.items():
        os.environ.setdefault(name, value)


def free_domain() -> int:
    """A DDS domain in which nobody on this machine talks: the ports of its first participant are free.

    The search begins at a place that depends on the process id, so that two that start together part.

    Raises:
        LassoMotionError: all domains are in use.
    """
    for step in range(HIGHEST_DOMAIN):
        domain = 1 + (os.getpid() + step) % HIGHEST_DOMAIN
        if all(_port_is_free(PORT_BASE + PORTS_PER_DOMAIN * domain + offset) for offset in FIRST_PARTICIPANT_PORTS):
            return domain
    raise LassoMotionError(f"all DDS domains from 1 to {HIGHEST_DOMAIN} are in use on this machine")


def _port_is_free(port: int) -> bool:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        try:
            probe.bind(("", port))
        except OSError:
            return False
    return True


class Processes:
    """Child processes, started by module name and stopped by process id; a context manager that leaves none behind.

    Args:
        environment: variables to set over this process's own.
        log_directory: where each child's output goes, one file a child; None lets it through.
    """

    def __init__(self, environment: Mapping[str, str], log_directory: Path | None = None) -> None:
        self._environment = {**os.environ, **environment}
        self._log_directory = log_directory
        self._children: dict[str, subprocess.Popen[bytes]] = {}
        self._logs: list[IO[bytes]] = []

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.stop()

    def start(self, name: str, module: str, arguments: Sequence[str] = ()) -> subprocess.Popen[bytes]:
        """Run `python -m module arguments…` as a child in a session of its own.

        Its own session keeps the terminal's Ctrl-C from it: the parent stops it, in its own order.
        """
        output: IO[bytes] | None = None
        if self._log_directory is not None:
            output = (self._log_directory / f"{name}.log").open("wb")
            self._logs.append(output)
        child = subprocess.Popen(
            [sys.executable, "-m", module, *arguments],
            env=self._environment,
            stdin=subprocess.DEVNULL,
            stdout=output,
            stderr=subprocess.STDOUT if output is not None else None,
            start_new_session=True,
        )
        self._children[name] = child
        return child

    def start_node(self, name: str, executable: str, arguments: Sequence[str] = ()) -> subprocess.Popen[bytes]:
        """Run one of the package's node executables (`lasso_tracker`, …) as `start` does, installed or not."""
        return self.start(name, "lasso_motion_ros.nodes.executables", [executable, *arguments])

    def wait(self, name: str, patience_s: float) -> int:
        """The exit status of a child, once it has ended.

        Raises:
            LassoMotionError: it has not ended in time.
        """
        try:
            return self._children[name].wait(patience_s)
        except subprocess.TimeoutExpired as error:
            raise LassoMotionError(f"{name} has not ended within {patience_s:g} s") from error

    def send(self, name: str, number: signal.Signals) -> None:
        """Send a signal to a child that is still there."""
        if self._children[name].poll() is None:
            self._children[name].send_signal(number)

    def ended(self) -> dict[str, int]:
        """Exit statuses of the children that have ended, by name."""
        statuses = {name: child.poll() for name, child in self._children.items()}
        return {name: status for name, status in statuses.items() if status is not None}

    def log(self, name: str, lines: int = 5) -> str:
        """The last lines that a child has written, to be shown when it has failed."""
        if self._log_directory is None:
            return ""
        path = self._log_directory / f"{name}.log"
        return "\n".join(path.read_text(encoding="utf-8", errors="replace").splitlines()[-lines:])

    def stop(self) -> dict[str, int]:
        """Stop all children: SIGINT to each, and SIGKILL to one that does not hear it.

        Returns:
            Exit statuses by name.
        """
        for child in self._children.values():
            if child.poll() is None:
                with contextlib.suppress(ProcessLookupError):
                    child.send_signal(signal.SIGINT)
        for child in self._children.values():
            try:
                child.wait(STOP_WAIT_S)
            except subprocess.TimeoutExpired:
                child.kill()
                child.wait()
        for log in self._logs:
            log.close()
        self._logs.clear()
        return self.ended()
