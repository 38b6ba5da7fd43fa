"""Text for a terminal: what comes from a file or from the network must not steer it."""

from __future__ import annotations

import re
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any, TextIO, cast

# C0 without tab and line feed, DEL, C1, and the marks that turn the direction of writing.
_STEERING = re.compile("[\x00-\x08\x0b-\x1f\x7f-\x9f\u200e\u200f\u202a-\u202e\u2066-\u2069\ud800-\udfff]")


def printable(text: str) -> str:
    r"""Text in which characters that a terminal acts on are written out (`\x1b`); line feed and tab stay."""
    return _STEERING.sub(lambda found: ascii(found[0])[1:-1], text)


class PrintableStream:
    """A text stream that writes only what is printable; all else is the stream's own.

    Args:
        stream: where it goes.

    Attributes:
        stream: the same: for a progress bar, whose own control characters are meant.
    """

    def __init__(self, stream: TextIO) -> None:
        self.stream = stream

    def write(self, text: str) -> int:
        """As a text stream's."""
        self.stream.write(printable(text))
        return len(text)

    def __getattr__(self, name: str) -> Any:
        return getattr(self.stream, name)


@contextmanager
def printable_streams() -> Iterator[None]:
    """Standard output and standard error write only what is printable, while a block runs."""
    before = sys.stdout, sys.stderr
    sys.stdout, sys.stderr = (cast(TextIO, stream and PrintableStream(stream)) for stream in before)
    try:
        yield
    finally:
        if sys.stdout is not None:  # given up by who could not write to it
            sys.stdout = before[0]
        sys.stderr = before[1]


def bar_stream() -> TextIO:
    """Standard error for a progress bar, which moves the cursor."""
    stream = sys.stderr
    return stream.stream if isinstance(stream, PrintableStream) else stream
