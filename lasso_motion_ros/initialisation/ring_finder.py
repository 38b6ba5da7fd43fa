"""Looks for a ring in a few successive pairs, without clicks."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from lasso_motion_ros.config.tracker import TrackerConfig
from lasso_motion_ros.core.errors import GeometryError, LassoMotionError
from lasso_motion_ros.geometry.frames import PLANES, Frame, FramePair, Plane, Seed
from lasso_motion_ros.initialisation.circles import Circles, find_circles
from lasso_motion_ros.initialisation.clicks import clicks_on
from lasso_motion_ros.initialisation.epipolar_grid import EpipolarGrid
from lasso_motion_ros.initialisation.judgement import Judgement, judge
from lasso_motion_ros.initialisation.line_maps import LineMaps, curvature, line_maps, row_range
from lasso_motion_ros.ring.tracker import RingTracker

Array = npt.NDArray[np.float64]


@dataclass(frozen=True)
class _Tuning:
    """How many circles are followed."""

    pairs: int = 3  # that have to show a ring
    tried: int = 6  # circles of a look whose curve is built and followed
    smallest_score: float = 0.8
    rival_score: float = 0.75  # of the circle that led to a ring; with less another leads to no rival
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
    tried: list[Proposal] = []
    believed = 0.0  # score of the best circle that has led to a ring
    for k in range(min(TUNING.tried, len(circles))):
        if circles.scores[k] < max(TUNING.smallest_score, TUNING.rival_score * believed):
            break
        _check(go_on)
        ring = _followed(circles[k : k + 1], pairs, grid, decided, go_on)
        if ring is not None:
            tried.append(ring)
            if ring.judgement.is_ring:
                believed = max(believed, float(circles.scores[k]))
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


def _followed(
    circle: Circles, pairs: Sequence[FramePair], grid: EpipolarGrid, config: TrackerConfig, go_on: Callable[[], bool]
) -> Proposal | None:
    """What a circle leads to, once its curve has been followed through the pairs; None where there is no ring."""
    first = pairs[0]
    tracker = RingTracker(config)
    try:
        seed = clicks_on(
            circle, first.frames, grid, bright=config.polarity == "bright", line_sigma_mm=config.path.line_sigma_mm
        )
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
