"""Pairs are decided by stamps alone, in hand-worked cases and for any stream."""

from __future__ import annotations

from itertools import pairwise

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lasso_motion_ros.geometry.frames import Pair
from msg_adapters.sync.pairing import PairSynchroniser
from msg_adapters.sync.partner import PartnerRule

MS = 1_000_000


def feed(sync: PairSynchroniser[str], *frames: str, at_ms: dict[str, float]) -> list[tuple[str | None, str | None]]:
    """Add frames by name (`a0`, `b0`, …) in the order of arrival; the pairs as names."""
    pairs: list[Pair[str]] = []
    for name in frames:
        pairs += sync.add("a" if name[0] == "a" else "b", round(at_ms[name] * MS), name)
    return [(pair.a, pair.b) for pair in pairs]


def stream(period_ms: float, offset_ms: float, count: int = 12) -> dict[str, float]:
    at = {f"a{i}": 10_000.0 + i * period_ms for i in range(count)}
    return at | {f"b{i}": 10_000.0 + i * period_ms + offset_ms for i in range(count)}


def synchroniser(**options: float) -> PairSynchroniser[str]:
    return PairSynchroniser(PartnerRule.from_seconds(0.005, options.get("offset_s", -1.0)))


def test_simultaneous_frames_pair_as_soon_as_both_are_there() -> None:
    assert feed(synchroniser(), "a0", "b0", at_ms=stream(333, 0)) == [("a0", "b0")]
    assert feed(synchroniser(), "b0", "a0", at_ms=stream(333, 0)) == [("a0", "b0")]


def test_an_a_without_b_is_told_until_it_is_in_a_pair() -> None:
    sync, at = synchroniser(), stream(333, 166)
    told = []
    for name in ("a0", "b0", "a1", "b1", "a2", "a3", "b2", "b3"):
        feed(sync, name, at_ms=at)
        told.append(sync.waiting_a)
    # b0 waits for the period to be known; a3 came before b2.
    assert told == ["a0", None, "a1", None, "a2", "a2", "a3", None]


def test_b_slightly_before_its_a_is_jitter() -> None:
    assert feed(synchroniser(), "b0", "a0", "b1", "a1", at_ms=stream(333, -4)) == [("a0", "b0"), ("a1", "b1")]


def test_b_clearly_before_a_is_not_its_partner() -> None:
    at = stream(333, -8)
    sync = synchroniser()
    assert feed(sync, "b0", "a0", at_ms=at) == [(None, "b0")]


def test_alternating_exposure_waits_for_the_period_once() -> None:
    at = stream(267, 133)
    sync = synchroniser()
    assert feed(sync, "a0", "b0", at_ms=at) == []
    assert feed(sync, "a1", at_ms=at) == [("a0", "b0")]
    assert feed(sync, "b1", at_ms=at) == [("a1", "b1")]
    assert feed(sync, "a2", "b2", at_ms=at) == [("a2", "b2")]


def test_b_later_than_half_a_period_belongs_to_no_a() -> None:
    at = stream(200, 120)
    assert feed(synchroniser(), "a0", "b0", "a1", "b1", at_ms=at) == [("a0", None), (None, "b0"), ("a1", None)]


@pytest.mark.parametrize("offset_ms", [0.0, 33.0])
def test_missing_b_is_known_once_a_later_b_has_come(offset_ms: float) -> None:
    at = stream(67, offset_ms)
    sync = synchroniser()
    feed(sync, "a0", "b0", "a1", "b1", at_ms=at)
    assert feed(sync, "a2", "a3", at_ms=at) == []
    assert feed(sync, "b3", at_ms=at) == [("a2", None), ("a3", "b3")]


def test_missing_b_is_known_once_enough_as_have_come() -> None:
    at = stream(67, 0, 20)
    sync = synchroniser()
    feed(sync, "a0", "b0", at_ms=at)
    assert feed(sync, *(f"a{i}" for i in range(1, 9)), at_ms=at) == []
    assert feed(sync, "a9", at_ms=at) == [(f"a{i}", None) for i in range(1, 7)]  # 536 ms later
    slow, at = synchroniser(), stream(333, 0)
    assert feed(slow, "a0", "b0", "a1", "a2", at_ms=at) == [("a0", "b0")]
    assert feed(slow, "a3", at_ms=at) == [("a1", None)]


def test_a_silent_plane_is_waited_for_long_only_once() -> None:
    at = stream(67, 0, 40)
    sync = synchroniser()
    feed(sync, "a0", "b0", *(f"a{i}" for i in range(1, 10)), at_ms=at)
    assert feed(sync, "a10", at_ms=at) == [("a7", None)]  # 201 ms later
    assert feed(sync, "a11", "b11", at_ms=at) == [*((f"a{i}", None) for i in range(8, 11)), ("a11", "b11")]
    assert feed(sync, *(f"a{i}" for i in range(12, 20)), at_ms=at) == []  # heard again: long once more


def test_missing_a_gets_the_stamp_that_it_would_have_had() -> None:
    at = stream(267, 133)
    sync = synchroniser()
    feed(sync, "a0", "b0", "a1", "b1", at_ms=at)
    pairs = [p for name in ("b2", "a3", "b3") for p in sync.add(name[0], round(at[name] * MS), name)]  # type: ignore[arg-type]
    assert [(p.a, p.b) for p in pairs] == [(None, "b2"), ("a3", "b3")]
    assert pairs[0].stamp_ns == round(at["a2"] * MS)


def test_known_offset_pairs_the_nearest() -> None:
    at = stream(200, 150)  # more than half a period: only a known offset can tell
    sync = synchroniser(offset_s=0.15)
    assert feed(sync, "a0", "b0", "a1", "b1", at_ms=at) == [("a0", "b0"), ("a1", "b1")]
    assert feed(sync, "a2", "a3", "b3", at_ms=at) == [("a2", None), ("a3", "b3")]
    assert feed(sync, "b4", "a5", "b5", "a6", "b6", at_ms=at) == [(None, "b4"), ("a5", "b5"), ("a6", "b6")]


@pytest.mark.parametrize("later_ms", [333.0, 20.0])
def test_a_change_of_rate_costs_at_most_one_pair(later_ms: float) -> None:
    at = stream(67, 33, 6)
    for i in range(6):
        at |= {f"a{6 + i}": at["a5"] + 67 + i * later_ms, f"b{6 + i}": at["b5"] + 67 + i * later_ms}
        at[f"b{6 + i}"] = at[f"a{6 + i}"] + later_ms / 2
    names = sorted(at, key=lambda name: at[name])
    pairs = feed(synchroniser(), *names, at_ms=at)
    assert sum(a is not None and b is not None and a[1:] == b[1:] for a, b in pairs) >= 10
    assert all(a is None or b is None or a[1:] == b[1:] for a, b in pairs)


def test_overtaking_between_the_topics_changes_nothing() -> None:
    at = stream(67, 33)
    expected = [(f"a{i}", f"b{i}") for i in range(5)]
    assert feed(synchroniser(), "a0", "b0", "a1", "b1", "a2", "b2", "a3", "b3", "a4", "b4", at_ms=at) == expected
    assert feed(synchroniser(), "a0", "a1", "b0", "b1", "b2", "a2", "a3", "b3", "b4", "a4", at_ms=at) == expected


def test_repeated_and_late_frames_are_dropped_and_counted() -> None:
    at = stream(333, 0)
    sync = synchroniser()
    assert feed(sync, "a0", "a0", "b0", "b0", "a1", "b1", "a0", at_ms=at) == [("a0", "b0"), ("a1", "b1")]
    assert (sync.counts["a"].received, sync.counts["a"].paired, sync.counts["a"].dropped) == (4, 2, 2)
    assert (sync.counts["b"].received, sync.counts["b"].paired, sync.counts["b"].dropped) == (3, 2, 1)


def test_partner_that_comes_after_its_instant_was_answered_is_dropped() -> None:
    at = stream(333, 0)
    sync = synchroniser()
    feed(sync, "a0", "b0", at_ms=at)
    assert feed(sync, "a1", "a2", "a3", at_ms=at) == [("a1", None)]
    assert feed(sync, "b1", "b2", "b3", at_ms=at) == [("a2", "b2"), ("a3", "b3")]
    assert sync.counts["b"].dropped == 1


def test_both_planes_back_is_a_new_run() -> None:
    at = stream(333, 0)
    sync = synchroniser()
    feed(sync, *[name for i in range(6) for name in (f"a{i}", f"b{i}")], at_ms=at)
    assert sync.add("a", round(at["a0"] * MS), "a0") == []
    assert sync.restarting
    pairs = sync.add("b", round(at["b0"] * MS), "b0")
    assert [(p.a, p.b, p.new_run) for p in pairs] == [("a0", "b0", True)]
    assert not sync.restarting
    assert [p.new_run for name in ("a1", "b1") for p in sync.add(name[0], round(at[name] * MS), name)] == [False]  # type: ignore[arg-type]


def test_one_plane_back_alone_is_no_new_run() -> None:
    at = stream(333, 0)
    sync = synchroniser()
    feed(sync, *[name for i in range(6) for name in (f"a{i}", f"b{i}")], at_ms=at)
    assert feed(sync, "a0", "a6", "b6", at_ms=at) == [("a6", "b6")]
    assert sync.counts["a"].dropped == 1


def test_flush_gives_what_is_left() -> None:
    at = stream(267, 133)
    sync = synchroniser()
    assert feed(sync, "a0", "b0", at_ms=at) == []
    assert [(p.a, p.b) for p in sync.flush()] == [("a0", "b0")]
    assert sync.flush() == []


@st.composite
def streams(draw: st.DrawFn) -> tuple[float, int, int, list[tuple[str, int, int]]]:
    """A biplane stream: jitter limit, period, offset, frames (plane, index, stamp) in order of stamps."""
    period = round(1e9 / draw(st.sampled_from([1.0, 2.0, 3.0, 3.75, 7.5, 15.0])))
    offset = draw(st.sampled_from([0, 0, period // 4, period // 2]))
    jitter = 5 * MS
    count = draw(st.integers(2, 25))
    noise = st.integers(-jitter // 4, jitter // 4)
    frames = []
    # Lost frames are single ones: where most are lost, no rule can tell the period.
    losses = draw(st.lists(st.sampled_from(["", "a", "b"]), min_size=count, max_size=count))
    for index in range(count):
        for plane, shift in (("a", 0), ("b", offset)):
            if index % 4 != 3 or losses[index] != plane:
                stamp = 10**12 + index * period + shift + draw(noise)
                frames.append((plane, index, stamp))
    frames.sort(key=lambda frame: frame[2])
    return jitter / 1e9, period, offset, frames


def run(
    jitter_s: float, frames: list[tuple[str, int, int]], offset_s: float = -1.0
) -> list[Pair[tuple[str, int, int]]]:
    sync: PairSynchroniser[tuple[str, int, int]] = PairSynchroniser(PartnerRule.from_seconds(jitter_s, offset_s))
    pairs = [pair for frame in frames for pair in sync.add(frame[0], frame[2], frame)]  # type: ignore[arg-type]
    return pairs + sync.flush()


@given(streams(), st.booleans())
@settings(max_examples=60, deadline=None)
def test_any_stream_pairs_as_it_was_exposed(
    case: tuple[float, int, int, list[tuple[str, int, int]]], known: bool
) -> None:
    jitter_s, _, offset, frames = case
    pairs = run(jitter_s, frames, offset / 1e9 if known else -1.0)
    given_out = [frame for pair in pairs for frame in (pair.a, pair.b) if frame is not None]
    assert len(given_out) == len(set(given_out)) == len(frames), "every frame once"
    stamps = [pair.stamp_ns for pair in pairs]
    assert all(one < two for one, two in pairwise(stamps)), "in order"
    by_index: dict[int, set[str]] = {}
    for plane, index, _ in frames:
        by_index.setdefault(index, set()).add(plane)
    for pair in pairs:
        if pair.a is not None and pair.b is not None:
            assert pair.a[1] == pair.b[1]
            assert abs(pair.b[2] - pair.a[2] - offset) <= 5 * MS
        else:
            frame = pair.a or pair.b
            assert frame is not None
            assert len(by_index[frame[1]]) == 1, "a frame is alone only where its partner was lost"


@given(streams(), st.randoms(use_true_random=False))
@settings(max_examples=60, deadline=None)
def test_overtaking_by_less_than_a_frame_changes_no_pair(
    case: tuple[float, int, int, list[tuple[str, int, int]]], random: object
) -> None:
    jitter_s, period, _, frames = case
    delayed = dict.fromkeys("ab", 0)
    arrivals = []
    for plane, index, stamp in frames:
        # Each topic keeps its order; a frame is up to a period late.
        delayed[plane] = max(delayed[plane], stamp + int(random.random() * period * 0.95))  # type: ignore[attr-defined]
        arrivals.append((delayed[plane], plane, index, stamp))
    shuffled = [(plane, index, stamp) for _, plane, index, stamp in sorted(arrivals, key=lambda entry: entry[0])]
    expected = [(pair.stamp_ns, pair.a, pair.b) for pair in run(jitter_s, frames)]
    assert [(pair.stamp_ns, pair.a, pair.b) for pair in run(jitter_s, shuffled)] == expected


@given(
    st.lists(st.tuples(st.sampled_from("ab"), st.integers(0, 3_000)), max_size=60),
    st.sampled_from([-1.0, 0.0, 0.05]),
)
@settings(max_examples=60, deadline=None)
def test_no_stream_breaks_the_promises(arrivals: list[tuple[str, int]], offset_s: float) -> None:
    sync: PairSynchroniser[int] = PairSynchroniser(PartnerRule.from_seconds(0.005, offset_s))
    last, used = -1, set()
    for number, (plane, stamp_ms) in enumerate(arrivals):
        for pair in sync.add(plane, stamp_ms * MS, number):  # type: ignore[arg-type]
            if pair.new_run:
                last = -(10**12)
            assert pair.stamp_ns > last or last == -1
            last = pair.stamp_ns
            for item in (pair.a, pair.b):
                assert item is None or item not in used
                used.add(item)
    for pair in sync.flush():
        used.update(item for item in (pair.a, pair.b) if item is not None)
    for plane in "ab":
        counts = sync.counts[plane]  # type: ignore[index]
        held = len(sync._queues[plane].backward)  # type: ignore[index]
        assert counts.received == counts.paired + counts.alone + counts.dropped + held
