"""What holds for all tests: the same examples every time, one thread for linear algebra, no word to other machines."""

from __future__ import annotations

import locale
import os
import signal
from collections.abc import Iterator

# Before numpy and rclpy are imported by any test; child processes inherit them.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
os.environ["ROS_AUTOMATIC_DISCOVERY_RANGE"] = "LOCALHOST"
os.environ.pop("PYTHONUNBUFFERED", None)  # a developer's shell may set it; a user's has it not

import pytest
from hypothesis import settings

# A shell that starts the tests in the background leaves SIGINT ignored, and every process that they start would
# inherit that: what is to stop on Ctrl-C could not. Handled here, it is at its default in those processes.
signal.signal(signal.SIGINT, signal.default_int_handler)


settings.register_profile("project", deadline=None, derandomize=True)
settings.load_profile("project")


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Where tests run side by side, those with processes of their own stay in one row: each has the machine's pace."""
    for item in items:
        if item.get_closest_marker("ros") or item.get_closest_marker("packaging"):
            item.add_marker(pytest.mark.xdist_group("processes"))


@pytest.fixture(autouse=True)
def the_locale_is_kept() -> Iterator[None]:
    """GDCM leaves the process's locale at C, after which any later test would take text files for ASCII."""
    before = locale.setlocale(locale.LC_ALL)
    yield
    locale.setlocale(locale.LC_ALL, before)
