"""The tracker's own process without its dry run, which takes a second: for tests that start many.

`python -m support.brisk_tracker lasso_tracker …` runs the node as `lasso_motion_ros.nodes.executables` does.
"""

from __future__ import annotations

import sys

from lasso_motion_ros.nodes import tracker_node
from lasso_motion_ros.nodes.executables import main

if __name__ == "__main__":
    tracker_node.warm_up = lambda *_: []
    sys.exit(main(sys.argv[1:]))
