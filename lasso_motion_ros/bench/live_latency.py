"""Latency from images to pose over DDS between processes, beside that of the bare transport."""

from __future__ import annotations

import contextlib
import json
import os
import tempfile
import threading
import time
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from lasso_motion_ros.bench.overlay_times import GRID_STEP_MM
from lasso_motion_ros.bench.publisher import PublishedStream, late_ns
from lasso_motion_ros.core.errors import LassoMotionError
from lasso_motion_ros.geometry.frames import PLANES, Plane
from lasso_motion_ros.nodes.diagnostics import DROPPED_PAIRS
from lasso_motion_ros.overlay.atrium import left_atrium_surface
from lasso_motion_ros.overlay.surface_files import write_stl
from lasso_motion_ros.tools.child_graph import START_WAIT_S, TooLateError, child_graph
from lasso_motion_ros.tools.listener import Listener
from lasso_motion_ros.tools.processes import free_domain, stay_on_this_machine
from msg_adapters.messages import stamp_to_ns
from msg_adapters.topics import CATHETER, DIAGNOSTICS, MOTION, STATE, Topic

ANSWER_WAIT_S = 5.0

Notes = Mapping[Plane, Mapping[int, int]]
"""What a subscriber noted: monotonic time (ns) by plane and stamp."""


@dataclass(frozen=True)
class LatencyBudget:
    """Latency limits, ms.

    Attributes:
        median_ms: what tracking may add to the bare transport, at the median.
        tail_ms: the same at the 99th percentile.
        picture_ms: how old an overlay picture may be, at the 99th percentile.
    """

    median_ms: float = 15.0
    tail_ms: float = 40.0
    picture_ms: float = 150.0


BUDGET = LatencyBudget()


@dataclass(frozen=True)
class LiveBenchmark:
    """What was measured.

    Attributes:
        rate: pairs a second that were published.
        side: of the images (mono16), pixels.
        late_ms: how much later plane B is exposed than plane A.
        published: pairs published, after the seeded one.
        heard: of these, by the plain subscriber.
        answered: pairs that the tracker answered, with a pose or without.
        poses: pairs with a pose.
        dropped: pairs that the tracker says it left out.
        bare_ms: 50th, 95th, 99th percentile from the publication of the later image to both images received.
        pose_ms: likewise to the pose received.
        first_pose_ms: of the first pair of the stream.
        growth_ms: median of the last quarter of the poses, less that of the first.
        pictures: overlay pictures received, both planes together, of twice as many images; None without the overlay.
        picture_ms: 50th, 95th, 99th percentile from the publication of the later image to an overlay picture received.
        load: the machine's load average (one minute) before and after.
    """

    rate: float
    side: int
    late_ms: float
    published: int
    heard: int
    answered: int
    poses: int
    dropped: int
    bare_ms: tuple[float, float, float]
    pose_ms: tuple[float, float, float]
    first_pose_ms: float
    growth_ms: float
    pictures: int | None
    picture_ms: tuple[float, float, float] | None
    load: tuple[float, float]

    @property
    def within_budget(self) -> bool:
        """Whether the pose comes soon enough after the images."""
        return (
            self.pose_ms[0] <= self.bare_ms[0] + BUDGET.median_ms
            and self.pose_ms[2] <= self.bare_ms[2] + BUDGET.tail_ms
        )


class _Answers:
    """When (monotonic, ns) each pair's pose and catheter message arrived, by stamp."""

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
            self.answered.discard(0)  # of no pair: the stream has stopped
        elif topic is STATE:
            self.up.set()
        else:
            for status in message.status:
                for entry in status.values:
                    if entry.key == DROPPED_PAIRS:
                        self.dropped = int(entry.value)


def measure_live(
    rate: float, pairs: int, side: int, configuration: Path, *, overlay: bool = False, late_ms: float = 0.0
) -> LiveBenchmark:
    """Publish a stream to the tracker and to a plain subscriber, each a process of its own.

    With the overlay its node draws 20,000 triangles over both planes, and one more process receives the pictures.

    Args:
        rate: pairs a second.
        pairs: how many.
        side: of the images, pixels.
        configuration: the tracker's parameter file.
        overlay: have the overlay node work beside the tracker.
        late_ms: how much later plane B is exposed than plane A.

    Raises:
        LassoMotionError: a process failed, or the tracker gave no pose.
        KeyboardInterrupt: interrupted; no process is left behind.
    """
    stay_on_this_machine()
    domain = free_domain()
    answers = _Answers()
    load = os.getloadavg()[0]
    with tempfile.TemporaryDirectory(prefix="lasso_motion_bench_") as directory:
        sent, bare, pictures, surface = (
            Path(directory) / name for name in ("sent.json", "bare.json", "pictures.json", "surface.stl")
        )
        with (
            Listener((DIAGNOSTICS, CATHETER, MOTION, STATE), answers, domain=domain),
            child_graph(domain, Path(directory)) as graph,
        ):
            graph.start_tracker(configuration)
            graph.start("subscriber", "lasso_motion_ros.bench.subscriber", ["images", str(bare)])
            if overlay:
                write_stl(surface, left_atrium_surface(GRID_STEP_MM), "mm")
                graph.start_overlay(surface)
                graph.start("viewer", "lasso_motion_ros.bench.subscriber", ["overlays", str(pictures)])
            graph.wait_until(answers.up.is_set, START_WAIT_S, lambda: f"no tracker came up: {graph.log('tracker', 1)}")
            # The tracker and the overlay take both; the plain subscriber takes the images only.
            nodes = 2 if overlay else 1
            stream = PublishedStream(rate, pairs, side, nodes + 1, nodes, sent, late_ms=late_ms)
            graph.start("publisher", "lasso_motion_ros.bench.publisher", stream.words)
            graph.wait_until(
                sent.is_file,
                START_WAIT_S + pairs / rate,
                lambda: f"the stream has not ended: {graph.log('tracker', 1)}",
            )
            with contextlib.suppress(TooLateError):  # the figures show what is not answered by then
                graph.wait_until(lambda: len(answers.answered) > pairs, ANSWER_WAIT_S)
            graph.stop()
        return summarise(
            rate, side, read_times(json.loads(sent.read_text(encoding="utf-8"))), read_notes(bare, late_ms),
            answers.poses, answers.answered, answers.dropped, (load, os.getloadavg()[0]),
            read_notes(pictures, late_ms) if overlay else None, late_ms,
        )  # fmt: skip


def read_times(times: Mapping[str, int]) -> dict[int, int]:
    """Monotonic times (ns) by stamp, from a child's JSON."""
    return {int(stamp): int(at) for stamp, at in times.items()}


def read_notes(path: Path, late_ms: float = 0.0) -> Notes:
    """A subscriber's notes, by the pair's stamp: plane A's, of which plane B's is later by so much."""
    noted = json.loads(path.read_text(encoding="utf-8"))
    later: dict[Plane, int] = {"a": 0, "b": late_ns(late_ms)}
    return {plane: {stamp - later[plane]: at for stamp, at in read_times(noted[plane]).items()} for plane in PLANES}


def summarise(
    rate: float,
    side: int,
    sent: Mapping[int, int],
    bare: Notes,
    poses: Mapping[int, int],
    answered: set[int],
    dropped: int,
    load: tuple[float, float],
    pictures: Notes | None = None,
    late_ms: float = 0.0,
) -> LiveBenchmark:
    """The figures, from monotonic times in ns by the pair's stamp.

    Raises:
        LassoMotionError: nothing was received.
    """
    both = bare["a"].keys() & bare["b"].keys()
    transport = (
        np.array([max(bare[p][stamp] for p in PLANES) - at for stamp, at in sent.items() if stamp in both]) / 1e6
    )
    posed = sorted(stamp for stamp in sent if stamp in poses)
    latency = np.array([poses[stamp] - sent[stamp] for stamp in posed]) / 1e6
    if transport.size == 0 or latency.size == 0:
        raise LassoMotionError(f"of {len(sent)} pairs {transport.size} were received and {latency.size} had a pose")
    quarter = max(1, len(latency) // 4)
    ages = None
    if pictures is not None:
        ages = np.array([at - sent[stamp] for p in PLANES for stamp, at in pictures[p].items() if stamp in sent]) / 1e6
        if ages.size == 0:
            raise LassoMotionError(f"of {len(sent)} pairs not one overlay picture was received")
    return LiveBenchmark(
        rate=rate,
        side=side,
        late_ms=late_ms,
        published=len(sent),
        heard=len(transport),
        answered=len(answered & set(sent)),
        poses=len(posed),
        dropped=dropped,
        bare_ms=_percentiles(transport),
        pose_ms=_percentiles(latency),
        first_pose_ms=float(latency[0]),
        growth_ms=float(np.median(latency[-quarter:]) - np.median(latency[:quarter])),
        pictures=None if ages is None else len(ages),
        picture_ms=None if ages is None else _percentiles(ages),
        load=(round(load[0], 2), round(load[1], 2)),
    )


def _percentiles(values: npt.NDArray[np.float64]) -> tuple[float, float, float]:
    median, high, highest = (float(np.percentile(values, percent)) for percent in (50, 95, 99))
    return median, high, highest


def format_live(figures: LiveBenchmark) -> str:
    """The figures as text."""
    beside = f", plane B {figures.late_ms:g} ms later" if figures.late_ms else ""
    beside += "" if figures.pictures is None else ", overlay beside it"
    lines = [
        f"{figures.side}×{figures.side} mono16, both planes, {figures.rate:g} pairs/s{beside}: {figures.answered} of "
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
        f"(asked: {BUDGET.median_ms:g} at p50, {BUDGET.tail_ms:g} at p99: {kept})",
        f"first pose {figures.first_pose_ms:.1f} ms; growth over the run {figures.growth_ms:+.1f} ms; "
        f"load average {figures.load[0]} before, {figures.load[1]} after",
    ]
    if figures.picture_ms is not None:
        median, high, highest = figures.picture_ms
        kept = "kept" if highest <= BUDGET.picture_ms else "missed"
        lines.insert(
            -1,
            f"  overlay picture received          {median:8.1f} {high:8.1f} {highest:8.1f} ms "
            f"(asked: {BUDGET.picture_ms:g}: {kept}); {figures.pictures} of {2 * figures.published} pictures",
        )
    return "\n".join(lines)


def format_disturbance(alone: LiveBenchmark, beside: LiveBenchmark) -> str:
    """How much the overlay slows the tracker, as text: tracking and transport apart."""
    added = [[pose - bare for pose, bare in zip(run.pose_ms, run.bare_ms, strict=True)] for run in (alone, beside)]
    return (
        f"the overlay adds to the pose {beside.pose_ms[0] - alone.pose_ms[0]:+.1f} ms at p50, "
        f"{beside.pose_ms[2] - alone.pose_ms[2]:+.1f} at p99; of that to tracking {added[1][0] - added[0][0]:+.1f} and "
        f"{added[1][2] - added[0][2]:+.1f}, the rest to the transport of all"
    )
