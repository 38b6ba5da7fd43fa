"""The compiled kernels, all of them at once: loaded from the disk, or compiled by processes of their own.

To compile them takes half a minute of a processor, once, at the first start with the extra `fast` on a machine; to load
what was compiled half a second. Where that half minute is to be spent when the software is installed:

    python -m lasso_motion_ros.stream.kernels
"""

from __future__ import annotations

import fcntl
import os
import subprocess
import sys
import threading
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from importlib import import_module

from lasso_motion_ros.core.compiled import NotKept, has_kernels, kept_only, say_that_it_takes_time

# Those first that take longest, so that processes that share them have about as much to do each.
MODULES = tuple(
    f"lasso_motion_ros.{name}"
    for name in (
        "ring.kernels.alignment",
        "ring.kernels.search",
        "seeding.front_kernels",
        "ring.kernels.slide",
        "motion.kernels",
        "motion.rotation_kernels",
        "ring.kernels.display",
        "initialisation.kernels",
        "initialisation.point_kernels",
        "initialisation.spot_kernels",
        "ring.kernels.seed",
        "ring.kernels.band",
        "ring.kernels.blur",
        "ring.kernels.breathing_curve",
        "ring.kernels.patches",
        "ring.kernels.companions",
        "ring.kernels.companion_slide",
        "ring.kernels.curve",
        "ring.kernels.combs",
        "ring.kernels.withdrawal",
        "geometry.kernels",
        "seeding.kernels",
    )
)
MODULE = "lasso_motion_ros.stream.kernels"
"""This one, also where it is run."""


def load_kernels() -> None:
    """Have all kernels ready, where the extra `fast` is installed: loaded, else compiled, which takes its time.

    Raises:
        ConfigurationError: Numba is installed, but cannot be used.
    """
    if not has_kernels():
        return
    try:
        load_kept()
    except NotKept as missing:
        say_that_it_takes_time()
        if missing.folder is not None:
            with _alone_in(missing.folder):
                _compile()
        _load()  # and compiles what they could not, so that their errors are this process's


def load_kept() -> None:
    """Load all kernels from the disk.

    Raises:
        NotKept: one would have to be compiled.
    """
    with kept_only():
        _load()


class Compilation:
    """Child processes that compile all kernels, and end with this process; to be closed.

    Args:
        processes: how many share the work.
        niceness: of theirs, over this process's.
    """

    def __init__(self, processes: int = 1, niceness: int = 0) -> None:
        self._children: list[subprocess.Popen[bytes]] = []
        for first in range(min(processes, len(MODULES))):
            command = [sys.executable, "-m", MODULE, "--child", str(niceness), *MODULES[first::processes]]
            # Its standard input ends with us, and so does it; the terminal's Ctrl-C is ours alone.
            child = subprocess.Popen(
                command,
                stdin=subprocess.PIPE,
                stdout=subprocess.DEVNULL,
                stderr=subprocess.PIPE,
                start_new_session=True,
            )
            self._children.append(child)

    def __enter__(self) -> Compilation:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def wait(self) -> str:
        """Wait until all is compiled, or the children were ended.

        Returns:
            Why one has failed, in words; empty where none has.
        """
        problem = ""
        for child in self._children:
            lines = b"" if child.stderr is None else child.stderr.read()
            if child.wait() != 0:
                said = lines.decode("utf-8", "replace").strip().splitlines()
                problem = said[-1] if said else f"the process that compiles ended with status {child.returncode}"
        return problem

    def close(self) -> None:
        """End the children that are still at work; what they have compiled is kept."""
        for child in self._children:
            if child.poll() is None:
                child.kill()
            child.wait()
            for stream in (child.stdin, child.stderr):
                if stream is not None:
                    stream.close()


def _compile() -> None:
    """Have all kernels compiled, unless somebody else has done so while it was waited for."""
    try:
        load_kept()
    except NotKept:
        with Compilation(os.cpu_count() or 1) as compilation:
            compilation.wait()


@contextmanager
def _alone_in(folder: str) -> Iterator[None]:
    """One process at a time; of a pool's all start at once."""
    handle = os.open(folder, os.O_RDONLY)
    try:
        fcntl.flock(handle, fcntl.LOCK_EX)
        yield
    finally:
        os.close(handle)


def _load() -> None:
    for module in MODULES:
        import_module(module)


def _end_with_the_parent() -> None:
    os.read(0, 1)  # not by way of sys.stdin, whose lock nobody may hold when Python ends
    os._exit(1)


def main(arguments: Sequence[str]) -> None:
    """Compile all kernels, or as a child of `Compilation` some."""
    if arguments[:1] == ["--child"]:
        os.nice(int(arguments[1]))
        threading.Thread(target=_end_with_the_parent, daemon=True).start()
        for module in arguments[2:]:
            import_module(module)
    else:
        load_kernels()


if __name__ == "__main__":
    main(sys.argv[1:])
