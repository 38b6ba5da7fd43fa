"""How long each stage of a pair takes, on one thread: from undecoded messages to serialised answers."""

from __future__ import annotations

import importlib
import platform
import time
from collections import defaultdict
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from importlib.metadata import version as installed_version
from typing import get_args

import numpy as np

from lasso_motion_ros.bench.codecs import Codec, available_codec
from lasso_motion_ros.config.stream import StreamConfig
from lasso_motion_ros.config.tracker import TrackerConfig
from lasso_motion_ros.core.compiled import arithmetic
from lasso_motion_ros.core.errors import RecordingError
from lasso_motion_ros.core.progress import progress
from lasso_motion_ros.stream.pair_task import PairTask
from lasso_motion_ros.stream.pipeline import TrackingPipeline
from lasso_motion_ros.stream.session import TrackingSession
from lasso_motion_ros.stream.topic_handlers import topic_handlers
from lasso_motion_ros.stream.tracker_factory import create_tracker
from lasso_motion_ros.tracking.stages import Stage, Stages
from lasso_motion_ros.tracking.tracker import Tracker
from msg_adapters.recordings.reader import RawMessage
from msg_adapters.topics import MOTION_RAW

OUTER_STAGES = ("deserialise", "decode and pair", "tracking", "serialise")
INNER_STAGES = get_args(Stage)  # of tracking
REST = "all else"  # of tracking: so that the parts add up

TrackerFactory = Callable[[TrackerConfig, Stages], Tracker]


@dataclass
class Clock:
    """Time spent by stage; listens to a tracker's stages (see `Stages`).

    Attributes:
        timer: what the stages are timed by, seconds: wall time, or processor time where other programs must not count.
        spent_s: total by stage, seconds; of one of tracking's own stages without those that lie inside it.
        pair_s: wall time of each pair that was tracked, from its first message to its last answer.
        rest_s: wall time of what was done after those answers.
        processor_s: processor time of all threads over the same pairs, what was done after the answers included.
    """

    timer: Callable[[], float] = time.perf_counter
    spent_s: dict[str, float] = field(default_factory=lambda: defaultdict(float))
    pair_s: list[float] = field(default_factory=list)
    rest_s: float = 0.0
    processor_s: float = 0.0
    _lap_s: dict[str, float] = field(default_factory=lambda: defaultdict(float))
    _running: list[str] = field(default_factory=list)

    @contextmanager
    def __call__(self, name: str, /) -> Iterator[None]:
        """Add the time of a block to a stage of this pair, and take it from the stage of tracking that it lies in."""
        about = self._running[-1] if self._running else None
        self._running.append(name)
        begin = self.timer()
        try:
            yield
        finally:
            spent = self.timer() - begin
            self._running.pop()
            self._lap_s[name] += spent
            if about is not None and about in INNER_STAGES:
                self._lap_s[about] -= spent

    def keep(self, wall_s: float, rest_s: float, processor_s: float) -> None:
        """Count what was spent since the last pair as that of a tracked one, and of what followed its answer."""
        self.pair_s.append(wall_s)
        self.rest_s += rest_s
        self.processor_s += processor_s
        for name, spent in self._lap_s.items():
            self.spent_s[name] += spent
        self._lap_s.clear()

    def drop(self) -> None:
        """Forget what was spent since the last pair."""
        self._lap_s.clear()


@dataclass(frozen=True)
class Benchmark:
    """What was measured.

    Attributes:
        pairs: pairs tracked; the pairs on which the model was built are left out.
        pairs_per_s: pairs by wall time, what is done after the answers included.
        pairs_per_processor_s: pairs by processor time: what remains when other programs take none of it.
        median_ms: of a pair, to its last answer.
        p95_ms: 95th percentile of that.
        p99_ms: 99th percentile of that.
        processor_per_wall: processor time by wall time; more than 1.05 would mean more than one thread.
        stages_ms: mean wall time a pair, by stage, in order; the indented ones are tracking's parts, and add up to it.
        messages: who deserialised.
        recording: the recording's name.
        configuration: the configuration's name.
        machine: processor architecture, Python and library versions.
        arithmetic: whether compiled kernels ran.
    """

    pairs: int
    pairs_per_s: float
    pairs_per_processor_s: float
    median_ms: float
    p95_ms: float
    p99_ms: float
    processor_per_wall: float
    stages_ms: dict[str, float]
    messages: str
    recording: str
    configuration: str
    machine: str
    arithmetic: str


def measure(
    config: StreamConfig,
    messages: Sequence[RawMessage],
    pairs: int,
    *,
    quiet: bool = True,
    timer: Callable[[], float] = time.perf_counter,
    make_tracker: TrackerFactory = create_tracker,
) -> tuple[Clock, Codec]:
    """Track a recording, over and over, until so many pairs are tracked.

    Args:
        config: the tracker's parameters.
        messages: undecoded inputs, in order.
        pairs: how many pairs to track.
        quiet: True shows no progress.
        timer: of the stages.
        make_tracker: makes the tracker; by default the one that `config` names.

    Raises:
        RecordingError: not one pair of the recording is tracked.
    """
    codec = available_codec()

    def play(clock: Clock, pairs: int) -> None:
        tracker = make_tracker(config, clock)
        _play(TrackingPipeline(config, tracker), messages, codec, clock, pairs)

    play(Clock(), pairs=3)  # libraries load and caches fill outside of the measurement
    clock = Clock(timer)
    bar = progress(range(pairs), pairs, "tracking", quiet)
    shown = next(bar, None)
    while len(clock.pair_s) < pairs:
        before = len(clock.pair_s)
        play(clock, pairs)
        if len(clock.pair_s) == before:
            raise RecordingError("no pair of the recording was tracked: lasso-motion track says why")
        while shown is not None and shown < len(clock.pair_s) - 1:
            shown = next(bar, None)
    return clock, codec


def _play(pipeline: TrackingPipeline, messages: Sequence[RawMessage], codec: Codec, clock: Clock, pairs: int) -> None:
    """Play the recording once; pairs count from the first pose on, until there are enough."""
    handlers = topic_handlers(pipeline.intake, {raw.topic: raw.type_name for raw in messages})
    tracked = False
    clock.drop()
    wall, processor = time.perf_counter(), time.process_time()
    for raw in messages:
        with clock("deserialise"):
            message = codec.decode(raw.data, raw.type_name)
        with clock("decode and pair"):
            tasks = handlers[raw.topic](message)
        for task in tasks:
            has_pose, answered = _answer(pipeline.session, task, clock)
            now, processor_now = time.perf_counter(), time.process_time()
            if tracked:
                clock.keep(answered - wall, now - answered, processor_now - processor)
                if len(clock.pair_s) >= pairs:
                    return
            tracked = tracked or has_pose
            clock.drop()
            wall, processor = now, processor_now


def _answer(session: TrackingSession, task: PairTask, clock: Clock) -> tuple[bool, float]:
    """Answer a pair; returns whether it has a pose, and when (`time.perf_counter`) its last answer was there."""
    answers, has_pose, answered = session.answers(task), False, time.perf_counter()
    while True:
        with clock("tracking"):
            outputs = next(answers, None)
        if outputs is None:
            return has_pose, answered
        with clock("serialise"):
            for output in outputs:
                output.data  # noqa: B018 - made when it is asked for
        has_pose = has_pose or any(output.topic is MOTION_RAW for output in outputs)
        answered = time.perf_counter()


def summarise(clock: Clock, codec: Codec, recording: str, configuration: str) -> Benchmark:
    """The figures of a measurement."""
    wall = np.array(clock.pair_s)
    whole_s = float(wall.sum()) + clock.rest_s
    return Benchmark(
        pairs=len(wall),
        pairs_per_s=len(wall) / whole_s,
        pairs_per_processor_s=float(len(wall) / clock.processor_s),
        median_ms=float(1e3 * np.median(wall)),
        p95_ms=float(1e3 * np.percentile(wall, 95)),
        p99_ms=float(1e3 * np.percentile(wall, 99)),
        processor_per_wall=clock.processor_s / whole_s,
        stages_ms=stages_ms(clock),
        messages=codec.name,
        recording=recording,
        configuration=configuration,
        machine=f"{platform.machine()}, Python {platform.python_version()}, numpy {np.__version__}, "
        f"scipy {installed_version('scipy')}, OpenCV {importlib.import_module('cv2').__version__}",
        arithmetic=arithmetic(),
    )


def stages_ms(clock: Clock) -> dict[str, float]:
    """Mean time a pair by stage, in the order of the work; the indented ones are tracking's parts, and add up to it."""
    spent_s = dict(clock.spent_s)
    spent_s[REST] = spent_s["tracking"] - sum(spent_s.get(name, 0.0) for name in INNER_STAGES)
    *before, last = OUTER_STAGES
    parts = {name: f"  {name}" for name in (*INNER_STAGES, REST)}
    labels = {name: name for name in before} | parts | {last: last}
    return {label: 1e3 * spent_s[name] / len(clock.pair_s) for name, label in labels.items() if name in spent_s}


def format_benchmark(benchmark: Benchmark) -> str:
    """The figures as text."""
    lines = [
        f"{benchmark.configuration} on {benchmark.recording}: {benchmark.pairs_per_s:.1f} pairs/s on one thread "
        f"({benchmark.pairs} pairs, answered after {benchmark.median_ms:.1f} ms, "
        f"95 % within {benchmark.p95_ms:.1f} ms, 99 % within {benchmark.p99_ms:.1f} ms)",
        f"processor time / wall time {benchmark.processor_per_wall:.2f}; "
        f"{benchmark.pairs_per_processor_s:.1f} pairs a second of processor time",
        f"messages by {benchmark.messages}; {benchmark.machine}",
        f"arithmetic: {benchmark.arithmetic}",
    ]
    lines += [f"  {name:<18}{spent:9.2f} ms" for name, spent in benchmark.stages_ms.items()]
    return "\n".join(lines)
