"""The compiled kernels of a node that answers at once: from the disk, else from a process that compiles meanwhile."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable

from lasso_motion_ros.core.compiled import NotKept, arithmetic, compiled_here, has_kernels, hold_back
from lasso_motion_ros.stream.kernels import Compilation, load_kept

NICENESS = 10
"""Of the process that compiles, over the node's."""
MEANWHILE = "the extra `fast` is being compiled for this machine, once"


class KernelsAside:
    """Has the kernels compiled where they are not kept; until then the plain versions track, with the same results.

    Args:
        inform: takes a line for the log.
        warn: takes a line that somebody has to do something about.
        dry_run: called in a thread of its own before the kernels run for all: what first calls cost is paid there.
    """

    def __init__(
        self, inform: Callable[[str], None], warn: Callable[[str], None], dry_run: Callable[[], object]
    ) -> None:
        self._inform, self._warn, self._dry_run = inform, warn, dry_run
        self._compilation: Compilation | None = None
        self._waiting: threading.Thread | None = None
        self._is_closed = False

    def begin(self) -> None:
        """Load the kernels, or have them compiled; returns at once.

        Raises:
            ConfigurationError: Numba is installed, but cannot be used.
        """
        if self._compilation is not None or not has_kernels():
            return
        try:
            load_kept()
        except NotKept as missing:
            if missing.folder is None:
                hold_back(str(missing))
                self._warn(f"the extra `fast` is not used: {missing}")
                return
            hold_back(MEANWHILE)
            self._inform(f"{MEANWHILE}, beside the work: for a minute or two each pair takes longer")
            self._compilation = Compilation(niceness=NICENESS)
            self._waiting = threading.Thread(target=self._wait, args=(self._compilation,), name="kernels", daemon=True)
            self._waiting.start()

    def close(self) -> None:
        """End what is still being compiled; what is finished is kept for the next start."""
        self._is_closed = True
        if self._compilation is not None:
            self._compilation.close()

    def _wait(self, compilation: Compilation) -> None:
        begun_s = time.monotonic()
        problem = compilation.wait()
        if self._is_closed:
            return
        try:
            load_kept()
            with compiled_here():
                self._dry_run()
        except Exception as error:  # whatever it is, the plain versions go on
            hold_back(f"the extra `fast` could not be compiled: {problem or error}")
            self._warn(arithmetic())
            return
        hold_back("")
        self._inform(f"compiled after {time.monotonic() - begun_s:.0f} s: a pair takes less from now on")
