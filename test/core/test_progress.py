"""Progress: on a terminal, never in a file and never with --quiet; and what is iterated stays the same."""

from __future__ import annotations

import io
import re
import sys

import pytest

from lasso_motion_ros.core.progress import Tally, busy, counting, progress, tallying


class Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


CASES = pytest.mark.parametrize(
    ("stream_type", "quiet", "visible"),
    [(Terminal, False, True), (Terminal, True, False), (io.StringIO, False, False)],
    ids=["terminal", "quiet", "file"],
)


@CASES
def test_a_bar_passes_everything_on(monkeypatch, stream_type, quiet, visible):
    stream = stream_type()
    monkeypatch.setattr(sys, "stderr", stream)
    assert list(progress(range(3), 3, "working", quiet)) == [0, 1, 2]
    assert ("working" in stream.getvalue()) == visible


@CASES
def test_a_line_says_what_is_done_and_goes_away(monkeypatch, stream_type, quiet, visible):
    stream = stream_type()
    monkeypatch.setattr(sys, "stderr", stream)
    with busy("reading heart.nii", quiet):
        assert ("reading heart.nii" in stream.getvalue()) == visible
    assert stream.getvalue().endswith(" \r") == visible
    assert "\n" not in stream.getvalue()


@CASES
def test_a_count_grows(monkeypatch, stream_type, quiet, visible):
    stream = stream_type()
    monkeypatch.setattr(sys, "stderr", stream)
    with counting("published", quiet) as show:
        for count in (1, 5, 9):
            show(count)
    assert ("published" in stream.getvalue()) == visible


@CASES
def test_recordings_are_tallied(monkeypatch, stream_type, quiet, visible):
    stream = stream_type()
    monkeypatch.setattr(sys, "stderr", stream)
    with tallying("tracking", 2, quiet) as tally:
        tally(Tally(pairs=30))
        tally(Tally(failed=True))
    assert ("tracking" in stream.getvalue()) == visible


def test_a_log_of_hours_has_a_line_a_minute(monkeypatch):
    stream = io.StringIO()
    monkeypatch.setattr(sys, "stderr", stream)
    monkeypatch.setattr("lasso_motion_ros.core.progress.LOGGED_EVERY_S", 0.0)
    with tallying("tracking", 2, quiet=False) as tally:
        tally(Tally(pairs=30))
    assert re.fullmatch(r"tracking: 1 of 2 recordings, \d+ pairs/s, 0 min left\n", stream.getvalue())
