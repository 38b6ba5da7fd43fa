"""Looks for a ring in a few successive pairs, without clicks."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import partial

import numpy as np
import numpy.typing as npt

from lasso_motion_ros.config.tracker import TrackerConfig
from lasso_motion_ros.core.errors import GeometryError, LassoMotionError
from lasso_motion_ros.geometry.curves import distance_to_curve
from lasso_motion_ros.geometry.frames import PLANES, FramePair
from lasso_motion_ros.initialisation.clicks import clicks_along, places_along
from lasso_motion_ros.initialisation.compensated_mean import compensated_mean, motions_of
from lasso_motion_ros.initialisation.direction_maps import are_catheters_bright, curvature
from lasso_motion_ros.initialisation.judgement import SMALLEST_SUPPORT, judge
from lasso_motion_ros.initialisation.known_rings import FollowedRing, KnownRings
from lasso_motion_ros.initialisation.laid_pair import LaidPair
from lasso_motion_ros.initialisation.proposal import Proposal
from lasso_motion_ros.initialisation.ring_candidates import Candidate, RingQueue
from lasso_motion_ros.initialisation.ring_closeup import RingCloseups
from lasso_motion_ros.initialisation.ring_search import Shown, search_rings
from lasso_motion_ros.ring.seed_curves import build_loop_model
from lasso_motion_ros.ring.tracker import RingTracker


@dataclass(frozen=True)
class _Tuning:
    """How many pairs, when the last is asked, and how far clicks may lead astray."""

    pairs: int = 3  # that have to show a ring
    hope_of_last: float = 0.4  # that the first pair and the mean leave where the last pair is asked, too
    astray_m: float = 0.7e-3  # mean distance of the curve that clicks lead to from the one they were set along


Array = npt.NDArray[np.float64]

TUNING = _Tuning()
PAIRS = TUNING.pairs


@dataclass(frozen=True, eq=False)
class Look:
    """What a look has found.

    Attributes:
        proposed: rings that are believed, best first.
        followed: rings that a next look goes on with, likeliest first.
        tried: all that were followed through the pairs, best first.
        hope: of the likeliest ring, before any was looked at closely.
    """

    proposed: list[Proposal]
    followed: list[FollowedRing]
    tried: list[Proposal] = field(default_factory=list)
    hope: float = -np.inf


class OvertakenError(Exception):
    """Newer pairs are there to be looked at."""


def find_rings(
    pairs: Sequence[FramePair],
    config: TrackerConfig,
    *,
    known: Sequence[FollowedRing] = (),
    other_polarity: bool = False,
    go_on: Callable[[], bool] = lambda: True,
) -> Look:
    """The rings that one of some successive pairs shows and the others do, too; best first.

    They are looked for in the first; where nothing there is believed and something is hopeful, in the last.

    Args:
        pairs: successive pairs, both planes each.
        config: the tracker's parameters.
        known: rings that earlier looks have followed; their trackers go on.
        other_polarity: with `polarity: auto`, look for the one that is less likely where that is in doubt.
        go_on: asked between the steps.

    Returns:
        The rings that are believed, none where the planes cannot show any; and what a next look goes on with.

    Raises:
        OvertakenError: `go_on` has said no.
    """
    if len(pairs[0].frames) < len(PLANES):
        return Look([], [])
    try:
        laid = _laid_out(pairs, config.polarity, other_polarity, partial(_check, go_on))
    except GeometryError:
        return Look([], [])
    decided = replace(config, polarity="bright" if laid[0].bright else "dark")
    _check(go_on)
    look = _look(pairs, laid, decided, known, go_on)
    if look.proposed or look.hope < TUNING.hope_of_last:
        return look
    # What the first pair shows badly, the last may show well; then the mean of all shows some of it. What came near
    # being a ring in the first counts as its rival there: if that was the ring itself, a breath away, it is proposed
    # and not started with.
    back = _look(_backwards(pairs), laid[::-1], decided, (), go_on, look.tried)
    return Look(back.proposed, look.followed)


def _look(
    pairs: Sequence[FramePair],
    laid: Sequence[LaidPair],
    config: TrackerConfig,
    known: Sequence[FollowedRing],
    go_on: Callable[[], bool],
    beside: Sequence[Proposal] = (),
) -> Look:
    """The same as the first of some pairs has it; they are laid out, and the polarity is decided.

    Rings that were tried besides may be rivals, too.
    """
    motions = motions_of(laid)
    _check(go_on)
    mean = compensated_mean(laid, motions)
    _check(go_on)
    shown = [Shown.by(mean), Shown.by(laid[0])]
    found = search_rings(laid, shown, check=partial(_check, go_on))
    seen_before = KnownRings(known, pairs[0])
    outcomes: list[tuple[Proposal, FollowedRing]] = []
    believed: list[tuple[Proposal, Proposal | None]] = []  # each, and as its clicks have it

    def is_taken(centre: Array) -> bool:
        """Whether a ring is believed there: what else lies in its place is that ring, or a part of it."""
        return any(clicked is not None and ring.is_at(centre) for ring, clicked in believed)

    queue = RingQueue(found, RingCloseups(laid, motions), shown, seen_before)
    for one in queue.likeliest_first(is_taken, check=partial(_check, go_on)):
        if (outcome := _followed(one, pairs, config, go_on)) is None:
            continue
        outcomes.append(outcome)
        ring, following = outcome
        if ring.judgement.is_ring:
            _check(go_on)
            believed.append((ring, _clicked(ring, following.catheter.text, config)))
    outcomes.sort(key=lambda one: -one[0].judgement.evidence)
    proposed = _compatible(believed)
    tried = [ring for ring, _ in outcomes]
    rivals = [*tried, *beside]
    with_rivals = [replace(ring, rivals=_count_rivals(ring, rivals)) for ring in proposed]
    return Look(with_rivals, seen_before.remembered([following for _, following in outcomes]), tried, queue.hope)


def _compatible(believed: Sequence[tuple[Proposal, Proposal | None]]) -> list[Proposal]:
    """The rings that can be beside each other, best first, of those that are believed and as clicks have them."""
    proposed: list[Proposal] = []
    astray: list[Proposal] = []
    for ring, clicked in sorted(believed, key=lambda one: -one[0].judgement.evidence):
        # Beside a ring whose clicks lead astray its own parts are none, but another curve of it may be.
        is_another = all(ring.can_be_beside(other) or ring.is_of(other) for other in astray)
        if is_another and all(ring.can_be_beside(other) for other in proposed):
            if clicked is None:
                astray.append(ring)
            else:
                proposed.append(clicked)
    return proposed


def _backwards(pairs: Sequence[FramePair]) -> list[FramePair]:
    """The pairs from the last one on, as if time went on: a ring that goes back moves as one that goes on.

    Where plane B is exposed late it is still late then, and the ring goes the other way meanwhile: the planes seem to
    lie apart by twice that.
    """
    last_ns = pairs[-1].stamp_ns
    return [_later(_unheard(pair), 2 * (last_ns - pair.stamp_ns)) for pair in reversed(pairs)]


def _unheard(pair: FramePair) -> FramePair:
    """A pair without R peaks, itself where it has none: hearts do not beat backwards."""
    return replace(pair, r_peaks_ns=()) if pair.r_peaks_ns else pair


def _later(pair: FramePair, by_ns: int) -> FramePair:
    """A pair with later stamps; itself where they are not."""
    if not by_ns:
        return pair
    a, b = (replace(frame, stamp_ns=frame.stamp_ns + by_ns) for frame in pair.frames.values())
    return FramePair(pair.stamp_ns + by_ns, a, b)


def _count_rivals(ring: Proposal, tried: Sequence[Proposal]) -> int:
    others: list[Proposal] = []
    for one in tried:
        if one.judgement.is_rival and not any(one.is_at(other.centre) for other in [ring, *others]):
            others.append(one)
    return len(others)


def _followed(
    one: Candidate,
    pairs: Sequence[FramePair],
    config: TrackerConfig,
    go_on: Callable[[], bool],
) -> tuple[Proposal, FollowedRing] | None:
    """What a ring leads to, once it has been followed through the pairs; None where there is no ring."""
    first = pairs[0]
    tracker = RingTracker(config)
    supports = []
    try:
        track = tracker.begin(one.pair, one.model, one.whole, least_support=SMALLEST_SUPPORT)
        ring = FollowedRing(tracker, track, first.stamp_ns)
        for pair in pairs[1:]:
            _check(go_on)
            supports.append(ring.follow(pair))
        tracker.learn()  # from the last pair, too: no other one comes
    except (LassoMotionError, ValueError, np.linalg.LinAlgError):
        return None
    _check(go_on)
    if min(supports) < SMALLEST_SUPPORT:  # a ring is there in every pair
        return None
    judgement = judge(
        ring.catheter,
        places_along(track.model, one.images),
        np.asarray(track.template.weights, dtype=np.float64),
        roundness=track.model.roundness,
        support=float(np.mean(supports)),
        worth=one.worth,
        rareness=one.rareness,
        line_beyond=one.line_beyond,
        comb=one.comb.score,
        distinct=one.distinct,
        before=one.added,
    )
    ring.looks = (*(() if one.before is None else one.before.looks), (pairs[-1].stamp_ns, judgement.evidence))
    projections = {plane: frame.projection for plane, frame in first.frames.items()}
    return Proposal(first, clicks_along(track.model, projections), track.model.points, judgement, 0, ""), ring


def _clicked(ring: Proposal, text: str, config: TrackerConfig) -> Proposal | None:
    """The ring with the curve that the tracker makes of its clicks, in words; None where they lead astray."""
    try:
        points = build_loop_model(ring.pair, ring.seed, config).points
    except (LassoMotionError, ValueError, np.linalg.LinAlgError):
        return None
    away = max(float(distance_to_curve(*ways).mean()) for ways in ((points, ring.points), (ring.points, points)))
    return replace(ring, points=points, text=text) if away < TUNING.astray_m else None


def _laid_out(pairs: Sequence[FramePair], polarity: str, other: bool, check: Callable[[], None]) -> list[LaidPair]:
    """The pairs laid out, as the first shows catheters: where they are dark, the grey values' logarithm."""
    first = LaidPair.of(pairs[0], bright=polarity != "dark")
    if polarity == "auto" and not are_catheters_bright(map(curvature, first.laid.values()), other=other):
        first = LaidPair.of(pairs[0], bright=False)
    laid = [first]
    for pair in pairs[1:]:
        check()
        laid.append(LaidPair.of(pair, bright=first.bright))
    return laid


def _check(go_on: Callable[[], bool]) -> None:
    if not go_on():
        raise OvertakenError
