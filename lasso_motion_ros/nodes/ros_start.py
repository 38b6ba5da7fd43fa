"""How a process starts ROS, and what keeps it from starting, in one line for the user."""

from __future__ import annotations

import importlib.util
import os
import re
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from lasso_motion_ros.core.errors import ConfigurationError, LassoMotionError
from lasso_motion_ros.nodes.fastdds import use_image_profile

NO_ROS = "rclpy is not installed: install the [ros] extra or source a ROS 2 Jazzy installation"
MIXED = "is another distribution of ROS 2 on PYTHONPATH, AMENT_PREFIX_PATH or LD_LIBRARY_PATH? We need Jazzy"
HIGHEST_DOMAIN = 232
PROBE_WAIT_S = 60.0

# Where rcl and rmw say in which line of their own sources they found it.
_SOURCE_LINES = re.compile(r",? at \S+\.[ch](pp)?:\d+")
_ROS_PACKAGES = ("rclpy", "rosidl_generator_py", "rosidl_pycommon", "rpyutils")


def require_ros() -> None:
    """Say plainly when there is no ROS, or one that cannot be used.

    Raises:
        LassoMotionError: rclpy cannot be imported, or the environment asks for what is not there.
    """
    chosen_domain()
    _check_middleware()
    try:
        import rclpy  # noqa: F401 - only whether it is there
    except Exception as error:  # whatever another distribution's modules raise here
        if importlib.util.find_spec("rclpy") is None:
            raise LassoMotionError(NO_ROS) from error
        raise LassoMotionError(f"rclpy cannot be used: {_one_line(str(error))}; {MIXED}") from error


def chosen_domain() -> int | None:
    """The DDS domain that the environment names, or None.

    Raises:
        ConfigurationError: ROS_DOMAIN_ID is no number of a domain.
    """
    text = os.environ.get("ROS_DOMAIN_ID", "")
    if not text:
        return None
    if not re.fullmatch(r"\d{1,3}", text) or int(text) > HIGHEST_DOMAIN:
        raise ConfigurationError(f"ROS_DOMAIN_ID: expected 0 to {HIGHEST_DOMAIN}, found {text!r}")
    return int(text)


def start_ros(arguments: list[str] | None) -> str | None:
    """Start rclpy in this process, with room for images and without its signal handlers.

    Args:
        arguments: the process's own, ROS arguments included; None takes `sys.argv`.

    Returns:
        A line that says why images may be lost, or None.

    Raises:
        ConfigurationError: arguments, a parameter file or an environment that ROS does not take.
    """
    warning = use_image_profile()
    import rclpy
    from rclpy import logging
    from rclpy.signals import SignalHandlerOptions

    # rcl would log on a line of its own, before ours, that something is wrong with an argument.
    logging.set_logger_level("rcl", logging.LoggingSeverity.FATAL)
    try:
        rclpy.init(args=arguments, signal_handler_options=SignalHandlerOptions.NO)
    except Exception as error:
        rclpy.try_shutdown()
        words = ros_problem(error)
        if words is None:
            raise
        raise ConfigurationError(words) from error
    if logging.get_logger_level("rcl") == logging.LoggingSeverity.FATAL:  # not set by the arguments
        logging.set_logger_level("rcl", logging.LoggingSeverity.UNSET)
    return warning


@contextmanager
def ros_session() -> Iterator[str | None]:
    """ROS for the time of a block, without arguments.

    Yields:
        A line that says why images that are published here may be lost, or None.

    Raises:
        ConfigurationError: an environment that ROS does not take.
    """
    warning = start_ros([])
    import rclpy

    try:
        yield warning
    except Exception as error:
        words = ros_problem(error)
        if words is None:
            raise
        raise ConfigurationError(words) from error
    finally:
        rclpy.try_shutdown()


def ros_problem(error: Exception) -> str | None:
    """An error of ROS itself (its arguments, its libraries) in one line; None where it is none."""
    package = type(error).__module__.partition(".")[0]
    if (isinstance(error, ImportError) and _is_of_ros(error)) or package in _ROS_PACKAGES[1:]:
        return f"{type(error).__name__}: {_one_line(str(error))}; {MIXED}"
    if package not in _ROS_PACKAGES:
        return None
    if type(error).__name__ == "UnknownROSArgsError":
        return f"ROS does not know these arguments: {error}"
    return _one_line(str(error))


def _is_of_ros(error: ImportError) -> bool:
    """Whether what could not be imported belongs to ROS, and not to another library that is broken by itself."""
    named = f"{error.name or ''} {error.path or ''} {error}"
    return any(word in named for word in (*_ROS_PACKAGES, "rcl", "rmw", "_msgs", "rosidl"))


def _one_line(text: str) -> str:
    return " ".join(_SOURCE_LINES.sub("", text).split()).removeprefix("failed to initialize rcl: ")


def _check_middleware() -> None:
    """Try an RMW implementation of another prefix than rclpy's in a child process: the library would end this one.

    Raises:
        ConfigurationError: it cannot be used.
    """
    name = os.environ.get("RMW_IMPLEMENTATION", "")
    rclpy = None if not name or "rclpy" in sys.modules else importlib.util.find_spec("rclpy")
    if rclpy is None or rclpy.origin is None:
        return
    index = Path("share/ament_index/resource_index/packages") / name
    if any((prefix / index).is_file() for prefix in Path(rclpy.origin).parents):
        return
    try:
        tried = subprocess.run(
            [sys.executable, "-c", "import rclpy; rclpy.init(args=[])"],
            capture_output=True,
            encoding="utf-8",
            errors="replace",
            check=False,
            timeout=PROBE_WAIT_S,
        )
    except subprocess.TimeoutExpired as error:
        text = f"RMW_IMPLEMENTATION: {name!r} cannot be used here: not ready within {PROBE_WAIT_S:g} s"
        raise ConfigurationError(text) from error
    if tried.returncode != 0:
        said = [line for line in tried.stderr.splitlines() if line.strip()] or [f"status {tried.returncode}"]
        found = re.sub(r"^\[\w+\] \[[\d.]+\] (\[rcl\]: )?", "", said[-1])
        raise ConfigurationError(f"RMW_IMPLEMENTATION: {name!r} cannot be used here: {_one_line(found)}")
