"""A graph of our own nodes as child processes, in a DDS domain of its own on this machine."""

from __future__ import annotations

import subprocess
import time
from collections.abc import Callable, Collection, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path

from lasso_motion_ros.core.errors import LassoMotionError
from lasso_motion_ros.core.signals import HeldSignal, held_signals
from lasso_motion_ros.tools.processes import Processes

START_WAIT_S = 60.0
"""How long nodes may take to come up: on a busy machine half a minute is no fault."""
LOOK_PERIOD_S = 0.05
COMMAND = "lasso_motion_ros.cli.main"
LOGS = "logs"
"""Folder beside the results, for what the processes say; each run writes its own over the last one's."""


class TooLateError(LassoMotionError):
    """What was waited for did not happen in time."""


class ChildGraph(Processes):
    """Child processes of one DDS domain.

    Args:
        domain: of the children.
        logs: where each child's output goes, one file a child.
        interrupted: set when this process is asked to end.
    """

    def __init__(self, domain: int, logs: Path, interrupted: HeldSignal) -> None:
        super().__init__({"ROS_DOMAIN_ID": str(domain)}, logs)
        self.interrupted = interrupted

    def start_tracker(self, configuration: Path) -> subprocess.Popen[bytes]:
        """Run `lasso_tracker` with the parameters of a file."""
        return self.start_node("tracker", "lasso_tracker", ["--ros-args", "--params-file", str(configuration)])

    def start_overlay(self, surface: Path, parameters: Mapping[str, str | float] | None = None) -> None:
        """Run `lasso_overlay` on a surface in world millimetres.

        Args:
            surface: the file.
            parameters: further values, by name.
        """
        values = {"volume_file": str(surface), "units": "mm", **(parameters or {})}
        words = [word for name, value in values.items() for word in ("-p", f"{name}:={value}")]
        self.start_node("overlay", "lasso_overlay", ["--ros-args", *words])

    def start_command(self, name: str, *words: str) -> None:
        """Run `lasso-motion` with these words, as the child `name`."""
        self.start(name, COMMAND, words)

    def wait_until(
        self,
        what: Callable[[], bool],
        patience_s: float | None = None,
        otherwise: Callable[[], str] | str = "",
        *,
        may_end: Collection[str] = (),
    ) -> None:
        """Wait until it holds.

        Args:
            what: looked at again and again.
            patience_s: how long; None: as long as it takes.
            otherwise: what to say where the time runs out.
            may_end: children that may end meanwhile, if without a failure.

        Raises:
            TooLateError: the time has run out.
            LassoMotionError: a child has ended that should not have.
            KeyboardInterrupt: this process is asked to end.
        """
        deadline_s = None if patience_s is None else time.monotonic() + patience_s
        while not what():
            for name, status in self.ended().items():
                if status != 0 or name not in may_end:
                    raise LassoMotionError(f"the {name} ended with status {status}: {self.log(name, 1)}")
            if deadline_s is not None and time.monotonic() > deadline_s:
                raise TooLateError(otherwise if isinstance(otherwise, str) else otherwise())
            if self.interrupted.wait(LOOK_PERIOD_S):
                raise self.interrupted.interrupt()


@contextmanager
def child_graph(domain: int, logs: Path) -> Iterator[ChildGraph]:
    """A `ChildGraph` whose children are all stopped at the end; signals are held until that is safe."""
    with held_signals() as interrupted, ChildGraph(domain, logs, interrupted) as graph:
        yield graph
