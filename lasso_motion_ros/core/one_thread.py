"""One thread for arithmetic: a time means the same whatever the number of cores, and processes share them evenly."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from lasso_motion_ros.core.memory import keep_freed_memory


@contextmanager
def one_thread() -> Iterator[None]:
    """Limit BLAS, OpenMP and OpenCV to one thread each; keep freed memory as the node does."""
    import cv2
    from threadpoolctl import threadpool_limits

    keep_freed_memory()
    before = cv2.getNumThreads()
    cv2.setNumThreads(1)
    try:
        with threadpool_limits(limits=1):
            yield
    finally:
        cv2.setNumThreads(before)
