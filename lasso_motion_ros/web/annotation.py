"""Drawing the loop's centrelines into a copy of a recording, pair by pair, with the page's own clicking."""

from __future__ import annotations

import signal
import threading
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from lasso_motion_ros.core.errors import MessageError, RecordingError
from lasso_motion_ros.geometry.frames import PLANES, Plane
from lasso_motion_ros.web import protocol
from lasso_motion_ros.web.server import WebServer
from lasso_motion_ros.web.source import PageView, Picture, PlanePicture, TracePoint
from msg_adapters.images import Pixels, decode_compressed_image, decode_image
from msg_adapters.messages import header_fields, stamp_to_ns
from msg_adapters.recordings.copy import RecordingCopier
from msg_adapters.recordings.reader import RawMessage, RecordingReader
from msg_adapters.recordings.tracking_topics import check_tracking_topics
from msg_adapters.recordings.writer import RecordingWriter, check_free
from msg_adapters.seeds import decode_polygon, encode_polygon
from msg_adapters.sync.pairing import PairSynchroniser
from msg_adapters.sync.partner import PartnerRule
from msg_adapters.topics import compressed_image_topic, image_topic, true_centreline_topic

Array = npt.NDArray[np.float64]

FEWEST_POINTS = 3
_EMPTY = np.zeros((0, 2))


@dataclass(eq=False)
class _Drawing:
    """One pair and what is drawn in it: clicks and the curve through them, (N, 2) pixels a plane."""

    stamp_ns: int
    images: dict[Plane, int]
    points: dict[Plane, Array] = field(default_factory=dict)
    curves: dict[Plane, Array] = field(default_factory=dict)
    closed: bool = False
    edited: set[Plane] = field(default_factory=set)


class Annotation:
    """A recording's pairs with their centrelines; what the server shows (see `Source`).

    A centreline has its pair's stamp, plane A's, as the truth of a simulated recording has. What the recording
    already has is shown, and replaced where it is drawn anew.

    Args:
        recording: the recording; it is not changed.
        output: the copy.
        remap: recorded topic → the name it is read (and written) as.
        overwrite: replace `output` if it exists.

    Raises:
        RecordingError: it cannot be read, has no images, or the copy may not be written.
    """

    def __init__(
        self, recording: Path, output: Path, remap: Mapping[str, str] | None = None, overwrite: bool = False
    ) -> None:
        self._reader = RecordingReader(recording, remap)
        check_tracking_topics(recording, self._reader.topics, calibrated=True)
        if output.exists() and any(output.samefile(file) for file in self._reader.files):
            raise RecordingError(f"{output} is the recording itself; the copy needs a name of its own")
        check_free(output, overwrite)
        self._output = output
        self._lock = threading.RLock()
        self._changed: Callable[[], None] = lambda: None
        self._drawings = self._read_pairs()
        self._load_centrelines()
        self._index, self._number, self._version = 0, 1, 0
        self.unsaved = False
        self._images = dict(self._read_images(self._drawings[0]))

    @property
    def damage(self) -> str | None:
        """What is wrong with the recording as a file."""
        return self._reader.damage

    # What the server asks.

    def status(self) -> dict[str, Any]:
        """See `Source.status`."""
        with self._lock:
            drawing = self._drawings[self._index]
            return {
                "mode": "annotate",
                "name": f"{self._reader.path.name} → {self._output.name}",
                "index": self._index,
                "frames": len(self._drawings),
                "done": sum(all(len(one.curves.get(p, _EMPTY)) for p in one.images) for one in self._drawings),
                "unsaved": self.unsaved,
                "version": self._version,
                "closed": drawing.closed,
                "clicks": FEWEST_POINTS,
                "points": {plane: drawing.points.get(plane, _EMPTY).tolist() for plane in PLANES},
                "curves": {
                    plane: np.round(curve, 2).tolist() if len(curve := drawing.curves.get(plane, _EMPTY)) else None
                    for plane in PLANES
                },
            }

    def picture(self, view: PageView) -> Picture | None:
        """See `Source.picture`."""
        with self._lock:
            drawing = self._drawings[self._index]
            planes = {
                plane: PlanePicture(drawing.images[plane], pixels, None) for plane, pixels in self._images.items()
            }
            return Picture(self._number, True, planes)

    def trace(self, after: int) -> list[TracePoint]:
        """See `Source.trace`."""
        return []

    def watch(self, on_change: Callable[[], None]) -> None:
        """See `Source.watch`."""
        self._changed = on_change

    def audience(self, views: frozenset[PageView]) -> None:
        """See `Source.audience`."""

    def command(self, name: str, body: Mapping[str, Any]) -> str:
        """See `Source.command`."""
        with self._lock:
            if name == "go":
                return self._go(self._checked_index(body), copy=body.get("copy") is True)
            if name == "draw":
                return self._draw(body)
            if name == "save":
                return self.save()
        raise RecordingError(f"{name} belongs to the live page")

    def save(self) -> str:
        """Write the copy: everything that the recording has, and the centrelines; whole or not at all.

        Raises:
            RecordingError: it cannot be written.
        """
        with self._lock:
            with RecordingWriter(self._output, overwrite=True, whole=True) as writer:
                self._write_copy(writer)
            self.unsaved = False
            done = sum(bool(curve.size) for one in self._drawings for curve in one.curves.values())
            return f"Saved {done} centrelines in {self._output}."

    def _go(self, index: int, copy: bool) -> str:
        if copy and index > 0:
            # Where the loop was a frame ago is a good start: the clicks are moved, not set anew.
            before, drawing = self._drawings[index - 1], self._drawings[index]
            for plane in drawing.images:
                if plane in before.points:
                    drawing.points[plane], drawing.curves[plane] = before.points[plane], before.curves[plane]
                    drawing.edited.add(plane)
            drawing.closed = before.closed
            self.unsaved = True
        if index != self._index:
            self._images = dict(self._read_images(self._drawings[index]))
            self._index = index
            self._number += 1
        self._version += 1
        return ""

    def _draw(self, body: Mapping[str, Any]) -> str:
        drawing = self._drawings[self._checked_index(body)]
        for plane in drawing.images:
            points = protocol.points(body, plane)
            curve = protocol.points(body, plane, key=f"curve_{plane}")
            if not len(points) and not len(drawing.points.get(plane, _EMPTY)):
                continue  # nothing was clicked here: what the recording has stays
            drawing.points[plane], drawing.curves[plane] = points, curve
            drawing.edited.add(plane)
            self.unsaved = True
        drawing.closed = body.get("closed") is True
        return ""

    def _checked_index(self, body: Mapping[str, Any]) -> int:
        index = body.get("index")
        if type(index) is not int or not 0 <= index < len(self._drawings):
            raise MessageError(f"index: expected 0 to {len(self._drawings) - 1}, found {index!r}")
        return index

    # The recording.

    def _image_topics(self) -> dict[str, Plane]:
        """Topic of the images → plane."""
        topics: dict[str, Plane] = {}
        for plane in PLANES:
            raw, compressed = image_topic(plane), compressed_image_topic(plane)
            is_raw = self._reader.topics.get(raw.recorded_name) == raw.type_name
            topics[(raw if is_raw else compressed).recorded_name] = plane
        return topics

    def _read_pairs(self) -> list[_Drawing]:
        planes = self._image_topics()
        pairing: PairSynchroniser[int] = PairSynchroniser(PartnerRule())
        pairs = []
        for recorded in self._reader.messages(list(planes)):
            stamp_ns = stamp_to_ns(recorded.message.header.stamp)
            pairs += pairing.add(planes[recorded.topic], stamp_ns, stamp_ns)
        pairs += pairing.flush()
        if not pairs:
            raise RecordingError(f"{self._reader.path} has no images")
        return [_Drawing(pair.stamp_ns, pair.frames) for pair in pairs]

    def _load_centrelines(self) -> None:
        topics = {true_centreline_topic(plane).recorded_name: plane for plane in PLANES}
        by_stamp = {drawing.stamp_ns: drawing for drawing in self._drawings}
        for recorded in self._reader.messages(list(topics)):
            drawing = by_stamp.get(stamp_to_ns(recorded.message.header.stamp))
            if drawing is not None:
                drawing.curves[topics[recorded.topic]] = decode_polygon(recorded.message)

    def _read_images(self, drawing: _Drawing) -> Iterator[tuple[Plane, Pixels]]:
        planes = self._image_topics()
        wanted = dict(drawing.images)
        for recorded in self._reader.messages(list(planes)):
            plane, message = planes[recorded.topic], recorded.message
            if wanted.get(plane) != stamp_to_ns(message.header.stamp):
                continue
            del wanted[plane]
            yield plane, decode_image(message) if hasattr(message, "encoding") else decode_compressed_image(message)
            if not wanted:
                return

    def _write_copy(self, writer: RecordingWriter) -> None:
        topics = {true_centreline_topic(plane).recorded_name: plane for plane in PLANES}
        edited = {(one.stamp_ns, plane) for one in self._drawings for plane in one.edited}
        drawn = iter(
            sorted(
                (
                    (one.stamp_ns, plane, one.curves[plane])
                    for one in self._drawings
                    for plane in sorted(one.edited)
                    if len(one.curves[plane]) >= FEWEST_POINTS
                ),
                key=lambda entry: entry[0],
            )
        )
        waiting = next(drawn, None)
        copier = RecordingCopier(self._reader, writer)
        for message, replaced in self._kept(topics, edited):
            # In order of time, as a recorder would have written them.
            while waiting is not None and waiting[0] < message.log_time_ns:
                self._write_centreline(writer, *waiting)
                waiting = next(drawn, None)
            if not replaced:
                copier.copy(message)
        while waiting is not None:
            self._write_centreline(writer, *waiting)
            waiting = next(drawn, None)

    def _kept(self, topics: Mapping[str, Plane], edited: set[tuple[int, Plane]]) -> Iterable[tuple[RawMessage, bool]]:
        """Each message, and whether it is a centreline that has been drawn anew."""
        old = {
            (recorded.log_time_ns, recorded.topic): (stamp_to_ns(recorded.message.header.stamp), topics[recorded.topic])
            for recorded in self._reader.messages(list(topics))
        }
        for message in self._reader.raw_messages():
            yield message, old.get((message.log_time_ns, message.topic)) in edited

    @staticmethod
    def _write_centreline(writer: RecordingWriter, stamp_ns: int, plane: Plane, curve: Array) -> None:
        topic = true_centreline_topic(plane)
        writer.write(topic.recorded_name, topic.type_name, encode_polygon(curve, header_fields(stamp_ns)), stamp_ns)


def annotate(
    recording: Path,
    output: Path,
    *,
    host: str,
    port: int,
    names: tuple[str, ...] = (),
    remap: Mapping[str, str] | None = None,
    overwrite: bool = False,
    quiet: bool = False,
) -> str | None:
    """Serve the page that draws centrelines until SIGINT or SIGTERM; what is not saved then is saved.

    Args:
        recording: the recording.
        output: the copy to write.
        host: address to listen on.
        port: TCP port; 0: any.
        names: further host names by which browsers may ask.
        remap: recorded topic → the name it is read as.
        overwrite: replace `output` if it exists.
        quiet: errors only.

    Returns:
        What is wrong with the recording as a file, where it could be read in part only.

    Raises:
        LassoMotionError: nothing readable, or the port or the copy cannot be had.
    """
    stopped = threading.Event()
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda *_: stopped.set())
    source = Annotation(recording, output, remap, overwrite)
    server = WebServer(source, host, port, names)
    server.start()
    try:
        print(f"the page is at {server.url} – Ctrl-C ends it", flush=True)  # noqa: T201 - the command's own output
        stopped.wait()
    finally:
        server.stop()
    if source.unsaved:
        text = source.save()
        if not quiet:
            print(text)  # noqa: T201
    return source.damage
