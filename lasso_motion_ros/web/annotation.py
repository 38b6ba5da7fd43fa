"""Drawing the loop's centrelines into a copy of a recording, pair by pair, with the page's own clicking."""

from __future__ import annotations

import threading
from collections import Counter
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from lasso_motion_ros.core.errors import MessageError, RecordingError
from lasso_motion_ros.core.signals import held_signals, wait_until_set
from lasso_motion_ros.geometry.frames import PLANES, Plane
from lasso_motion_ros.web import protocol
from lasso_motion_ros.web.server import WebServer
from lasso_motion_ros.web.source import PageView, Picture, PlanePicture, TracePoint
from msg_adapters.recordings.annotated_recording import FEWEST_POINTS, AnnotatedRecording
from msg_adapters.seeds import MINIMUM_CLICKS, encode_seeds_file

Array = npt.NDArray[np.float64]

_EMPTY = np.zeros((0, 2))


class Annotation:
    """The source (see `Source`) of a page on which the pairs of a recording are clicked, one after the other.

    Centrelines that the recording already has are shown, and replaced where they are drawn anew.

    Args:
        recording: the recording and its copy.

    Attributes:
        unsaved: whether something was drawn since the copy was last written.
    """

    def __init__(self, recording: AnnotatedRecording) -> None:
        self._recording = recording
        self._lock, self._saving = threading.RLock(), threading.Lock()
        self._index, self._number, self._version = 0, 1, 0
        self._drawn_by: Counter[int] = Counter()
        self.unsaved = False
        self._images = recording.images(recording.pairs[0])

    @property
    def damage(self) -> str | None:
        """What is wrong with the recording as a file."""
        return self._recording.damage

    def status(self, page: int) -> dict[str, Any]:
        """See `Source.status`."""
        with self._lock:
            pairs = self._recording.pairs
            pair = pairs[self._index]
            return {
                "mode": "annotate",
                "name": f"{self._recording.name} → {self._recording.output.name}",
                "index": self._index,
                "frames": len(pairs),
                "done": sum(one.is_done for one in pairs),
                "unsaved": self.unsaved,
                # A page keeps its own clicks, and takes those that another page has set.
                "version": self._version + self._drawn_by.total() - self._drawn_by[page],
                "closed": pair.closed,
                "clicks": FEWEST_POINTS,
                "has_clicks": pair.has_seed,
                "points": {plane: pair.clicks.get(plane, _EMPTY).tolist() for plane in PLANES},
                "curves": {
                    plane: np.round(curve, 2).tolist() if len(curve := pair.curves.get(plane, _EMPTY)) else None
                    for plane in PLANES
                },
            }

    def picture(self, view: PageView, page: int) -> Picture | None:
        """See `Source.picture`."""
        with self._lock:
            stamps = self._recording.pairs[self._index].image_stamps
            planes = {plane: PlanePicture(stamps[plane], pixels, None) for plane, pixels in self._images.items()}
            return Picture(self._number, True, planes)

    def trace(self, after: int) -> list[TracePoint]:
        """See `Source.trace`; nothing moves here."""
        return []

    def clicks_file(self, body: Mapping[str, Any], page: int) -> str:
        """See `Source.clicks_file`; of the pair that is shown."""
        with self._lock:
            pair = self._recording.pairs[self._index]
            if not pair.has_seed:
                raise RecordingError(f"Click {MINIMUM_CLICKS} points or more along the loop, in both planes, first.")
            return encode_seeds_file({plane: (pair.image_stamps[plane], pair.clicks[plane]) for plane in PLANES})

    def watch(self, on_change: Callable[[], None]) -> None:
        """See `Source.watch`; nothing changes here but by the page's own commands."""

    def millimetres_per_pixel(self, page: int) -> Mapping[Plane, float]:
        """See `Source.millimetres_per_pixel`; centrelines need no calibration."""
        return {}

    def audience(self, views: Mapping[int, PageView]) -> None:
        """See `Source.audience`."""

    def command(self, name: str, body: Mapping[str, Any], page: int) -> str:
        """See `Source.command`."""
        with self._lock:
            if name == "go":
                return self._go(self._checked_index(body), copy=body.get("copy") is True)
            if name == "draw":
                self._drawn_by[page] += 1
                return self._draw(self._checked_index(body), body)
        if name == "save":
            return self.save()
        raise RecordingError(f"{name} belongs to the live page")

    def save(self) -> str:
        """Write the copy.

        Returns:
            What was done, for the user.

        Raises:
            RecordingError: it cannot be written.
        """
        with self._saving:
            with self._lock:
                # Written without the lock: the page asks on meanwhile, and would take silence for a lost server.
                changes, self.unsaved = self._recording.changes(), False
                done = sum(bool(curve.size) for pair in self._recording.pairs for curve in pair.curves.values())
                seeds = self._recording.seed_pair
            try:
                self._recording.save(changes)
            except BaseException:
                self.unsaved = True
                raise
        clicks = "" if seeds is None else f", and the clicks of pair {seeds + 1} for track"
        return f"Saved {done} centrelines in {self._recording.output}{clicks}."

    def _go(self, index: int, *, copy: bool) -> str:
        pair = self._recording.pairs[index]
        if copy and index > 0:
            # The last pair's clicks are a good start: they only need to be moved.
            before = self._recording.pairs[index - 1]
            for plane in pair.image_stamps:
                if plane in before.clicks:
                    pair.clicks[plane] = before.clicks[plane]
                    pair.draw(plane, before.curves[plane])
            pair.closed = before.closed
            self.unsaved = True
        if index != self._index:
            self._images = self._recording.images(pair)
            self._index = index
            self._number += 1
        self._version += 1
        return ""

    def _draw(self, index: int, body: Mapping[str, Any]) -> str:
        pair = self._recording.pairs[index]
        for plane in pair.image_stamps:
            points = protocol.points(body, plane)
            curve = protocol.points(body, plane, key=f"curve_{plane}")
            if not len(points) and not len(pair.clicks.get(plane, _EMPTY)):
                continue  # nothing was clicked here: the recorded centreline stays
            pair.clicks[plane] = points
            pair.draw(plane, curve)
            self.unsaved = True
        pair.closed = body.get("closed") is True
        return ""

    def _checked_index(self, body: Mapping[str, Any]) -> int:
        index = body.get("index")
        if type(index) is not int or not 0 <= index < len(self._recording.pairs):
            raise MessageError(f"index: expected 0 to {len(self._recording.pairs) - 1}, found {index!r}")
        return index


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
    with held_signals() as stopped:
        source = Annotation(AnnotatedRecording(recording, output, remap, overwrite))
        server = WebServer(source, host, port, names)
        server.start()
        try:
            print(f"the page is at {server.url} – Ctrl-C ends it", flush=True)  # noqa: T201 - the command's own output
            wait_until_set(stopped)
        finally:
            server.stop()
    if source.unsaved:
        text = source.save()
        if not quiet:
            print(text)  # noqa: T201
    return source.damage
