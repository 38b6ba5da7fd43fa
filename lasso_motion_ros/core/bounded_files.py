"""Reading a whole file, but no more than makes sense: a device has no size, and may have no end."""

from __future__ import annotations

import errno
from pathlib import Path


def read_bounded(path: str | Path, most_bytes: int) -> bytes:
    """The bytes of a file.

    Args:
        path: the file; a device or a pipe, too.
        most_bytes: that it may have.

    Raises:
        OSError: it cannot be read, or has more bytes.
    """
    with Path(path).open("rb") as file:
        data = file.read(most_bytes + 1)
    if len(data) > most_bytes:
        raise OSError(errno.EFBIG, f"it has more than {most_bytes} bytes", str(path))
    return data
