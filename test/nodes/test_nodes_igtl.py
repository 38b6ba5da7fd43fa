"""The live way to an OpenIGTLink server: a real process between DDS and pyigtl's server."""

from __future__ import annotations

from pathlib import Path

import pytest

pytest.importorskip("rclpy", reason="needs ROS 2")
pytest.importorskip("pyigtl", reason="needs the igtl extra")

from support.drawn_recording import shift, stamp
from support.igtl_peer import IgtlPeer
from support.node_harness import Graph

from msg_adapters.messages import RosMessages, header_fields
from msg_adapters.poses import encode_pose_stamped
from msg_adapters.topics import MOTION, STATE

pytestmark = pytest.mark.ros


def test_a_transform_goes_only_with_a_fresh_state_that_tells_of_a_pose(tmp_path: Path) -> None:
    with Graph([], tmp_path) as graph, IgtlPeer() as peer:
        publishers = {topic: graph.publisher(topic, latched=topic.latched) for topic in (STATE, MOTION)}

        def say(state: str) -> None:
            publishers[STATE].publish(RosMessages().make(STATE.type_name, {"data": state}))

        def hear(state: str) -> None:
            say(state)
            peer.wait_for(lambda: peer.words()[-1] == state)

        def move(pair: int, z_mm: float, frame: str = "patient_table") -> None:
            fields = encode_pose_stamped(shift(z_mm), header_fields(stamp(pair), frame))
            publishers[MOTION].publish(RosMessages().make(MOTION.type_name, fields))

        say("TRACKING")  # latched, and who said it may be gone: no word for the server yet
        options = ["--to", f"127.0.0.1:{peer.port}", "--ros-args", "-p", "state_timeout_s:=2.0"]
        graph.processes.start("igtl", "lasso_motion_ros.cli.main", ["igtl", *options])
        graph.wait_until(lambda: all(one.get_subscription_count() for one in publishers.values()))
        peer.wait_for(lambda: peer.words() == ["STALE"])
        move(0, 1.0)  # nobody has said a state with it
        hear("LOST")
        hear("TRACKING")
        move(1, 2.0)
        peer.wait_for(lambda: len(peer.transforms()) == 1)
        hear("LOST")
        move(2, 3.0)
        hear("DISPLACED")
        hear("DEGRADED")
        move(3, 4.0, frame="elsewhere")
        move(4, 5.0)
        peer.wait_for(lambda: len(peer.transforms()) == 2)
        peer.wait_for(lambda: peer.words()[-1] == "STALE")  # said once
        move(5, 6.0)
        hear("LOST")
        hear("TRACKING")
        graph.processes.stop()
        peer.wait_for(lambda: peer.words()[-1] == "STALE")  # the node's goodbye
        # Topics have no order among each other: a state that was heard in between makes one.
        expected = "STALE LOST TRACKING LOST DISPLACED DEGRADED STALE LOST TRACKING STALE"
        assert peer.words() == expected.split()
        assert [round(float(one.matrix[2, 3]), 3) for one in peer.transforms()] == [2.0, 5.0]
        assert [one.timestamp for one in peer.transforms()] == pytest.approx([1e-9 * stamp(1), 1e-9 * stamp(4)])
        log = graph.processes.log("igtl", 20)
        assert f"connected to 127.0.0.1:{peer.port}" in log
        assert "motion is in frame 'elsewhere', expected 'patient_table'" in log
