"""How long a pair's pose takes live, over DDS between processes, beside the bare transport of the same pair."""

from __future__ import annotations

import json
import os
import tempfile
import threading
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from lasso_motion_ros.errors import LassoMotionError
from lasso_motion_ros.nodes.diagnostics import DROPPED_PAIRS
from lasso_motion_ros.nodes.listener import Listener
from lasso_motion_ros.nodes.processes import LOOPBACK, Processes, free_domain, held_signals
from msg_adapters.messages import stamp_to_ns
from msg_adapters.topics import CATHETER, DIAGNOSTICS, MOTION, STATE, Topic

START_WAIT_S = 60.0
ANSWER_WAIT_S = 5.0
TICK_S = 0.05
MEDIAN_BUDGET_MS, TAIL_BUDGET_MS = 15.0, 40.0
"""What tracking may add to the bare transport, at the median and at the 99th percentile."""


@dataclass(frozen=True)
class LiveBenchmark:
    """What was measured.

    Attributes:
        rate: pairs a second that were published.
        side: of the images (mono16), pixels.
        published: pairs published, after the seeded one.
        heard: of these, by the plain subscriber.
        answered: pairs that the tracker answered, with a pose or without.
        poses: pairs with a pose.
        dropped: pairs that the tracker says it left out.
        bare_ms: 50th, 95th, 99th percentile from the publication of the later image to both images received.
        pose_ms: likewise to the pose received.
        first_pose_ms: of the first pair of the stream.
        growth_ms: median of the last quarter of the poses, less that of the first.
        load: the machine's load average (one minute) before and after.
    """

    rate: float
    side: int
    published: int
    heard: int
    answered: int
    poses: int
    dropped: int
    bare_ms: tuple[float, float, float]
    pose_ms: tuple[float, float, float]
    first_pose_ms: float
    growth_ms: float
    load: tuple[float, float]

    @property
    def within_budget(self) -> bool:
        """Whether the pose comes soon enough after the images."""
        return (
            self.pose_ms[0] <= self.bare_ms[0] + MEDIAN_BUDGET_MS
            and self.pose_ms[2] <= self.bare_ms[2] + TAIL_BUDGET_MS
        )


class _Answers:
    """When (steady clock, ns) each pair's pose and its catheter message came, by stamp."""

    def __init__(self) -> None:
        self.poses: dict[int, int] = {}
        self.answered: set[int] = set()
        self.dropped = 0
        self.up = threading.Event()

    def __call__(self, topic: Topic, message: Any, published_ns: int) -> None:
        now = time.monotonic_ns()
        if topic is MOTION:
            self.poses[stamp_to_ns(message.header.stamp)] = now
        elif topic is CATHETER:
            self.answered.add(stamp_to_ns(message.header.stamp))
        elif topic is STATE:
            self.up.set()
        else:
            for status in message.status:
                for entry in status.values:
                    if entry.key == DROPPED_PAIRS:
                        self.dropped = int(entry.value)


def measure_live(rate: float, pairs: int, side: int, configuration: Path) -> LiveBenchmark:
    """Publish a stream to the tracker and to a plain subscriber, each a process of its own.

    Args:
        rate: pairs a second.
        pairs: how many.
        side: of the images, pixels.
        configuration: the tracker's parameter file.

    Raises:
        LassoMotionError: a process failed, or the tracker gave no pose.
        KeyboardInterrupt: interrupted; no process is left behind.
    """
    for name, value in LOOPBACK.items():
        os.environ.setdefault(name, value)
    domain = free_domain()
    answers = _Answers()
    load = os.getloadavg()[0]
    with tempfile.TemporaryDirectory(prefix="lasso_motion_bench_") as directory:
        sent, bare = Path(directory) / "sent.json", Path(directory) / "bare.json"
        with (
            Listener((DIAGNOSTICS, CATHETER, MOTION, STATE), answers, domain=domain),
            held_signals() as interrupted,
            Processes({"ROS_DOMAIN_ID": str(domain)}, Path(directory)) as processes,
        ):

            def wait(what: Callable[[], bool], patience_s: float, otherwise: str | None) -> None:
                deadline = time.monotonic() + patience_s
                while not what():
                    for name, status in processes.ended().items():
                        raise LassoMotionError(f"the {name} ended with status {status}: {processes.log(name, 3)}")
                    if time.monotonic() > deadline:
                        if otherwise is None:
                            return
                        raise LassoMotionError(f"{otherwise}: {processes.log('tracker', 3)}")
                    if interrupted.wait(TICK_S):
                        raise KeyboardInterrupt

            parameters = ["--ros-args", "--params-file", str(configuration)]
            processes.start("tracker", "lasso_motion_ros.nodes.lasso_tracker", parameters)
            processes.start("subscriber", "lasso_motion_ros.nodes.bench_subscriber", [str(bare)])
            wait(answers.up.is_set, START_WAIT_S, "the tracker has not come up")
            words = [str(rate), str(pairs), str(side), "2", str(sent)]
            processes.start("publisher", "lasso_motion_ros.nodes.bench_publisher", words)
            wait(sent.is_file, START_WAIT_S + pairs / rate, "the stream has not ended")
            wait(lambda: len(answers.answered) > pairs, ANSWER_WAIT_S, None)
            processes.stop()
        return summarise(
            rate, side, read_notes(sent), read_notes(bare), answers.poses, answers.answered, answers.dropped,
            (load, os.getloadavg()[0]),
        )  # fmt: skip


def read_notes(path: Path) -> dict[int, int]:
    """A child's notes: steady clock (ns) by stamp."""
    return {int(stamp): int(at) for stamp, at in json.loads(path.read_text(encoding="utf-8")).items()}


def summarise(
    rate: float,
    side: int,
    sent: Mapping[int, int],
    bare: Mapping[int, int],
    poses: Mapping[int, int],
    answered: set[int],
    dropped: int,
    load: tuple[float, float],
) -> LiveBenchmark:
    """The figures; all clocks are the machine's steady one, ns, by the pair's stamp.

    Raises:
        LassoMotionError: nothing was received.
    """
    transport = np.array([bare[stamp] - at for stamp, at in sent.items() if stamp in bare]) / 1e6
    posed = sorted(stamp for stamp in sent if stamp in poses)
    latency = np.array([poses[stamp] - sent[stamp] for stamp in posed]) / 1e6
    if transport.size == 0 or latency.size == 0:
        raise LassoMotionError(f"of {len(sent)} pairs {transport.size} were received and {latency.size} had a pose")
    quarter = max(1, len(latency) // 4)
    return LiveBenchmark(
        rate=rate,
        side=side,
        published=len(sent),
        heard=len(transport),
        answered=len(answered & set(sent)),
        poses=len(posed),
        dropped=dropped,
        bare_ms=_percentiles(transport),
        pose_ms=_percentiles(latency),
        first_pose_ms=float(latency[0]),
        growth_ms=float(np.median(latency[-quarter:]) - np.median(latency[:quarter])),
        load=(round(load[0], 2), round(load[1], 2)),
    )


def _percentiles(values: npt.NDArray[np.float64]) -> tuple[float, float, float]:
    median, high, highest = (float(np.percentile(values, percent)) for percent in (50, 95, 99))
    return median, high, highest


def format_live(figures: LiveBenchmark) -> str:
    """The figures for people."""
    lines = [
        f"{figures.side}×{figures.side} mono16, both planes, {figures.rate:g} pairs/s: {figures.answered} of "
        f"{figures.published} pairs answered, {figures.poses} with a pose, {figures.dropped} left out",
        "publication of the later image to …        p50      p95      p99",
    ]
    for what, (median, high, highest) in (
        ("both images received", figures.bare_ms),
        ("pose received", figures.pose_ms),
    ):
        lines.append(f"  {what:<34}{median:8.1f} {high:8.1f} {highest:8.1f} ms")
    added = [mine - bare for mine, bare in zip(figures.pose_ms, figures.bare_ms, strict=True)]
    kept = "kept" if figures.within_budget else "missed"
    lines += [
        f"  added by tracking                 {added[0]:8.1f} {added[1]:8.1f} {added[2]:8.1f} ms "
        f"(asked: {MEDIAN_BUDGET_MS:g} at p50, {TAIL_BUDGET_MS:g} at p99: {kept})",
        f"first pose {figures.first_pose_ms:.1f} ms; growth over the run {figures.growth_ms:+.1f} ms; "
        f"load average {figures.load[0]} before, {figures.load[1]} after",
    ]
    return "\n".join(lines)
