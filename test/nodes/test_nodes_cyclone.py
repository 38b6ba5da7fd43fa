"""Another implementation of DDS, Cyclone DDS, feeds the tracker and hears its motion."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from support.paths import SCRIPT_PATH, SUPPORT

pytest.importorskip("rclpy", reason="needs ROS 2")
pytest.importorskip("cyclonedds", reason="needs Cyclone DDS (pip install cyclonedds)")

from support.node_harness import Graph
from support.ring_stream import displacement_mm, stamp, start_tracker

from msg_adapters import topics

pytestmark = pytest.mark.ros
PAIRS, SIDE = 8, 256
# On this machine alone, by unicast, as the tracker is told to by ROS_AUTOMATIC_DISCOVERY_RANGE.
CONFIGURATION = """\
<CycloneDDS><Domain id="any">
  <General><Interfaces><NetworkInterface name="lo"/></Interfaces><AllowMulticast>false</AllowMulticast></General>
  <Discovery>
    <ParticipantIndex>auto</ParticipantIndex><MaxAutoParticipantIndex>32</MaxAutoParticipantIndex>
    <Peers><Peer address="127.0.0.1"/></Peers>
  </Discovery>
</Domain></CycloneDDS>"""


def test_cyclone_dds_feeds_the_tracker_and_hears_its_motion(tmp_path: Path) -> None:
    script = SUPPORT / "cyclone_peer.py"
    with Graph((topics.STATE,), tmp_path) as graph:
        start_tracker(graph)
        environment = os.environ | {
            "CYCLONEDDS_URI": CONFIGURATION.replace('id="any"', f'id="{graph.domain}"'),
            "PYTHONPATH": SCRIPT_PATH,
        }
        command = [sys.executable, str(script), str(PAIRS), str(SIDE)]
        done = subprocess.run(
            command, env=environment, capture_output=True, text=True, check=False, timeout=240, cwd=tmp_path
        )
        assert done.returncode == 0, done.stderr
    heard = {
        int(at): np.array([float(x), float(y), float(z)]) for at, x, y, z in map(str.split, done.stdout.splitlines())
    }
    first = min(heard)
    assert sorted(heard) == [first + stamp(number) - stamp(0) for number in range(PAIRS)]
    for at, motion in heard.items():
        np.testing.assert_allclose(1e3 * motion, displacement_mm(at) - displacement_mm(first), atol=0.5)
