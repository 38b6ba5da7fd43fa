"""`lasso-motion bench --archive`: how fast processes beside each other track an archive, and the memory of each."""

from __future__ import annotations

import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from lasso_motion_ros.config.stream import StreamConfig
from lasso_motion_ros.core.errors import RecordingError
from lasso_motion_ros.core.worker_pool import LocalPool
from lasso_motion_ros.tools.archive import run_archive
from lasso_motion_ros.tools.archive_tracking import TrackingWork

RECORDINGS_A_WORKER = 48
"""So that starting a worker, which takes as long as seven recordings of 30 pairs, is a small part."""


@dataclass(frozen=True)
class ArchiveRate:
    """One run over copies of a recording.

    Attributes:
        workers: processes at a time.
        recordings: how many copies.
        pairs: in all of them.
        seconds: wall time of all, starting the workers included.
        pair_ms: processor time a pair, milliseconds, reading and the model from the clicks included.
        least_mb: largest memory that a process had needed after a recording, megabytes: the least of all recordings.
        most_mb: the most of all; memory that does not grow is near it from the first recording on.
    """

    workers: int
    recordings: int
    pairs: int
    seconds: float
    pair_ms: float
    least_mb: float
    most_mb: float

    @property
    def rate_hz(self) -> float:
        """Pairs a second."""
        return self.pairs / self.seconds


def measure_archive(
    recording: Path, config: StreamConfig, workers: Sequence[int], recordings: int | None = None, *, quiet: bool = True
) -> list[ArchiveRate]:
    """Track an archive of one recording over and over, by each number of processes.

    Args:
        recording: MCAP file.
        config: the tracker's parameters.
        workers: numbers of processes.
        recordings: how many copies; None: `RECORDINGS_A_WORKER` for each of the most workers.
        quiet: no progress.

    Raises:
        RecordingError: it cannot be tracked.
    """
    count = recordings or RECORDINGS_A_WORKER * max(workers)
    rates = []
    for number in workers:
        with tempfile.TemporaryDirectory(prefix="lasso_motion_") as folder:
            work = TrackingWork(recording.absolute(), config)
            named = [(work, str(recording), f"{copy:04d}.mcap") for copy in range(count)]
            failures: list[str] = []
            pool = LocalPool(number)
            summary = run_archive(named, Path(folder), pool, failures.append, label=f"{number} workers", quiet=quiet)
        if summary.failed:
            raise RecordingError(failures[0])
        memory = sorted(row.peak_memory_mb for row in summary.rows)
        processor_s = sum(row.processor_s for row in summary.rows)
        rates.append(
            ArchiveRate(
                number, count, summary.pairs, summary.seconds, 1e3 * processor_s / summary.pairs,
                memory[0], memory[-1],
            )
        )  # fmt: skip
    return rates


def format_archive(rates: Sequence[ArchiveRate]) -> str:
    """The rates as text."""
    lines = [f"{'workers':>7}{'pairs/s':>10}{'times one':>11}{'processor a pair':>18}{'memory, from / to':>24}"]
    for one in rates:
        times = one.rate_hz / rates[0].rate_hz * rates[0].workers
        lines.append(
            f"{one.workers:>7}{one.rate_hz:>10.1f}{times:>11.2f}{one.pair_ms:>15.1f} ms"
            f"{one.least_mb:>13.0f} / {one.most_mb:.0f} MB"
        )
    return "\n".join(lines)
