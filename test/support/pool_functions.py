"""What workers of another process are asked to do in tests."""

from __future__ import annotations

import os
import signal
import time
from pathlib import Path

import cv2


def fate(item: tuple[str, Path]) -> tuple[str, int, bool]:
    """Live or die as told; answers the item, OpenCV's threads, and whether Ctrl-C is kept away."""
    what, mark = item
    if what == "dies" or (what == "dies once" and not mark.exists()):
        mark.touch()
        os.kill(os.getpid(), signal.SIGKILL)
    return what, cv2.getNumThreads(), signal.SIGINT in signal.pthread_sigmask(signal.SIG_BLOCK, ())


def sleep(mark: Path) -> None:
    """Say who works on it, and never come to an end."""
    mark.with_name(f"{mark.name}.{os.getpid()}").touch()
    time.sleep(1000.0)
