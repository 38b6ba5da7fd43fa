"""`lasso-motion bench --archive`: the rate and the memory of processes that really track."""

from __future__ import annotations

from pathlib import Path

import pytest

pytest.importorskip("mcap")

from support.drawn_recording import write_input

from lasso_motion_ros.bench.archive_rate import format_archive, measure_archive
from lasso_motion_ros.config.stream import StreamConfig
from lasso_motion_ros.core.errors import RecordingError


@pytest.mark.slow
def test_copies_of_a_recording_are_tracked_and_timed(tmp_path: Path) -> None:
    recording = write_input(tmp_path / "ring.mcap", [0.0, 1.0], truth=False)
    (rate,) = measure_archive(recording, StreamConfig(), [1], 2)
    assert (rate.workers, rate.recordings, rate.pairs) == (1, 2, 4)
    assert rate.pair_ms > 0.0
    assert 50.0 < rate.least_mb <= rate.most_mb < 1000.0
    line = format_archive([rate]).splitlines()[1]
    assert line.split()[:3] == ["1", f"{rate.rate_hz:.1f}", "1.00"]
    recording.write_bytes(b"no recording")
    with pytest.raises(RecordingError, match="is not an MCAP recording"):
        measure_archive(recording, StreamConfig(), [1], 1)
