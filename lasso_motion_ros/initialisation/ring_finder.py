"""Looks for a ring in a few successive pairs, without clicks."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial

import numpy as np
import numpy.typing as npt

from lasso_motion_ros.config.tracker import TrackerConfig
from lasso_motion_ros.core.errors import GeometryError, LassoMotionError
from lasso_motion_ros.geometry.curves import distance_to_curve
from lasso_motion_ros.geometry.frames import PLANES, FramePair, Plane, Seed
from lasso_motion_ros.initialisation.circle_fit import line_beyond, scored
from lasso_motion_ros.initialisation.clicks import clicks_along, model_of, places_along
from lasso_motion_ros.initialisation.compensated_mean import compensated_mean, motions_of
from lasso_motion_ros.initialisation.direction_maps import (
    are_catheters_bright,
    curvature,
)
from lasso_motion_ros.initialisation.distinctness import CurveElsewhere, Distinctness
from lasso_motion_ros.initialisation.epipolar_grid import EpipolarGrid
from lasso_motion_ros.initialisation.judgement import (
    MOST_DISTINCT,
    SMALLEST_SUPPORT,
    Glance,
    Judgement,
    Known,
    at_best,
    at_most,
    has_ring_size,
    is_hopeful,
    judge,
)
from lasso_motion_ros.initialisation.known_rings import FollowedRing, KnownRings
from lasso_motion_ros.initialisation.laid_pair import LaidPair
from lasso_motion_ros.initialisation.ring_closeup import RingCloseups
from lasso_motion_ros.initialisation.ring_search import FoundRings, Shown, search_rings
from lasso_motion_ros.initialisation.shaped_rings import ShapedRings
from lasso_motion_ros.ring.electrodes import Comb, likeliest_comb
from lasso_motion_ros.ring.loop_model import LoopModel
from lasso_motion_ros.ring.seed_curves import build_loop_model
from lasso_motion_ros.ring.seed_images import SeedImages
from lasso_motion_ros.ring.tracker import RingTracker
from lasso_motion_ros.ring.working_image import Image, WholeImages

Array = npt.NDArray[np.float64]


@dataclass(frozen=True)
class _Tuning:
    """Which rings are the same, and which are tried."""

    pairs: int = 3  # that have to show a ring
    agreement_share: float = 0.5  # of the planes' agreement in a ring's worth
    lined: int = 3  # circles along lines that are followed beside the rings that electrodes tell of
    same_curve_m: float = 0.5e-3  # mean distance of two curves along the same lines
    same_m: float = 8e-3  # rings whose centres are closer share much of what they rest on: only the better is one
    touching_m: float = 2e-3  # two curves where they are no farther apart,
    largest_touching_share: float = 0.25  # and how much of one does so at most
    same_ring_m: float = 1.5e-3  # curves of one ring have their centres within
    same_outline_mm: float = 1.0  # mean distance of two rings' clicks in a plane, below which it shows one outline
    astray_m: float = 0.7e-3  # mean distance of the curve that clicks lead to from the one they were set along


TUNING = _Tuning()
PAIRS = TUNING.pairs
SAME_M = TUNING.same_m


@dataclass(frozen=True, eq=False)
class Proposal:
    """A ring that is proposed.

    Attributes:
        pair: the first pair that showed it.
        seed: clicks along it there.
        points: (L, 3) its curve there, world metres.
        judgement: what speaks for it.
        rivals: other rings that fit nearly as well.
        text: what is known of the catheter, for people.
    """

    pair: FramePair
    seed: Seed
    points: Array
    judgement: Judgement
    rivals: int
    text: str

    @property
    def centre(self) -> Array:
        """(3,) middle of the curve, world metres."""
        return np.asarray(self.points.mean(axis=0))

    def is_at(self, centre: Array) -> bool:
        """Whether the ring at a centre (3,) m is about the same."""
        return float(np.linalg.norm(self.centre - centre)) < TUNING.same_m

    def is_of(self, other: Proposal) -> bool:
        """Whether another's curve is that of the same ring."""
        return float(np.linalg.norm(self.centre - other.centre)) < TUNING.same_ring_m

    def can_be_beside(self, other: Proposal) -> bool:
        """Whether it may be a ring as well as another: elsewhere, and no plane shows both in the same place.

        One ring's outline in one plane and another ring's in the other make a third, where there is none; and so do an
        arc of a ring and what lies beside it.
        """
        if self.is_at(other.centre) or self._shares_an_arc_with(other):
            return False
        return not any(
            frame.projection.millimetres_per_pixel(self.centre)
            * _outlines_apart(self.seed.points(plane), other.seed.points(plane))
            < TUNING.same_outline_mm
            for plane, frame in self.pair.frames.items()
        )

    def _shares_an_arc_with(self, other: Proposal) -> bool:
        """Whether more of their curves lies together than where two rings touch."""
        ways = ((self.points, other.points), (other.points, self.points))
        shares = (float((distance_to_curve(*way) < TUNING.touching_m).mean()) for way in ways)
        return max(shares) > TUNING.largest_touching_share


@dataclass(frozen=True, eq=False)
class Look:
    """What a look has found.

    Attributes:
        proposed: rings that are believed, best first.
        followed: rings that a next look goes on with, likeliest first.
    """

    proposed: list[Proposal]
    followed: list[FollowedRing]


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
    """The rings that the first of some successive pairs shows and the others do, too; best first.

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
    motions = motions_of(laid)
    _check(go_on)
    mean = compensated_mean(laid, motions)
    _check(go_on)
    decided = replace(config, polarity="bright" if mean.bright else "dark")
    closeups = RingCloseups(laid, motions)
    shown = [Shown.by(mean), Shown.by(laid[0])]
    found = search_rings(laid, shown, check=partial(_check, go_on))
    chosen = _worth_following(*found, closeups, shown, decided, go_on)
    seen_before = KnownRings(known, pairs[0])
    tried: list[Proposal] = []
    followed: list[FollowedRing] = []
    for one in chosen:
        _check(go_on)
        if (outcome := _followed(one, pairs, seen_before, decided, go_on)) is not None:
            tried.append(outcome[0])
            followed.append(outcome[1])
    tried.sort(key=lambda one: -one.judgement.evidence)
    proposed: list[Proposal] = []
    astray: list[Proposal] = []
    for ring in tried:
        # Beside a ring whose clicks lead astray its own parts are none, but another curve of it may be.
        is_another = all(ring.can_be_beside(other) or ring.is_of(other) for other in astray)
        if ring.judgement.is_ring and is_another and all(ring.can_be_beside(other) for other in proposed):
            _check(go_on)
            clicked = _clicked(ring, decided)
            if clicked is None:
                astray.append(ring)
            else:
                proposed.append(clicked)
    return Look(
        [replace(ring, rivals=_count_rivals(ring, tried)) for ring in proposed], seen_before.remembered(followed)
    )


def _count_rivals(ring: Proposal, tried: Sequence[Proposal]) -> int:
    others: list[Proposal] = []
    for one in tried:
        if one.judgement.is_rival and not any(one.is_at(other.centre) for other in [ring, *others]):
            others.append(one)
    return len(others)


@dataclass(frozen=True, eq=False)
class _Candidate:
    """A ring along the lines beside one that was found.

    Attributes:
        model: the ring.
        images: of the close-up along whose lines it lies.
        whole: likewise.
        pair: the close-up.
        worth: lines all along the ring, and the same electrodes in both planes.
        rareness: see `Judgement`.
        line_beyond: likewise.
        shown: per plane, (L,) evidence along the ring in the close-up.
        elsewhere: its curve, laid all about its place there.
    """

    model: LoopModel
    images: SeedImages
    whole: WholeImages
    pair: FramePair
    worth: float
    rareness: float
    line_beyond: float
    shown: Mapping[Plane, Image]
    elsewhere: CurveElsewhere

    def is_as(self, other: _Candidate) -> bool:
        """Whether it follows the same lines."""
        one, another = self.model.points, other.model.points
        return float(distance_to_curve(one, another).mean()) < TUNING.same_curve_m

    @cached_property
    def comb(self) -> Comb:
        """The likeliest poles along it, of a catheter of any kind."""
        return likeliest_comb(self.model.points, self.shown)

    @cached_property
    def distinct(self) -> Distinctness:
        """How far it stands out."""
        return self.elsewhere.with_poles(self.model.points, self.comb.places_mm)

    @property
    def is_hopeful(self) -> bool:
        """Whether it may be believed once it is followed; its poles, which take time, are looked for at last."""
        without_poles = self._at_best(np.inf, replace(MOST_DISTINCT, curve=self.elsewhere.curve))
        return is_hopeful(without_poles, Known.CURVE) and is_hopeful(self.at_best, Known.POLES)

    @cached_property
    def at_best(self) -> Judgement:
        """What it can be once it is followed."""
        return self._at_best(self.comb.score, self.distinct)

    def _at_best(self, comb: float, distinct: Distinctness) -> Judgement:
        return at_best(
            roundness=self.model.roundness,
            diameter_mm=self.model.diameter_mm,
            worth=self.worth,
            rareness=self.rareness,
            line_beyond=self.line_beyond,
            comb=comb,
            distinct=distinct,
        )


def _worth_following(
    told: FoundRings,
    lined: FoundRings,
    closeups: RingCloseups,
    shown: Sequence[Shown],
    config: TrackerConfig,
    go_on: Callable[[], bool],
) -> list[_Candidate]:
    """The rings beside which both planes show something of one: by their electrodes, and the best by their lines."""
    chosen: list[_Candidate] = []
    grid = shown[0].pair.grid
    for found, most in ((told, len(told)), (lined, TUNING.lined)):
        circles = found.rings.circles(np.zeros(len(found)))
        scores = np.max([scored(circles, one.maps, grid).scores for one in shown], axis=0)
        beyond = np.max([line_beyond(circles, one.maps, grid) for one in shown], axis=0)
        candidates = []
        for k in range(len(found)):
            _check(go_on)
            lines, rareness, line = float(scores[k]), float(found.rareness[k]), float(beyond[k])
            most_worth = lines + TUNING.agreement_share
            most_likely = at_most(worth=most_worth, rareness=rareness, line_beyond=line)
            if not is_hopeful(most_likely, Known.CIRCLE):
                continue
            ring = found.rings[k : k + 1]
            pair = closeups.of(ring, [by[k] for by in found.moved])
            whole = WholeImages(pair.frames)
            images = SeedImages(pair, bright=config.polarity == "bright", whole=whole)
            seen = _seen_along(ring, images, grid)
            if seen is None:
                continue
            model, agreement, evidence, elsewhere = seen
            worth = lines + TUNING.agreement_share * agreement
            candidate = _Candidate(model, images, whole, pair, worth, rareness, line, evidence, elsewhere)
            if not any(candidate.is_as(other) for other in chosen) and candidate.is_hopeful:
                candidates.append(candidate)
        candidates.sort(key=lambda one: -one.at_best.evidence)
        chosen += candidates[:most]
    return chosen


def _seen_along(
    ring: ShapedRings, images: SeedImages, grid: EpipolarGrid
) -> tuple[LoopModel, float, dict[Plane, Image], CurveElsewhere] | None:
    """The model along one ring, the planes' agreement, what each shows, there and elsewhere.

    None where both do not show something of a ring there.
    """
    try:
        model = model_of(ring, images, grid)
    except (LassoMotionError, ValueError, np.linalg.LinAlgError):
        return None
    seen = images.working(model.centre, {p: model.shift(p, images.projections[p]) for p in PLANES})
    along = {p: image.projection.project(model.points) for p, image in seen.items()}
    shown = {p: image.evidence_at(along[p]) for p, image in seen.items()}
    glance = Glance.at(shown, places_along(model, images))
    if not (glance.is_worth_following and has_ring_size(model.diameter_mm)):
        return None
    return model, glance.agreement, shown, CurveElsewhere(seen, along)


def _followed(
    one: _Candidate,
    pairs: Sequence[FramePair],
    known: KnownRings,
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
            if not ring.follow(pair):
                return None
            supports.append(track.last_support)
        tracker.learn()  # from the last pair, too: no other one comes
    except (LassoMotionError, ValueError, np.linalg.LinAlgError):
        return None
    _check(go_on)
    evidence = replace(track.electrodes, shown=track.template.shown)
    before = known.of(track.model.points)
    judgement = judge(
        evidence,
        places_along(track.model, one.images),
        np.asarray(track.template.weights, dtype=np.float64),
        roundness=track.model.roundness,
        support=float(np.mean(supports)),
        worth=one.worth,
        rareness=one.rareness,
        line_beyond=one.line_beyond,
        comb=one.comb.score,
        distinct=one.distinct,
        before=0.0 if before is None else before.adds(first.stamp_ns),
    )
    ring.looks = (*(() if before is None else before.looks), (pairs[-1].stamp_ns, judgement.evidence))
    text = evidence.text if judgement.is_ring else ""
    projections = {plane: frame.projection for plane, frame in first.frames.items()}
    return Proposal(first, clicks_along(track.model, projections), track.model.points, judgement, 0, text), ring


def _clicked(ring: Proposal, config: TrackerConfig) -> Proposal | None:
    """The ring with the curve that the tracker makes of its clicks; None where they lead astray."""
    try:
        points = build_loop_model(ring.pair, ring.seed, config).points
    except (LassoMotionError, ValueError, np.linalg.LinAlgError):
        return None
    away = max(float(distance_to_curve(*ways).mean()) for ways in ((points, ring.points), (ring.points, points)))
    return replace(ring, points=points) if away < TUNING.astray_m else None


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


def _outlines_apart(one: Array, other: Array) -> float:
    """Mean distance of two closed curves' points (N, 2), (M, 2), of whichever lies farther from the other."""
    ways = ((one, other), (other, one))
    return max(float(distance_to_curve(points, np.vstack([curve, curve[:1]])).mean()) for points, curve in ways)


def _check(go_on: Callable[[], bool]) -> None:
    if not go_on():
        raise OvertakenError
