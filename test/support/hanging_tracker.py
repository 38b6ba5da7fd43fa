"""The tracker's own process, which hangs in the middle of a pair while the file named by HANG is there.

`python -m support.hanging_tracker lasso_tracker …` runs the node as `lasso_motion_ros.nodes.executables` does.
"""

from __future__ import annotations

import os
import sys
import time
from pathlib import Path

from support import brisk_tracker

from lasso_motion_ros.ring.tracker import RingTracker

_track = RingTracker.track
HANG = Path(os.environ["HANG"])


def _hanging(self, pair):
    while HANG.exists():
        time.sleep(0.02)
    return _track(self, pair)


if __name__ == "__main__":
    RingTracker.track = _hanging
    sys.exit(brisk_tracker.run())
