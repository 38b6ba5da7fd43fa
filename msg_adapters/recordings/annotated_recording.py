"""A recording's pairs with their centrelines, and the copy with those that were drawn anew.

A centreline has its pair's stamp, plane A's, as the truth of a simulated recording has.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import numpy.typing as npt

from lasso_motion_ros.core.errors import RecordingError
from lasso_motion_ros.core.output_checks import OutputPlace, check_outputs
from lasso_motion_ros.geometry.frames import PLANES, Plane
from msg_adapters.images import Pixels, decode_image
from msg_adapters.messages import header_fields, stamp_to_ns
from msg_adapters.recordings.copy import RecordingCopier
from msg_adapters.recordings.reader import RawMessage, RecordingReader
from msg_adapters.recordings.tracking_topics import check_tracking_topics, recorded_image_topic
from msg_adapters.recordings.writer import RecordingWriter
from msg_adapters.seeds import MINIMUM_CLICKS, decode_polygon, encode_polygon
from msg_adapters.sync.pairing import PairSynchroniser
from msg_adapters.sync.partner import PartnerRule
from msg_adapters.topics import Topic, seed_topic, true_centreline_topic

Array = npt.NDArray[np.float64]

FEWEST_POINTS = 3
"""Of a centreline; one with fewer is left out of the copy."""
_CENTRELINE_TOPICS: dict[str, Plane] = {true_centreline_topic(plane).recorded_name: plane for plane in PLANES}


@dataclass(eq=False)
class AnnotatedPair:
    """One pair and the centrelines in it.

    Attributes:
        stamp_ns: the pair's stamp.
        image_stamps: for each plane that is there, its image's stamp.
        curves: the centrelines, (N, 2) pixels; empty where one was erased.
        drawn: the planes whose centreline was drawn anew.
        clicks: what was clicked, (N, 2) pixels.
        closed: whether the curves through the clicks are closed.
    """

    stamp_ns: int
    image_stamps: dict[Plane, int]
    curves: dict[Plane, Array] = field(default_factory=dict)
    drawn: set[Plane] = field(default_factory=set)
    clicks: dict[Plane, Array] = field(default_factory=dict)
    closed: bool = False

    def draw(self, plane: Plane, curve: Array) -> None:
        """Replace a plane's centreline by (N, 2) pixels."""
        self.curves[plane] = curve
        self.drawn.add(plane)

    @property
    def has_seed(self) -> bool:
        """Whether there are enough clicks in both planes to begin to track with."""
        return all(plane in self.image_stamps and len(self.clicks.get(plane, ())) >= MINIMUM_CLICKS for plane in PLANES)

    @property
    def is_done(self) -> bool:
        """Whether every image of the pair has its centreline."""
        return all(plane in self.curves and len(self.curves[plane]) for plane in self.image_stamps)


@dataclass(frozen=True, eq=False)
class Changes:
    """What a copy has besides the recording, at one time.

    Attributes:
        additions: log time (ns), topic, points (N, 2) and stamp (ns), in order of time.
        drawn: stamp and plane of the centrelines that replace recorded ones.
    """

    additions: tuple[tuple[int, Topic, Array, int], ...]
    drawn: frozenset[tuple[int, Plane]]


class AnnotatedRecording:
    """A recording to draw centrelines in, and the copy that gets them.

    Where the recording has no clicks for the tracker, the copy gets those of the first pair that has enough of them.

    Args:
        recording: the recording; it is not changed.
        output: the copy.
        remap: recorded topic → the name it is read (and written) as.
        overwrite: replace `output` if it exists.

    Attributes:
        pairs: in order of time, with the centrelines that the recording has.
        name: the recording's file name.
        output: the copy.

    Raises:
        RecordingError: it cannot be read, has no images, or the copy may not be written.
    """

    def __init__(
        self, recording: Path, output: Path, remap: Mapping[str, str] | None = None, overwrite: bool = False
    ) -> None:
        self._reader = RecordingReader(recording, remap)
        check_tracking_topics(recording, self._reader.topics, calibrated=True)
        check_outputs([OutputPlace(output)], self._reader.files, overwrite)
        self.name = self._reader.path.name
        self.output = output
        self._image_topics = {recorded_image_topic(plane, self._reader.topics).recorded_name: plane for plane in PLANES}
        self.pairs = self._read_pairs()
        self._read_centrelines()

    @property
    def damage(self) -> str | None:
        """What is wrong with the recording as a file."""
        return self._reader.damage

    def images(self, pair: AnnotatedPair) -> dict[Plane, Pixels]:
        """The images of one pair."""
        wanted = dict(pair.image_stamps)
        found: dict[Plane, Pixels] = {}
        for recorded in self._reader.messages(list(self._image_topics)):
            plane, message = self._image_topics[recorded.topic], recorded.message
            if wanted.get(plane) == stamp_to_ns(message.header.stamp):
                del wanted[plane]
                found[plane] = decode_image(message)
                if not wanted:
                    break
        return found

    @property
    def seed_pair(self) -> int | None:
        """Index of the pair whose clicks the copy gets for the tracker; None where it gets none."""
        if any(seed_topic(plane).recorded_name in self._reader.topics for plane in PLANES):
            return None
        return next((index for index, pair in enumerate(self.pairs) if pair.has_seed), None)

    def changes(self) -> Changes:
        """What has been drawn and clicked so far, as `save` writes it."""
        drawn = frozenset((pair.stamp_ns, plane) for pair in self.pairs for plane in pair.drawn)
        return Changes(tuple(self._additions()), drawn)

    def save(self, changes: Changes) -> None:
        """Write the copy: everything that the recording has, and the changes; whole or not at all.

        It takes as long as the recording is large; what is drawn meanwhile is not in it.

        Raises:
            RecordingError: it cannot be written.
        """
        with RecordingWriter(self.output, overwrite=True, whole=True) as writer:
            copier = RecordingCopier(self._reader, writer)
            drawn = iter(changes.additions)
            waiting = next(drawn, None)
            for message in self._kept_messages(changes.drawn):
                # In order of time, as a recorder would have written them.
                while waiting is not None and waiting[0] < message.log_time_ns:
                    _write(writer, *waiting)
                    waiting = next(drawn, None)
                copier.copy(message)
            while waiting is not None:
                _write(writer, *waiting)
                waiting = next(drawn, None)

    def _read_pairs(self) -> list[AnnotatedPair]:
        pairing: PairSynchroniser[int] = PairSynchroniser(PartnerRule())
        pairs = []
        for recorded in self._reader.messages(list(self._image_topics)):
            stamp_ns = stamp_to_ns(recorded.message.header.stamp)
            pairs += pairing.add(self._image_topics[recorded.topic], stamp_ns, stamp_ns)
        pairs += pairing.flush()
        if not pairs:
            raise RecordingError(f"{self._reader.path} has no images")
        return [AnnotatedPair(pair.stamp_ns, pair.frames) for pair in pairs]

    def _read_centrelines(self) -> None:
        by_stamp = {pair.stamp_ns: pair for pair in self.pairs}
        for recorded in self._reader.messages(list(_CENTRELINE_TOPICS)):
            pair = by_stamp.get(stamp_to_ns(recorded.message.header.stamp))
            if pair is not None:
                pair.curves[_CENTRELINE_TOPICS[recorded.topic]] = decode_polygon(recorded.message)

    def _additions(self) -> list[tuple[int, Topic, Array, int]]:
        """What the copy has besides: log time, topic, points and stamp, in order of time."""
        added = [
            (pair.stamp_ns, true_centreline_topic(plane), pair.curves[plane], pair.stamp_ns)
            for pair in self.pairs
            for plane in sorted(pair.drawn)
            if len(pair.curves[plane]) >= FEWEST_POINTS
        ]
        if self.seed_pair is not None:
            pair = self.pairs[self.seed_pair]
            added += [
                (pair.stamp_ns, seed_topic(plane), pair.clicks[plane], pair.image_stamps[plane]) for plane in PLANES
            ]
        return sorted(added, key=lambda one: one[0])

    def _kept_messages(self, drawn: frozenset[tuple[int, Plane]]) -> Iterator[RawMessage]:
        """All messages but the centrelines that were drawn anew."""
        replaced = {
            (recorded.log_time_ns, recorded.topic)
            for recorded in self._reader.messages(list(_CENTRELINE_TOPICS))
            if (stamp_to_ns(recorded.message.header.stamp), _CENTRELINE_TOPICS[recorded.topic]) in drawn
        }
        return (one for one in self._reader.raw_messages() if (one.log_time_ns, one.topic) not in replaced)


def _write(writer: RecordingWriter, log_time_ns: int, topic: Topic, points: Array, stamp_ns: int) -> None:
    fields = encode_polygon(points, header_fields(stamp_ns))
    writer.write(topic.recorded_name, topic.type_name, fields, log_time_ns)
