"""Looks for a ring in a few successive pairs, without clicks."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from lasso_motion_ros.config.tracker import TrackerConfig
from lasso_motion_ros.core.errors import GeometryError, LassoMotionError
from lasso_motion_ros.geometry.frames import PLANES, Frame, FramePair, Plane, Seed
from lasso_motion_ros.initialisation.circle_fit import find_circles
from lasso_motion_ros.initialisation.circles import Circles
from lasso_motion_ros.initialisation.clicks import Outline, outline_of
from lasso_motion_ros.initialisation.epipolar_grid import EpipolarGrid
from lasso_motion_ros.initialisation.judgement import Glance, Judgement, judge
from lasso_motion_ros.initialisation.line_maps import LineMaps, curvature, line_maps, row_range
from lasso_motion_ros.ring.tracker import RingTracker
from lasso_motion_ros.ring.working_image import WorkingImage, working_image

Array = npt.NDArray[np.float64]


@dataclass(frozen=True)
class _Tuning:
    """How many circles are followed."""

    pairs: int = 3  # that have to show a ring
    glanced: int = 20  # circles of a look that are drawn along the lines beside them
    tried: int = 4  # of those, whose model is built and followed
    agreement_share: float = 0.5  # of the planes' agreement in a circle's worth
    smallest_score: float = 0.5
    rival_share: float = 0.75  # of the worth of the circle that led to a ring; with less another leads to no rival
    smallest_field_m: float = 0.02  # that both planes have in common
    same_m: float = 4e-3  # rings whose centres are closer are one


TUNING = _Tuning()
PAIRS = TUNING.pairs


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
        other_polarity: with `polarity: auto`, look for the one that is less likely.
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
    circles = find_circles(maps, grid, between_s)
    decided = replace(config, polarity="bright" if bright else "dark")
    images = {
        plane: working_image(frame, grid.centre, bright=bright, shift=np.zeros(2)) for plane, frame in frames.items()
    }
    tried: list[Proposal] = []
    believed = 0.0  # worth of the best circle that has led to a ring
    for one in _worth_following(circles, frames, images, grid, decided, go_on)[: TUNING.tried]:
        if one.worth < TUNING.rival_share * believed:
            break
        _check(go_on)
        ring = _followed(one.outline.seed(frames), pairs, decided, go_on)
        if ring is not None:
            tried.append(ring)
            if ring.judgement.is_ring:
                believed = max(believed, one.worth)
    tried.sort(key=lambda one: -one.judgement.comb)
    found: list[Proposal] = []
    for ring in tried:
        if ring.judgement.is_ring and not any(_are_same(ring, other) for other in found):
            found.append(ring)
    return [replace(ring, rivals=_count_rivals(ring, tried)) for ring in found]


def _count_rivals(ring: Proposal, tried: Sequence[Proposal]) -> int:
    others: list[Proposal] = []
    for one in tried:
        if one.judgement.is_rival_of(ring.judgement) and not any(_are_same(one, other) for other in [ring, *others]):
            others.append(one)
    return len(others)


@dataclass(frozen=True, eq=False)
class _Candidate:
    """A circle drawn along the lines beside it.

    Attributes:
        outline: the lines.
        worth: what speaks for it: lines all along the circle, and the same electrodes in both planes.
    """

    outline: Outline
    worth: float


def _worth_following(
    circles: Circles,
    frames: dict[Plane, Frame],
    images: Mapping[Plane, WorkingImage],
    grid: EpipolarGrid,
    config: TrackerConfig,
    go_on: Callable[[], bool],
) -> list[_Candidate]:
    """The best circles beside which both planes show something of a ring, best first."""
    bright, sigma_mm = config.polarity == "bright", config.path.line_sigma_mm
    candidates = []
    for k in range(min(TUNING.glanced, len(circles))):
        if circles.scores[k] < TUNING.smallest_score:
            break
        _check(go_on)
        try:
            outline = outline_of(circles[k : k + 1], frames, grid, bright=bright, line_sigma_mm=sigma_mm)
        except (LassoMotionError, ValueError, np.linalg.LinAlgError):
            continue
        shown = {plane: image.evidence_at(outline.pixels(plane, image.projection)) for plane, image in images.items()}
        glance = Glance.at(shown)
        if glance.is_worth_following:
            worth = float(circles.scores[k]) + TUNING.agreement_share * glance.agreement
            candidates.append(_Candidate(outline, worth))
    return sorted(candidates, key=lambda one: -one.worth)


def _followed(
    seed: Seed, pairs: Sequence[FramePair], config: TrackerConfig, go_on: Callable[[], bool]
) -> Proposal | None:
    """What clicks lead to, once their model has been followed through the pairs; None where there is no ring."""
    first = pairs[0]
    tracker = RingTracker(config)
    try:
        tracker.initialise(first, seed)
        followed = True
        for pair in pairs[1:]:
            _check(go_on)
            result = tracker.track(pair)
            followed = followed and result.motion is not None
    except (LassoMotionError, ValueError, np.linalg.LinAlgError):
        return None
    track = tracker.known
    if track is None:
        return None
    evidence = replace(track.electrodes, shown=track.template.shown)
    judgement = judge(
        evidence,
        np.asarray(track.template.weights, dtype=np.float64),
        roundness=track.model.roundness,
        support=track.usual_support,
        followed=followed,
    )
    return Proposal(first, seed, track.model.points, judgement, 0, evidence.text)


def _maps(
    frames: Mapping[Plane, Frame], grid: EpipolarGrid, rows: tuple[float, float], polarity: str, other: bool
) -> tuple[bool, dict[Plane, LineMaps]]:
    """Whether the catheters are bright, and the planes' maps; electrodes stand out more than anything opposite."""
    seen = {plane: curvature(frame, plane, grid, rows) for plane, frame in frames.items()}
    if polarity == "auto":
        dark, bright = (sum(one.strength(bright=is_it) for one in seen.values()) for is_it in (False, True))
        is_bright = (bright > dark) is not other
    else:
        is_bright = polarity == "bright"
    return is_bright, {plane: line_maps(one, bright=is_bright) for plane, one in seen.items()}


def _are_same(one: Proposal, other: Proposal) -> bool:
    return float(np.linalg.norm(one.centre - other.centre)) < TUNING.same_m


def _check(go_on: Callable[[], bool]) -> None:
    if not go_on():
        raise OvertakenError
