"""The tracker's own process without its dry run, which takes a second: for tests that start many.

And however slow the machine is, it answers all pairs in their order: what is left out otherwise is tested by itself
(`test/nodes/test_nodes_worker.py`).

`python -m support.brisk_tracker lasso_tracker …` runs the node as `lasso_motion_ros.nodes.executables` does.
"""

from __future__ import annotations

import dataclasses
import math
import sys

from lasso_motion_ros.nodes import answering, tracker_node
from lasso_motion_ros.nodes.executables import main


def run() -> int:
    """Run the node so; returns its exit status."""
    tracker_node.warm_up = lambda *_: []
    patient = {"behind_s": math.inf, "late_s": math.inf, "waiting_pairs": 1000}
    answering.TUNING = dataclasses.replace(answering.TUNING, **patient)
    return main(sys.argv[1:])


if __name__ == "__main__":
    sys.exit(run())
