"""Endurance test: thousands of pairs through a live tracker, while its memory, threads and open files are watched.

`python -m lasso_motion_ros.bench.soak [PAIRS]`, or `make soak`.
"""

from __future__ import annotations

import os
import sys
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from lasso_motion_ros.bench.publisher import PublishedStream
from lasso_motion_ros.core.errors import LassoMotionError
from lasso_motion_ros.core.share import share_file
from lasso_motion_ros.tools.child_graph import START_WAIT_S, child_graph
from lasso_motion_ros.tools.listener import Listener
from lasso_motion_ros.tools.processes import free_domain, stay_on_this_machine
from msg_adapters.topics import CATHETER, MOTION, STATE, Topic


@dataclass(frozen=True)
class SoakSetting:
    """What is run, and the limits it must keep.

    Attributes:
        pairs: published.
        warm_pairs: until so many are answered, buffers and caches may fill.
        rate: pairs a second.
        side: of the images, pixels.
        largest_growth_mb: of the tracker's memory, from then on.
        silence_s: without an answer it has failed.
        most_ahead: pairs on their way to the tracker: one, so that where the machine is slow none waits behind another,
            and none is left out for a newer one.
    """

    pairs: int = 20_000
    warm_pairs: int = 1000
    rate: float = 40.0
    side: int = 256
    largest_growth_mb: float = 5.0
    silence_s: float = 20.0
    most_ahead: int = 1


SETTING = SoakSetting()


@dataclass(frozen=True)
class Resources:
    """A process's resources.

    Attributes:
        memory_mb: private memory (RssAnon), megabytes.
        threads: how many.
        files: open handles.
    """

    memory_mb: float
    threads: int
    files: int


@dataclass(frozen=True)
class SoakFigures:
    """The outcome.

    Attributes:
        answered: pairs answered.
        poses: of these, with a pose.
        warm: the tracker's after the warm-up.
        end: the tracker's at the end, still running.
    """

    answered: int
    poses: int
    warm: Resources
    end: Resources

    @property
    def growth_mb(self) -> float:
        """Memory growth since the warm-up, MB."""
        return self.end.memory_mb - self.warm.memory_mb

    @property
    def leaks(self) -> list[str]:
        """What grew though it must not, in words."""
        found = []
        if self.growth_mb > SETTING.largest_growth_mb:
            found.append(f"memory grew by {self.growth_mb:.1f} MB")
        for what in ("threads", "files"):
            before, after = getattr(self.warm, what), getattr(self.end, what)
            if after > before:
                found.append(f"{what} grew from {before} to {after}")
        return found


def resources(process_id: int) -> Resources:
    """A process's resources now (Linux)."""
    status = Path(f"/proc/{process_id}/status").read_text(encoding="utf-8")
    fields = dict(line.split(":", 1) for line in status.splitlines() if ":" in line)
    return Resources(
        memory_mb=int(fields["RssAnon"].split()[0]) / 1024.0,
        threads=int(fields["Threads"]),
        files=len(os.listdir(f"/proc/{process_id}/fd")),  # noqa: PTH208 - only the count
    )


class _Answers:
    def __init__(self) -> None:
        self.answered = self.poses = 0
        self.up = False

    def __call__(self, topic: Topic, message: Any, published_ns: int) -> None:
        # Behind four bytes of its encoding a marker begins with its stamp, which is zero where the stream has stopped:
        # such a one answers no pair.
        self.answered += topic is CATHETER and any(message[4:12])
        self.poses += topic is MOTION
        self.up = self.up or topic is STATE


def soak(setting: SoakSetting = SETTING) -> SoakFigures:
    """Run so many pairs through the tracker.

    Raises:
        LassoMotionError: a process failed, or the answers ceased.
        KeyboardInterrupt: interrupted.
    """
    stay_on_this_machine()
    domain = free_domain()
    answers = _Answers()
    warm: Resources | None = None
    with tempfile.TemporaryDirectory(prefix="lasso_motion_soak_") as directory:
        sent = Path(directory) / "sent.json"
        with (
            Listener((CATHETER, MOTION, STATE), answers, domain=domain, raw=True),
            child_graph(domain, Path(directory)) as graph,
        ):
            tracker = graph.start_tracker(share_file("config/tracker.yaml"))
            # The stream begins when the tracker has learnt of all that listen: what it says before would not be heard.
            graph.wait_until(lambda: answers.up, START_WAIT_S, lambda: f"no tracker came up: {graph.log('tracker', 1)}")
            stream = PublishedStream(setting.rate, setting.pairs, setting.side, 1, 1, sent, setting.most_ahead)
            graph.start("publisher", "lasso_motion_ros.bench.publisher", stream.words)
            last, changed_s = 0, time.monotonic() + START_WAIT_S

            def has_ended() -> bool:
                nonlocal last, changed_s, warm
                if sent.is_file() and answers.answered == last and time.monotonic() > changed_s + 1.0:
                    return True
                if answers.answered != last:
                    last, changed_s = answers.answered, time.monotonic()
                elif time.monotonic() > changed_s + setting.silence_s:
                    raise LassoMotionError(f"no answer any more after {last} pairs: {graph.log('tracker', 1)}")
                if warm is None and answers.answered >= setting.warm_pairs:
                    warm = resources(tracker.pid)
                return False

            graph.wait_until(has_ended)
            end = resources(tracker.pid)
            graph.stop()
    if warm is None:
        raise LassoMotionError(f"only {answers.answered} of {setting.pairs} pairs were answered")
    return SoakFigures(answers.answered, answers.poses, warm, end)


def main() -> int:
    """Run it and print the outcome; returns the exit status."""
    setting = SoakSetting(pairs=int(sys.argv[1])) if len(sys.argv) > 1 else SETTING
    try:
        figures = soak(setting)
    except LassoMotionError as error:
        sys.stderr.write(f"soak: {error}\n")
        return 2
    warm, end = figures.warm, figures.end
    sys.stdout.write(
        f"{figures.answered} of {setting.pairs + 1} pairs answered, {figures.poses} with a pose; "
        f"after the first {setting.warm_pairs}: "
        f"memory {figures.growth_mb:+.1f} MB (at most {setting.largest_growth_mb:g}), "
        f"threads {warm.threads} to {end.threads}, files {warm.files} to {end.files}\n"
    )
    for leak in figures.leaks:
        sys.stderr.write(f"soak: {leak}\n")
    return 1 if figures.leaks else 0


if __name__ == "__main__":
    sys.exit(main())
