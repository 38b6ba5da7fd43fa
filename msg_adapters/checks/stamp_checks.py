"""Stamps: zero, repeated, going back, irregular; planes that do not pair; clocks that disagree."""

from __future__ import annotations

import statistics
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field

from lasso_motion_ros.geometry.frames import Pair, Plane
from msg_adapters.checks.issue import Issue, Severity
from msg_adapters.messages import NANOSECONDS
from msg_adapters.sync.pairing import PairSynchroniser
from msg_adapters.sync.partner import NEW_RUN_NS, PartnerRule
from msg_adapters.topics import image_topic


@dataclass(frozen=True)
class _Limits:
    """Where stamps become suspicious.

    Attributes:
        ahead_s: how far stamps may be ahead of this machine's clock.
        slowest_hz: below this rate breathing cannot be followed.
        irregular: jitter, as a share of the frame period.
        paired_enough: share of images with a partner below which frames are lost (a warning).
        paired_at_all: the same, below which the planes do not belong together (an error).
        at_the_ends: images without partner that are no fault: of a stream joined and left midway, the partner may lie
            outside.
        rates_apart: ratio of the planes' frame rates.
        clocks_apart_s: difference between the ages of images that arrive together: one clock is wrong.
        old_s: age on arrival that no image of a live stream has.
    """

    ahead_s: float = 0.005
    slowest_hz: float = 1.0
    irregular: float = 0.25
    paired_enough: float = 0.95
    paired_at_all: float = 0.5
    at_the_ends: int = 2
    rates_apart: float = 1.2
    clocks_apart_s: float = 0.1
    old_s: float = 1.0


LIMITS = _Limits()


@dataclass
class PlaneStamps:
    """Stamps of one plane's images in the order in which they came, and when they came (nanoseconds)."""

    stamps: list[int] = field(default_factory=list)
    arrivals: list[int] = field(default_factory=list)

    @property
    def intervals_s(self) -> list[float]:
        """Seconds between one stamp and the next, where they go forward."""
        steps = zip(self.stamps[:-1], self.stamps[1:], strict=True)
        return [(after - before) / NANOSECONDS for before, after in steps if after > before]

    @property
    def rate_hz(self) -> float | None:
        """Images a second by the stamps, or None where they do not tell."""
        intervals = self.intervals_s
        return 1.0 / statistics.median(intervals) if intervals else None

    @property
    def age_s(self) -> float:
        """How long after its stamp an image came, median."""
        ages = (arrival - stamp for arrival, stamp in zip(self.arrivals, self.stamps, strict=True))
        return statistics.median(ages) / NANOSECONDS


def pairs_of(planes: Mapping[Plane, PlaneStamps]) -> tuple[list[Pair[int]], dict[str, int]]:
    """The pairs that the tracker would make of these stamps by default, and how many images of each plane got one."""
    synchroniser: PairSynchroniser[int] = PairSynchroniser(PartnerRule())
    entries = sorted(
        (arrival, plane, stamp)
        for plane, stream in planes.items()
        for arrival, stamp in zip(stream.arrivals, stream.stamps, strict=True)
    )
    pairs: list[Pair[int]] = []
    for _, plane, stamp in entries:
        pairs += synchroniser.add(plane, stamp, stamp)
    pairs += synchroniser.flush()
    return pairs, {"a": synchroniser.counts["a"].paired, "b": synchroniser.counts["b"].paired}


def check_stamps(planes: Mapping[Plane, PlaneStamps], *, live: bool) -> Iterator[Issue]:
    """Issues with the stamps of both planes' images.

    Args:
        planes: `a` and `b`.
        live: arrival times are this machine's clock, now.
    """
    for plane, stream in planes.items():
        if stream.stamps:
            yield from _check_plane(image_topic(plane).recorded_name, stream, live=live)
    if all(stream.stamps and any(stream.stamps) for stream in planes.values()):
        yield from _check_together(planes)


def _check_plane(name: str, stream: PlaneStamps, *, live: bool) -> Iterator[Issue]:
    count = len(stream.stamps)
    zeros = stream.stamps.count(0)
    if zeros:
        yield Issue(
            "error",
            name,
            f"{zeros} of {count} stamps are zero",
            "stamp each image with its exposure (a node may use stamp_source: arrival)",
        )
    steps = list(zip(stream.stamps[:-1], stream.stamps[1:], strict=True))
    repeated = sum(after == before for before, after in steps if before)
    if repeated:
        yield Issue("error", name, f"{repeated} stamps repeat the one before", "give each image its own exposure time")
    runs = sum(after < before - NEW_RUN_NS for before, after in steps if after)
    if runs:
        text = f"the stamps start again {runs} times, by more than 1 s: as many new runs"
        yield Issue("note", name, text, "give each run its own clicks")
    back = sum(before - NEW_RUN_NS <= after < before for before, after in steps if after)
    if back:
        severity: Severity = "error" if back > count / 10 else "warning"
        yield Issue(severity, name, f"{back} stamps go back in time", "publish in order of exposure, from one clock")
    intervals = stream.intervals_s
    if len(intervals) < 3:
        return
    period = statistics.median(intervals)
    if 1.0 / period < LIMITS.slowest_hz * 0.99:
        yield Issue("warning", name, f"{1.0 / period:.2g} images/s are too few to follow breathing", "1/s or more")
    gaps = sum(interval > 1.5 * period for interval in intervals)
    if gaps:
        yield Issue("warning", name, f"{gaps} gaps of more than 1.5 periods ({period:.3g} s)", "see what is lost")
    near = sorted(abs(interval - period) for interval in intervals if interval <= 1.5 * period)
    jitter = near[int(0.95 * (len(near) - 1))]
    if jitter > LIMITS.irregular * period:
        yield Issue(
            "warning",
            name,
            f"the stamps jitter by {jitter * 1e3:.0f} ms (period {period * 1e3:.0f} ms)",
            "stamp the exposure, not the arrival",
        )
    if live and stream.age_s < -LIMITS.ahead_s:
        yield Issue(
            "warning",
            name,
            f"the stamps are {-stream.age_s:.3f} s in the future of this machine's clock",
            "synchronise the clocks (chrony, PTP)",
        )
    elif live and stream.age_s > LIMITS.old_s:
        yield Issue("note", name, f"the stamps are {_duration(stream.age_s)} old: a recording, or another clock")


def _check_together(planes: Mapping[Plane, PlaneStamps]) -> Iterator[Issue]:
    a, b = planes["a"], planes["b"]
    apart = a.age_s - b.age_s
    clocks_apart = abs(apart) > LIMITS.clocks_apart_s
    if clocks_apart:
        yield Issue(
            "error",
            "planes",
            f"clocks that disagree: images that come together are stamped {_duration(abs(apart))} apart"
            f" (plane {'b' if apart > 0 else 'a'} ahead)",
            "stamp both planes by one clock",
        )
    rates = a.rate_hz, b.rate_hz
    if rates[0] and rates[1] and not 1 / LIMITS.rates_apart < rates[0] / rates[1] < LIMITS.rates_apart:
        yield Issue(
            "warning",
            "planes",
            f"plane a has {rates[0]:.3g} images/s, plane b {rates[1]:.3g}",
            "expose both planes at one rate: what has no partner says little",
        )
    _, paired = pairs_of(planes)
    share = min(paired["a"] / len(a.stamps), paired["b"] / len(b.stamps))
    alone = max(len(a.stamps) - paired["a"], len(b.stamps) - paired["b"])
    if share < LIMITS.paired_enough and alone > LIMITS.at_the_ends and not clocks_apart:
        yield Issue(
            "warning" if share >= LIMITS.paired_at_all else "error",
            "planes",
            f"{paired['a']} of {len(a.stamps)} images of plane a and {paired['b']} of {len(b.stamps)} of plane b"
            " pair by their stamps",
            "a B belongs to the A before it, up to half a period; else set sync.plane_b_offset_s",
        )


def _duration(seconds: float) -> str:
    for unit, name in ((86400.0, "days"), (3600.0, "hours"), (60.0, "minutes")):
        if seconds > 2 * unit:
            return f"{seconds / unit:.1f} {name}"
    return f"{seconds:.3f} s"
