"""Repairs a recording that was cut short: gives it index, summary and footer, so that every reader accepts it."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

from lasso_motion_ros.core.errors import RecordingError
from msg_adapters.messages import NANOSECONDS
from msg_adapters.recordings.copy import RecordingCopier
from msg_adapters.recordings.mcap_layout import walk_file
from msg_adapters.recordings.reader import RecordingReader
from msg_adapters.recordings.writer import RecordingWriter


@dataclass(frozen=True)
class Repaired:
    """What became of a recording.

    Attributes:
        damage: what was wrong with it; None where it was whole and was left as it is.
        counts: messages in it now, by topic.
        seconds: from the first message to the last.
    """

    damage: str | None
    counts: dict[str, int] = field(default_factory=dict)
    seconds: float = 0.0


def repair_recording(path: Path) -> Repaired:
    """Rewrite a damaged MCAP file in place; it is replaced only once all that is readable has been written anew.

    Args:
        path: the file.

    Raises:
        RecordingError: it is no MCAP file, nothing in it is readable, or there is no room for the new one.
    """
    if path.is_dir():
        raise RecordingError(f"{path} is a directory; name the .mcap file in it that is damaged")
    layout = walk_file(path)
    reader = RecordingReader(path)
    if layout.damage is None:
        for _ in reader.raw_messages():
            pass  # only reading shows whether a chunk is corrupt
        if reader.damage is None:
            return Repaired(None)
    compression = "zstd" if any(segment.compression for segment in layout.segments) else "none"
    times: list[int] = []
    with RecordingWriter(path, compression, overwrite=True, whole=True) as writer:
        copier = RecordingCopier(reader, writer)
        for message in reader.raw_messages():
            copier.copy(message)
            times = [*times[:1], message.log_time_ns]
        if not times:
            raise RecordingError(f"{path}: no message in it can be read; it was left as it is")
    return Repaired(reader.damage, writer.counts, (times[-1] - times[0]) / NANOSECONDS)
