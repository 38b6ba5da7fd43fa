"""What holds for all tests: the same examples every time, one thread for linear algebra, no word to other machines."""

from __future__ import annotations

import importlib.util
import locale
import os
import re
import signal
from collections.abc import Iterator
from pathlib import Path
from typing import Any

# Before numpy and rclpy are imported by any test; child processes inherit them.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
os.environ["ROS_AUTOMATIC_DISCOVERY_RANGE"] = "LOCALHOST"
os.environ.pop("PYTHONUNBUFFERED", None)  # a developer's shell may set it; a user's has it not

import pytest

# A shell that starts the tests in the background leaves SIGINT ignored, and every process that they start would
# inherit that: what is to stop on Ctrl-C could not. Handled here, it is at its default in those processes.
signal.signal(signal.SIGINT, signal.default_int_handler)


# What a plain ROS machine has not, where `colcon test` runs these tests; what needs it is left out there, and named.
MISSING = [name for name in ("hypothesis", "mcap_ros2") if importlib.util.find_spec(name) is None]
collect_ignore = [
    str(path)
    for path in sorted(Path(__file__).parent.rglob("test_*.py"))
    if any(re.search(rf"^from {name}\b", path.read_text(encoding="utf-8"), re.MULTILINE) for name in MISSING)
]
if "hypothesis" not in MISSING:
    from hypothesis import settings

    settings.register_profile("project", deadline=None, derandomize=True)
    settings.load_profile("project")


def pytest_configure(config: pytest.Config) -> None:
    """Compile the kernels once, where they are there, before tests and the processes that they start wait for it."""
    if importlib.util.find_spec("numba") is not None and not hasattr(config, "workerinput"):
        from lasso_motion_ros.config.tracker import TrackerConfig
        from lasso_motion_ros.stream.tracker_factory import create_tracker

        create_tracker(TrackerConfig())


def pytest_report_header() -> list[str]:
    """Which tests are left out, and for want of what."""
    names = ", ".join(Path(path).name for path in collect_ignore)
    return [f"left out without {' and '.join(MISSING)}: {names}"] if MISSING else []


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
