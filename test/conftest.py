"""What holds for all tests: the same examples every time, one thread for linear algebra, no word to other machines."""

from __future__ import annotations

import os

# Before numpy and rclpy are imported by any test; child processes inherit them.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
os.environ["ROS_AUTOMATIC_DISCOVERY_RANGE"] = "LOCALHOST"

from hypothesis import settings

settings.register_profile("project", deadline=None, derandomize=True)
settings.load_profile("project")
