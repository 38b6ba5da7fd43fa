"""Progress: on a terminal, never in a file and never with --quiet; and what is iterated stays the same."""

from __future__ import annotations

import io
import sys

import pytest

from lasso_motion_ros.core.progress import busy, counting, progress


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
