"""The player over real DDS: every message arrives unchanged, at its time, latched ones latched."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import threading
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("rclpy", reason="needs ROS 2")

from support.node_harness import Graph, Heard

from lasso_motion_ros.nodes import ros_start
from lasso_motion_ros.tools import player
from lasso_motion_ros.tools.listener import Listener
from lasso_motion_ros.tools.processes import LOOPBACK, free_domain
from msg_adapters.images import encode_image
from msg_adapters.messages import header_fields, stamp_to_ns
from msg_adapters.recordings.reader import RecordingReader
from msg_adapters.recordings.writer import RecordingWriter
from msg_adapters.topics import MOTION, Topic, image_topic

pytestmark = pytest.mark.ros

START_NS = 1_760_000_000_000_000_000
STEP_NS = 50_000_000
FRAMES = 12
NOTE = Topic("note", "std_msgs/msg/String", latched=True, depth=1)
CLOCK = Topic("/clock", "rosgraph_msgs/msg/Clock")
IMAGES = (image_topic("a"), image_topic("b"))


@pytest.fixture
def recording(tmp_path: Path) -> Path:
    return write(tmp_path / "in.mcap", 1024)


@pytest.fixture
def small(tmp_path: Path) -> Path:
    """The same with small images: however fast it is played, a listener that is held up has room for what comes."""
    return write(tmp_path / "small.mcap", 32)


def write(path: Path, side: int) -> Path:
    generator = np.random.default_rng(1)
    with RecordingWriter(path, compression="none") as writer:
        writer.write("/note", NOTE.type_name, {"data": "first"}, START_NS, latched=True)
        for index in range(FRAMES):
            stamp = START_NS + index * STEP_NS
            for topic in IMAGES:
                pixels = generator.integers(0, 4096, (side, side), dtype=np.uint16)
                fields = encode_image(pixels, header_fields(stamp, topic.name[:7]))
                writer.write(topic.recorded_name, topic.type_name, fields, stamp)
            writer.write("/motion", MOTION.type_name, {"header": header_fields(stamp)}, stamp)
    return path


def graph(monkeypatch: pytest.MonkeyPatch, tmp_path: Path, *topics: Topic) -> Graph:
    for name, value in LOOPBACK.items():
        monkeypatch.setenv(name, value)
    return Graph(topics, tmp_path)


def play(started: Graph, *arguments: str | Path) -> None:
    started.processes.start("player", "lasso_motion_ros.cli.main", ["play", *map(str, arguments)])


def stamps(started: Graph, topic: Topic) -> list[int]:
    return [(stamp_to_ns(message.header.stamp) - START_NS) // STEP_NS for message in started.heard.messages[topic.name]]


def test_every_large_image_arrives_once_and_in_order(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, recording: Path
) -> None:
    with graph(monkeypatch, tmp_path, NOTE, MOTION, *IMAGES) as started:
        play(started, recording, "--wait", "20")
        assert started.wait_for_end("player") == 0
        started.heard.wait_for(lambda: all(len(stamps(started, topic)) == FRAMES for topic in IMAGES))
        assert stamps(started, IMAGES[0]) == stamps(started, IMAGES[1]) == list(range(FRAMES))
        first = started.heard.messages[IMAGES[0].name][0]
        expected = np.random.default_rng(1).integers(0, 4096, (1024, 1024), dtype=np.uint16)
        np.testing.assert_array_equal(np.frombuffer(first.data, np.uint16).reshape(1024, 1024), expected)
        assert started.heard.messages["motion"] == []  # what a tracker put out is left out
        assert started.processes.log("player", 1).startswith(f"published {2 * FRAMES + 1} messages on 3 topics")


def test_a_latched_message_is_there_whatever_the_start(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, recording: Path
) -> None:
    with graph(monkeypatch, tmp_path, NOTE, MOTION, CLOCK, *IMAGES) as started:
        play(started, recording, "--wait", "20", "--start", "0.4", "--clock", "--all", "--remap", "motion:=/earlier")
        assert started.wait_for_end("player") == 0
        started.heard.wait_for(lambda: all(stamps(started, topic)[-1:] == [FRAMES - 1] for topic in IMAGES))
        assert stamps(started, IMAGES[0]) == list(range(8, FRAMES))
        assert [message.data for message in started.heard.messages["note"]] == ["first"]
        assert started.heard.messages["motion"] == []  # it has another name now
        clock = [stamp_to_ns(message.clock) for message in started.heard.messages["/clock"]]
        assert clock == sorted(clock)
        assert START_NS + 8 * STEP_NS <= clock[0] <= clock[-1] <= START_NS + FRAMES * STEP_NS


def test_loop_plays_again_until_interrupted(monkeypatch: pytest.MonkeyPatch, tmp_path: Path, small: Path) -> None:
    with graph(monkeypatch, tmp_path, *IMAGES) as started:
        play(started, small, "--wait", "20", "--loop", "--rate", "4")
        started.heard.wait_for(lambda: len(stamps(started, IMAGES[0])) > FRAMES)
        started.processes.send("player", signal.SIGINT)
        assert started.wait_for_end("player") == 130
        assert stamps(started, IMAGES[0])[: FRAMES + 1] == [*range(FRAMES), 0]


def test_endless_goes_on_with_later_stamps(monkeypatch: pytest.MonkeyPatch, tmp_path: Path, small: Path) -> None:
    with graph(monkeypatch, tmp_path, NOTE, CLOCK, *IMAGES) as started:
        play(started, small, "--wait", "20", "--endless", "--rate", "4", "--clock")
        started.heard.wait_for(lambda: len(stamps(started, IMAGES[1])) > 2 * FRAMES)
        started.processes.send("player", signal.SIGINT)
        assert started.wait_for_end("player") == 130
        later = FRAMES - 1 + round(1e9 / STEP_NS)  # from the last image a second on to the first again
        heard = stamps(started, IMAGES[0])
        assert heard == [later * (number // FRAMES) + number % FRAMES for number in range(len(heard))]
        images = started.heard.messages[IMAGES[0].name]
        assert bytes(images[FRAMES].data) == bytes(images[0].data)
        assert images[FRAMES].header.frame_id == images[0].header.frame_id
        assert {message.data for message in started.heard.messages["note"]} == {"first"}
        clock = [stamp_to_ns(message.clock) for message in started.heard.messages["/clock"]]
        assert clock == sorted(clock)


def test_who_joins_late_gets_what_is_latched_though_it_lay_before_the_start(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, small: Path
) -> None:
    late = Heard()
    with graph(monkeypatch, tmp_path, *IMAGES) as started:
        play(started, small, "--wait", "20", "--loop", "--rate", "4", "--start", "0.4")
        started.heard.wait_for(lambda: len(stamps(started, IMAGES[0])) > 4)
        assert set(stamps(started, IMAGES[0])) == {8, 9, 10, 11}
        with Listener([NOTE], late, domain=started.domain):
            late.wait_for(lambda: late.messages["note"] != [])
        assert late.messages["note"][0].data == "first"


@pytest.mark.parametrize("more", [(), ("--loop",)])
def test_a_start_behind_the_end_is_refused(recording: Path, more: tuple[str, ...]) -> None:
    done = run("play", str(recording), "--no-wait", "--start", "60", *more)
    assert done.returncode == 2
    assert done.stderr == (f"lasso-motion play: {recording}: nothing is left to play 60 s after its first message\n")


def test_nobody_listens(tmp_path: Path, recording: Path) -> None:
    done = run("play", str(recording), "--wait", "0.1")
    assert done.returncode == 2
    assert done.stderr == ("lasso-motion play: no subscriber on /plane_a/image_raw, /plane_b/image_raw within 0.1 s\n")


def test_without_an_option_it_says_who_is_missing_and_plays_all_the_same(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, small: Path
) -> None:
    said: list[str] = []
    monkeypatch.setattr(player, "TUNING", replace(player.TUNING, silent_wait_s=0.1))
    monkeypatch.setenv("ROS_DOMAIN_ID", str(free_domain()))
    monkeypatch.setattr(ros_start, "use_image_profile", lambda: "images may be lost")
    options = player.PlayOptions(rate=100.0, wait_s=0.3, insist=False)
    done = player.play(RecordingReader(small), options, threading.Event(), say=said.append)
    topics = "/plane_a/image_raw, /plane_b/image_raw"
    assert said == [
        "images may be lost",
        f"waiting for subscribers on {topics}, 0.3 s at most",
        f"no subscriber on {topics} within 0.3 s: played without",
    ]
    assert done.published["/plane_a/image_raw"] == FRAMES


def test_a_recording_cut_short_is_played_as_far_as_it_goes(tmp_path: Path, recording: Path) -> None:
    cut = tmp_path / "cut.mcap"
    cut.write_bytes(recording.read_bytes()[: recording.stat().st_size // 2])
    done = run("play", str(cut), "--no-wait", "--rate", "100")
    assert done.returncode == 3
    assert done.stdout.startswith("published ")
    assert done.stderr.startswith(f"lasso-motion play: {cut}: ")
    assert done.stderr.count("\n") == 1


def test_no_such_recording(tmp_path: Path) -> None:
    done = run("play", str(tmp_path / "none.mcap"))
    assert done.returncode == 2
    assert done.stderr.startswith("lasso-motion play: ")
    assert done.stderr.count("\n") == 1


def run(*arguments: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-m", "lasso_motion_ros.cli.main", *arguments],
        env={**os.environ, **LOOPBACK, "ROS_DOMAIN_ID": "98"},
        capture_output=True,
        encoding="utf-8",
        timeout=120,
        check=False,
    )
