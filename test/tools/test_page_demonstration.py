"""The demonstration with its page, as a user runs it: it comes up, plays over and over, and leaves nothing behind."""

from __future__ import annotations

import asyncio
import itertools
import json
import signal
import subprocess
import sys
import threading
from pathlib import Path

import pytest

pytest.importorskip("rclpy", reason="needs ROS 2")
pytest.importorskip("trimesh", reason="needs the overlay extra")
pytest.importorskip("aiohttp", reason="needs the web extra")

import aiohttp
from rcl_interfaces.msg import ParameterValue
from rcl_interfaces.srv import GetParameters
from support.child_processes import children_of, is_running
from support.drawn_recording import stamp, write_input

from lasso_motion_ros.overlay.atrium import left_atrium_surface
from lasso_motion_ros.overlay.surface_files import write_stl
from lasso_motion_ros.tools.listener import Listener
from lasso_motion_ros.tools.player import round_period_ns
from lasso_motion_ros.web.recorded_rounds import recorded_stamp
from msg_adapters.recordings.reader import RecordingReader

PATIENCE_S = 60.0


async def states(url: str, wanted: list[str]) -> list[str]:
    """States that the page is told, in order, until they end with those wanted."""
    seen: list[str] = []
    async with (
        asyncio.timeout(PATIENCE_S),
        aiohttp.ClientSession() as session,
        session.ws_connect(f"{url}live", origin=url.rstrip("/"), max_msg_size=0) as socket,
    ):
        async for message in socket:
            if message.type is aiohttp.WSMsgType.TEXT and (status := json.loads(message.data))["type"] == "status":
                if not seen or seen[-1] != status["state"]:
                    seen.append(status["state"])
                if seen[-len(wanted) :] == wanted:
                    return seen
    raise AssertionError(seen)


@pytest.mark.ros
@pytest.mark.parametrize("truth", [True, False], ids=["with overlay", "without truth"])
def test_it_tracks_until_it_is_stopped(tmp_path: Path, truth: bool) -> None:
    bag = write_input(tmp_path / "ring.mcap", [0.0, 2.0, 5.0, 3.0, 1.0, 0.0, 2.0, 5.0], truth=truth)
    command = [sys.executable, "-m", "lasso_motion_ros.cli.main", "demo", "--web", "--quiet", "--port", "0"]
    with subprocess.Popen(
        [*command, "--bag", str(bag), "--out", str(tmp_path / "out")], stdout=subprocess.PIPE, encoding="utf-8"
    ) as demo:
        try:
            assert demo.stdout is not None
            url = demo.stdout.readline().split()[1]
            children = children_of(demo.pid)
            assert len(children) == (4 if truth else 3)
            # What plays round after round is the player, whatever stands beside it.
            asyncio.run(states(url, ["TRACKING", "WAITING_FOR_SEED", "TRACKING"] if truth else ["TRACKING"]))
        finally:
            demo.send_signal(signal.SIGINT)
        assert demo.wait(60) == 0
        assert not any(is_running(child) for child in children)


def parameters(domain: int, node: str, names: tuple[str, ...]) -> list[ParameterValue]:
    """What a running node has for parameters."""
    with Listener([], lambda *_: None, domain=domain) as listener:
        client = listener.node.create_client(GetParameters, f"/{node}/get_parameters")
        assert client.wait_for_service(PATIENCE_S)
        future = client.call_async(GetParameters.Request(names=list(names)))
        answered = threading.Event()
        future.add_done_callback(lambda _: answered.set())
        assert answered.wait(PATIENCE_S)
        return list(future.result().values)


def test_clicks_on_any_round_are_on_the_recorded_pair(tmp_path: Path) -> None:
    bag = write_input(tmp_path / "ring.mcap", [0.0] * 4, truth=False)
    period_ns = round_period_ns(RecordingReader(bag))
    assert period_ns == stamp(3) - stamp(0) + 1_000_000_000
    for played, pair in itertools.product(range(3), range(4)):
        shown = stamp(pair) + played * period_ns
        assert recorded_stamp(shown, stamp(0) - 500_000_000, period_ns) == stamp(pair)
        assert recorded_stamp(shown, 0, 0) == shown  # a live graph knows no rounds


@pytest.mark.ros
def test_one_command_shows_a_recording_with_the_users_atrium(tmp_path: Path) -> None:
    bag = write_input(tmp_path / "ring.mcap", [0.0, 2.0, 5.0, 3.0, 1.0, 0.0, 2.0, 5.0])
    write_stl(tmp_path / "mine.stl", left_atrium_surface(4.0), "mm")
    command = [sys.executable, "-m", "lasso_motion_ros.cli.main", "web", str(bag), "--port", "0"]
    command += ["--volume", str(tmp_path / "mine.stl"), "--units", "mm", "--registration", "0 0 0.01 0 0 0 1"]
    asked = rounds = []
    with subprocess.Popen(command, stdout=subprocess.PIPE, encoding="utf-8") as served:
        try:
            assert served.stdout is not None
            line = served.stdout.readline()
            children = children_of(served.pid)
            assert len(children) == 4  # tracker, overlay, page, player
            asyncio.run(states(line.split()[1], ["TRACKING"]))
            domain = line.partition("ROS_DOMAIN_ID=")[2].split(",")[0]
            asked = parameters(int(domain), "lasso_overlay", ("volume_file", "registration"))
            rounds = parameters(int(domain), "lasso_web", ("rounds.first_ns", "rounds.period_ns"))
        finally:
            served.send_signal(signal.SIGINT)
        assert served.wait(60) == 0
        assert not any(is_running(child) for child in children)
    assert [value.string_value for value in asked] == [str(tmp_path / "mine.stl"), "0 0 0.01 0 0 0 1"]
    assert [value.integer_value for value in rounds] == [stamp(0) - 500_000_000, round_period_ns(RecordingReader(bag))]
