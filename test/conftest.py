"""What holds for all tests: the same examples every time, one thread for linear algebra, no word to other machines."""

from __future__ import annotations

import locale
import os
import signal
from collections.abc import Iterator
from typing import Any

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


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_make_scheduler(config: pytest.Config, log: Any) -> Any:
    """How tests are shared out where pytest-xdist runs them beside each other (`-n`)."""
    from support.beside import OneRowOfProcesses

    return OneRowOfProcesses(config, log)


@pytest.fixture(autouse=True)
def the_locale_is_kept() -> Iterator[None]:
    """GDCM leaves the process's locale at C, after which any later test would take text files for ASCII."""
    before = locale.setlocale(locale.LC_ALL)
    yield
    locale.setlocale(locale.LC_ALL, before)
