"""The demonstration with its page, as a user runs it: it comes up, plays over and over, and leaves nothing behind."""

from __future__ import annotations

import asyncio
import json
import signal
import subprocess
import sys
from pathlib import Path

import pytest

pytest.importorskip("rclpy", reason="needs ROS 2")
pytest.importorskip("trimesh", reason="needs the overlay extra")
pytest.importorskip("aiohttp", reason="needs the web extra")

import aiohttp
from support.child_processes import children_of, is_running
from support.drawn_recording import write_input

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
def test_it_tracks_round_after_round_until_it_is_stopped(tmp_path: Path, truth: bool) -> None:
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
            asyncio.run(states(url, ["TRACKING", "WAITING_FOR_SEED", "TRACKING"]))
        finally:
            demo.send_signal(signal.SIGINT)
        assert demo.wait(60) == 0
        assert not any(is_running(child) for child in children)
