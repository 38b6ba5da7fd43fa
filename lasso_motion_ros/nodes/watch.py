"""What is wrong with the streams themselves, judged by counts, stamps and what publishers offer."""

from __future__ import annotations

import itertools
import statistics
from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass, field

from lasso_motion_ros.geometry.frames import PLANES, Plane
from msg_adapters.messages import NANOSECONDS
from msg_adapters.topics import camera_info_topic, image_topic

PROFILE_CURE = (
    "start the publisher with FASTRTPS_DEFAULT_PROFILES_FILE=$(ros2 pkg prefix --share lasso_motion_ros)"
    "/config/fastdds.xml, or let it publish reliably"
)


@dataclass(frozen=True)
class _Limits:
    """When a stream is complained about.

    Attributes:
        silence_s: so long may a topic have no publisher, images no calibration, or clicks no pair.
        images: stamps remembered, to count gaps between them.
        enough_intervals: intervals that are needed to tell the frame period.
        lags: images whose stamp is compared with their receipt.
        missing_share: of the images; where more get lost, or more pairs are left out, that is said.
        offset_s: between the planes' clocks; with more, images no longer pair.
    """

    silence_s: float = 2.0
    images: int = 60
    enough_intervals: int = 20
    lags: int = 15
    missing_share: float = 0.1
    offset_s: float = 0.2


_LIMITS = _Limits()


@dataclass
class _Arrivals:
    """Stamps and times of receipt (both ns) of one plane's last images."""

    stamps: deque[int] = field(default_factory=lambda: deque(maxlen=_LIMITS.images))
    lags: deque[int] = field(default_factory=lambda: deque(maxlen=_LIMITS.lags))
    count: int = 0
    count_before: int = 0
    last_s: float | None = None
    held_s: float | None = None
    uncalibrated_since_s: float | None = None


@dataclass(frozen=True)
class Offer:
    """What is offered on a plane's topics.

    Attributes:
        image_publishers: names of the nodes that publish images.
        best_effort: of these, the ones that publish best effort.
        calibration_publishers: how many publish calibrations.
        subscribed_reliably: how the images are subscribed; None while not at all.
    """

    image_publishers: tuple[str, ...]
    best_effort: tuple[str, ...]
    calibration_publishers: int
    subscribed_reliably: bool | None


class StreamWatch:
    """Notices topics without publisher, images without calibration, lost images, clocks that disagree, slow trackers.

    Args:
        now_s: steady clock, seconds, at the start.
    """

    def __init__(self, now_s: float) -> None:
        self._began_s = now_s
        self._arrivals: dict[Plane, _Arrivals] = {plane: _Arrivals() for plane in PLANES}
        self._whole_pairs, self._left_out = 0, 0
        self._clicks_wait_since_s: float | None = None

    def add_image(self, plane: Plane, stamp_ns: int, now_ns: int) -> None:
        """Note an image.

        Args:
            plane: its plane.
            stamp_ns: its stamp.
            now_ns: when it arrived, steady clock.
        """
        arrivals = self._arrivals[plane]
        if arrivals.stamps and stamp_ns < arrivals.stamps[-1] - NANOSECONDS:
            arrivals.stamps.clear()
            arrivals.lags.clear()
        arrivals.stamps.append(stamp_ns)
        arrivals.lags.append(stamp_ns - now_ns)
        arrivals.count += 1
        arrivals.last_s = now_ns / NANOSECONDS

    def add_held(self, plane: Plane, now_ns: int) -> None:
        """Note a picture of a plane that is no new exposure, but the last one shown again."""
        self._arrivals[plane].held_s = now_ns / NANOSECONDS

    def silence_words(self, plane: Plane, now_s: float) -> str:
        """That no new images of a plane come, and since when; empty while they come, or if none has ever come."""
        silence_s = self.silence_s(plane, now_s)
        held_s = self._arrivals[plane].held_s
        held = held_s is not None and now_s - held_s < _LIMITS.silence_s
        what = "the picture is held: no new exposure" if held else "no images"
        return f"{what} for {silence_s:.0f} s" if silence_s else ""

    def silence_s(self, plane: Plane, now_s: float) -> float:
        """How long ago images stopped coming, seconds; 0 while they come, or if none has ever come."""
        last_s = self._arrivals[plane].last_s
        return now_s - last_s if last_s is not None and now_s - last_s >= _LIMITS.silence_s else 0.0

    def clock_offset_s(self) -> float | None:
        """How far B's stamps are ahead of A's in images that arrive together, seconds; None while unknown."""
        lags = {plane: arrivals.lags for plane, arrivals in self._arrivals.items()}
        if any(len(of_plane) < 2 for of_plane in lags.values()):
            return None
        return (statistics.median(lags["b"]) - statistics.median(lags["a"])) / NANOSECONDS

    def missing(self, plane: Plane) -> tuple[int, int]:
        """How many of the last images are missing, and of how many, judged by the gaps between the stamps."""
        stamps = sorted(set(self._arrivals[plane].stamps))
        intervals = [after - before for before, after in itertools.pairwise(stamps)]
        if len(intervals) < _LIMITS.enough_intervals:
            return 0, len(stamps)
        period = sorted(intervals)[len(intervals) // 5]  # where many are lost, the short intervals are the true ones
        expected = sum(max(1, round(interval / period)) for interval in intervals) + 1
        return expected - len(stamps), expected

    def complaints(
        self,
        now_s: float,
        offers: dict[Plane, Offer],
        calibrated: tuple[Plane, ...],
        whole_pairs: int,
        waiting_clicks: str = "",
        left_out: int = 0,
    ) -> Iterator[tuple[str, str]]:
        """What is wrong now: topic and words.

        Args:
            now_s: steady clock, seconds.
            offers: per plane, what is published.
            calibrated: the planes that have a valid calibration.
            whole_pairs: pairs of both planes so far.
            waiting_clicks: what clicks are kept and what they wait for, in words; empty where none are kept.
            left_out: pairs so far that the tracker had no time for.
        """
        for plane, offer in offers.items():
            images, infos = image_topic(plane).name, camera_info_topic(plane).name
            arrivals = self._arrivals[plane]
            if now_s - self._began_s >= _LIMITS.silence_s:
                if not offer.image_publishers:
                    yield images, "nobody publishes it"
                if offer.calibration_publishers == 0 and plane not in calibrated:
                    yield infos, "nobody publishes it"
            if offer.best_effort and offer.subscribed_reliably:
                names = ", ".join(offer.best_effort)
                yield (
                    images,
                    (
                        f"{names} publishes best effort, image_reliability asks for reliable: nothing will be received;"
                        " set image_reliability to auto"
                    ),
                )
            # A publisher that was killed stays known for 20 s; its silence shows earlier.
            if silent := self.silence_words(plane, now_s):
                yield images, silent
            yield from self._uncalibrated(plane, arrivals, plane in calibrated, now_s)
            missing, expected = self.missing(plane)
            if missing > _LIMITS.missing_share * expected and offer.best_effort:
                yield (
                    images,
                    (
                        f"{missing} of the last {expected} images are missing: {', '.join(offer.best_effort)} publishes"
                        f" best effort, probably without room for an image in shared memory; {PROFILE_CURE}"
                    ),
                )
        if not waiting_clicks:
            self._clicks_wait_since_s = None
        elif self._clicks_wait_since_s is None:
            self._clicks_wait_since_s = now_s
        elif now_s - self._clicks_wait_since_s >= _LIMITS.silence_s:
            yield "seed", waiting_clicks
        offset_s = self.clock_offset_s()
        pairs, skipped = whole_pairs - self._whole_pairs, left_out - self._left_out
        self._whole_pairs, self._left_out = whole_pairs, left_out
        if skipped > _LIMITS.missing_share * max(pairs, 1):
            yield "tracker", f"it cannot keep up with the stream: {skipped} pairs were left out while {pairs} came"
        come = [arrivals.count - arrivals.count_before for arrivals in self._arrivals.values()]
        for arrivals in self._arrivals.values():
            arrivals.count_before = arrivals.count
        if offset_s is not None and abs(offset_s) > _LIMITS.offset_s and pairs == 0 and min(come) > 0:
            yield (
                "sync",
                (
                    f"no image of plane B belongs to one of plane A: B's stamps are {offset_s:+.3f} s from A's"
                    " by the time they come; synchronise the clocks, or set stamp_source to arrival"
                ),
            )

    def _uncalibrated(
        self, plane: Plane, arrivals: _Arrivals, calibrated: bool, now_s: float
    ) -> Iterator[tuple[str, str]]:
        if calibrated or arrivals.count == 0 or self.silence_s(plane, now_s) > 0.0:
            arrivals.uncalibrated_since_s = None
            return
        if arrivals.uncalibrated_since_s is None:
            arrivals.uncalibrated_since_s = now_s
        elif now_s - arrivals.uncalibrated_since_s >= _LIMITS.silence_s:
            since = now_s - arrivals.uncalibrated_since_s
            yield camera_info_topic(plane).name, f"images have come for {since:.0f} s without a valid calibration"
