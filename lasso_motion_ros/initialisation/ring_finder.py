"""Looks for a ring in a few successive pairs, without clicks."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
import numpy.typing as npt

from lasso_motion_ros.config.tracker import TrackerConfig
from lasso_motion_ros.core.errors import GeometryError, LassoMotionError
from lasso_motion_ros.geometry.curves import distance_to_curve
from lasso_motion_ros.geometry.frames import PLANES, Frame, FramePair, Plane, Seed
from lasso_motion_ros.initialisation.circle_fit import find_circles
from lasso_motion_ros.initialisation.circles import Circles
from lasso_motion_ros.initialisation.clicks import clicks_along, model_of, places_along
from lasso_motion_ros.initialisation.direction_maps import (
    Curvature,
    DirectionMaps,
    are_catheters_bright,
    curvature,
    direction_maps,
    row_range,
)
from lasso_motion_ros.initialisation.epipolar_grid import EpipolarGrid
from lasso_motion_ros.initialisation.judgement import Glance, Judgement, has_ring_size, is_shown_at_first, judge
from lasso_motion_ros.ring.loop_model import LoopModel, build_loop_model
from lasso_motion_ros.ring.seed_images import SeedImages
from lasso_motion_ros.ring.tracker import RingTracker

Array = npt.NDArray[np.float64]


@dataclass(frozen=True)
class _Tuning:
    """How many circles are followed."""

    pairs: int = 3  # that have to show a ring
    glanced: int = 20  # circles of a look beside which a ring's model is made
    tried: int = 6  # of those, that are followed
    agreement_share: float = 0.5  # of the planes' agreement in a circle's worth
    smallest_score: float = 0.5
    rival_share: float = 0.5  # of the worth of the circle that led to a ring; with less another leads to no rival
    smallest_field_m: float = 0.02  # that both planes have in common
    same_m: float = 8e-3  # rings whose centres are closer share much of what they rest on: only the better is one
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

    def can_be_beside(self, other: Proposal) -> bool:
        """Whether it may be a ring as well as another: elsewhere, and no plane shows both in the same place.

        One ring's outline in one plane and another ring's in the other make a third, where there is none.
        """
        return not self.is_at(other.centre) and not any(
            frame.projection.millimetres_per_pixel(self.centre)
            * _outlines_apart(self.seed.points(plane), other.seed.points(plane))
            < TUNING.same_outline_mm
            for plane, frame in self.pair.frames.items()
        )


class OvertakenError(Exception):
    """Newer pairs are there to be looked at."""


def find_rings(
    pairs: Sequence[FramePair],
    config: TrackerConfig,
    *,
    other_polarity: bool = False,
    go_on: Callable[[], bool] = lambda: True,
) -> list[Proposal]:
    """The rings that the first of some successive pairs shows and the others do, too; best first.

    Args:
        pairs: successive pairs, both planes each.
        config: the tracker's parameters.
        other_polarity: with `polarity: auto`, look for the one that is less likely where that is in doubt.
        go_on: asked between the steps.

    Returns:
        The rings that are believed; none where the planes cannot show any.

    Raises:
        OvertakenError: `go_on` has said no.
    """
    frames = pairs[0].frames
    if len(frames) < len(PLANES):
        return []
    try:
        grid = EpipolarGrid.of({plane: frame.projection for plane, frame in frames.items()})
    except GeometryError:
        return []
    rows = row_range(frames, grid)
    if rows[1] - rows[0] < TUNING.smallest_field_m:
        return []
    bright, maps = _maps(frames, grid, rows, config.polarity, other_polarity)
    _check(go_on)
    between_s = 1e-9 * (frames["b"].stamp_ns - frames["a"].stamp_ns)
    circles = find_circles(maps, grid, between_s, partial(_check, go_on))
    decided = replace(config, polarity="bright" if bright else "dark")
    images = SeedImages(pairs[0], bright=bright, line_sigma_mm=config.path.line_sigma_mm)
    tried: list[Proposal] = []
    believed = 0.0  # worth of the best circle that has led to a ring
    for one in _worth_following(circles, images, grid, go_on)[: TUNING.tried]:
        if one.worth < TUNING.rival_share * believed:
            break
        _check(go_on)
        ring = _followed(one, images, pairs, decided, go_on)
        if ring is not None:
            tried.append(ring)
            if ring.judgement.is_ring:
                believed = max(believed, one.worth)
    tried.sort(key=lambda one: -one.judgement.evidence)
    found: list[Proposal] = []
    for ring in tried:
        if ring.judgement.is_ring and all(ring.can_be_beside(other) for other in found):
            _check(go_on)
            if (clicked := _clicked(ring, decided)) is not None:
                found.append(clicked)
    return [replace(ring, rivals=_count_rivals(ring, tried)) for ring in found]


def _count_rivals(ring: Proposal, tried: Sequence[Proposal]) -> int:
    others: list[Proposal] = []
    for one in tried:
        if one.judgement.is_rival and not any(one.is_at(other.centre) for other in [ring, *others]):
            others.append(one)
    return len(others)


@dataclass(frozen=True, eq=False)
class _Candidate:
    """A ring along the lines beside a circle.

    Attributes:
        model: the ring.
        worth: what speaks for it: lines all along the circle, and the same electrodes in both planes.
    """

    model: LoopModel
    worth: float


def _worth_following(
    circles: Circles, images: SeedImages, grid: EpipolarGrid, go_on: Callable[[], bool]
) -> list[_Candidate]:
    """The best circles beside which both planes show something of a ring, best first."""
    candidates = []
    for k in range(min(TUNING.glanced, len(circles))):
        if circles.scores[k] < TUNING.smallest_score:
            break
        _check(go_on)
        try:
            model = model_of(circles[k : k + 1], images, grid)
        except (LassoMotionError, ValueError, np.linalg.LinAlgError):
            continue
        seen = images.working(model.centre, {p: model.shift(p, images.projections[p]) for p in PLANES})
        along = {p: image.projection.project(model.points) for p, image in seen.items()}
        glance = Glance.at({p: image.evidence_at(along[p]) for p, image in seen.items()}, places_along(model, images))
        if glance.is_worth_following and has_ring_size(model.diameter_mm):
            worth = float(circles.scores[k]) + TUNING.agreement_share * glance.agreement
            candidates.append(_Candidate(model, worth))
    return sorted(candidates, key=lambda one: -one.worth)


def _followed(
    one: _Candidate, images: SeedImages, pairs: Sequence[FramePair], config: TrackerConfig, go_on: Callable[[], bool]
) -> Proposal | None:
    """What a ring leads to, once it has been followed through the pairs; None where there is no ring."""
    first = pairs[0]
    tracker = RingTracker(config)
    supports = []
    try:
        track = tracker.begin(first, one.model)
        if not is_shown_at_first(track.seed_support):
            return None
        for pair in pairs[1:]:
            _check(go_on)
            tracker.track(pair)
            if not track.is_followed:
                return None
            supports.append(track.last_support)
    except (LassoMotionError, ValueError, np.linalg.LinAlgError):
        return None
    _check(go_on)
    evidence = replace(track.electrodes, shown=track.template.shown)
    judgement = judge(
        evidence,
        places_along(track.model, images),
        np.asarray(track.template.weights, dtype=np.float64),
        roundness=track.model.roundness,
        support=float(np.mean(supports)),
        worth=one.worth,
    )
    text = "" if judgement.missing else evidence.text
    return Proposal(first, clicks_along(track.model, images), track.model.points, judgement, 0, text)


def _clicked(ring: Proposal, config: TrackerConfig) -> Proposal | None:
    """The ring with the curve that the tracker makes of its clicks; None where they lead astray."""
    try:
        points = build_loop_model(ring.pair, ring.seed, config).points
    except (LassoMotionError, ValueError, np.linalg.LinAlgError):
        return None
    away = max(float(distance_to_curve(*ways).mean()) for ways in ((points, ring.points), (ring.points, points)))
    return replace(ring, points=points) if away < TUNING.astray_m else None


def _maps(
    frames: Mapping[Plane, Frame], grid: EpipolarGrid, rows: tuple[float, float], polarity: str, other: bool
) -> tuple[bool, dict[Plane, DirectionMaps]]:
    """Whether the catheters are bright, and the planes' maps."""

    def seen(*, logarithm: bool) -> dict[Plane, Curvature]:
        return {plane: curvature(frame, plane, grid, rows, logarithm=logarithm) for plane, frame in frames.items()}

    if polarity != "auto":
        bright = polarity == "bright"
        shown = seen(logarithm=not bright)
    else:
        shown = seen(logarithm=False)
        bright = are_catheters_bright(shown.values(), other=other)
        if not bright:
            shown = seen(logarithm=True)
    return bright, {plane: direction_maps(one, bright=bright) for plane, one in shown.items()}


def _outlines_apart(one: Array, other: Array) -> float:
    """Mean distance of two closed curves' points (N, 2), (M, 2), of whichever lies farther from the other."""
    ways = ((one, other), (other, one))
    return max(float(distance_to_curve(points, np.vstack([curve, curve[:1]])).mean()) for points, curve in ways)


def _check(go_on: Callable[[], bool]) -> None:
    if not go_on():
        raise OvertakenError
