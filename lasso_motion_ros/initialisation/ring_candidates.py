"""Rings that may be proposed, likeliest first: a best-first search over what is known of each.

Of a ring that was found its lines and electrodes are known at once. A close-up, the likeliest curve in it, and that
curve's poles take a hundred times as long, each. So what each ring can be at best with what is known so far tells
which one is looked at more closely next; what leaves no hope is left, and so is what lies where a ring is believed.
"""

from __future__ import annotations

import heapq
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import count

import numpy as np
import numpy.typing as npt

from lasso_motion_ros.core.errors import LassoMotionError
from lasso_motion_ros.geometry.curves import distance_to_curve
from lasso_motion_ros.geometry.frames import PLANES, FramePair, Plane
from lasso_motion_ros.initialisation.circle_fit import line_beyond, scored
from lasso_motion_ros.initialisation.clicks import model_of, places_along
from lasso_motion_ros.initialisation.distinctness import CurveElsewhere, Distinctness
from lasso_motion_ros.initialisation.epipolar_grid import EpipolarGrid
from lasso_motion_ros.initialisation.judgement import (
    MOST_DISTINCT,
    Glance,
    Judgement,
    Known,
    at_best,
    at_most,
    has_ring_size,
    hope,
    hope_of_lines,
)
from lasso_motion_ros.initialisation.known_rings import FollowedRing, KnownRings
from lasso_motion_ros.initialisation.laid_pair import LaidPair
from lasso_motion_ros.initialisation.lines_elsewhere import lines_stand_out
from lasso_motion_ros.initialisation.ring_closeup import RingCloseups
from lasso_motion_ros.initialisation.ring_search import FoundRings, Shown
from lasso_motion_ros.initialisation.shaped_rings import ShapedRings
from lasso_motion_ros.ring.electrodes import Comb, likeliest_comb
from lasso_motion_ros.ring.loop_model import LoopModel
from lasso_motion_ros.ring.seed_images import SeedImages
from lasso_motion_ros.ring.working_image import Image, WholeImages

Array = npt.NDArray[np.float64]


@dataclass(frozen=True)
class _Tuning:
    """What a ring's worth is, and which candidates are the same."""

    agreement_share: float = 0.5  # of the planes' agreement in a ring's worth
    same_curve_m: float = 0.5e-3  # mean distance of two curves along the same lines


TUNING = _Tuning()


@dataclass(frozen=True, eq=False)
class Candidate:
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
        before: the same ring as earlier looks have followed it; None if none has.
        added: log odds that those add.
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
    before: FollowedRing | None
    added: float

    def is_as(self, other: Candidate) -> bool:
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
    def centre(self) -> Array:
        """(3,) middle of the curve, world metres."""
        return np.asarray(self.model.points.mean(axis=0))

    @property
    def with_any_poles(self) -> Judgement:
        """What it can be once it is followed, before its poles, which take time, are looked for."""
        return self._at_best(np.inf, replace(MOST_DISTINCT, curve=self.elsewhere.curve))

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
            before=self.added,
        )


@dataclass(frozen=True, eq=False)
class _FoundRing:
    """A ring as the search has found it.

    Attributes:
        ring: one.
        moved: per later pair, (4,) as of `FoundRings`.
        lines: what both planes show along it.
        rareness: see `Judgement`.
        line_beyond: likewise.
        stands_out: how far its lines do, standard deviations, sum of the planes.
        added: log odds that earlier looks add.
    """

    ring: ShapedRings
    moved: list[Array]
    lines: float
    rareness: float
    line_beyond: float
    stands_out: float
    added: float

    @property
    def centre(self) -> Array:
        """(3,) world metres."""
        return np.asarray(self.ring.centres[0])

    @property
    def hope(self) -> float:
        """By what is known of it."""
        worth = self.lines + TUNING.agreement_share
        best = at_most(worth=worth, rareness=self.rareness, line_beyond=self.line_beyond, before=self.added)
        return hope_of_lines(best, self.stands_out)


class RingQueue:
    """Rings that were found, likeliest first.

    Args:
        found: rings.
        closeups: of them.
        shown: as of `search_rings`.
        known: rings of earlier looks.

    Attributes:
        hope: of the likeliest, before any is looked at closely; less than 0 where there is none.
    """

    def __init__(
        self, found: Sequence[FoundRings], closeups: RingCloseups, shown: Sequence[Shown], known: KnownRings
    ) -> None:
        self._closeups, self._first, self._known = closeups, shown[0].pair, known
        self._queue: list[tuple[float, int, Known, _FoundRing | Candidate]] = []
        self._number = count()
        self.hope = -np.inf
        for part in found:
            for one in _as_found(part, shown, known):
                self._push(one, one.hope, Known.CIRCLE)
                self.hope = max(self.hope, one.hope)

    def likeliest_first(
        self, is_taken: Callable[[Array], bool], *, check: Callable[[], None] = lambda: None
    ) -> Iterator[Candidate]:
        """The rings that are worth following, each once all others have less hope by what is known of them.

        Args:
            is_taken: whether there is a ring at a centre (3,) m already; asked again and again.
            check: called again and again; what it raises ends it.
        """
        followed: list[Candidate] = []
        while self._queue:
            check()
            *_, stage, one = heapq.heappop(self._queue)
            if is_taken(one.centre):
                continue
            if isinstance(one, _FoundRing):
                candidate = _looked_at(one, self._closeups, self._first, self._known)
                if candidate is not None:
                    self._push(candidate, hope(candidate.with_any_poles, Known.CURVE), Known.CURVE)
            elif any(one.is_as(other) for other in followed):
                continue
            elif stage is Known.CURVE:
                self._push(one, hope(one.at_best, Known.POLES), Known.POLES)
            else:
                followed.append(one)
                yield one

    def _push(self, one: _FoundRing | Candidate, its_hope: float, stage: Known) -> None:
        """Look at it more closely when its turn comes, if there is hope."""
        if its_hope >= 0.0:
            heapq.heappush(self._queue, (-its_hope, next(self._number), stage, one))


def _as_found(found: FoundRings, shown: Sequence[Shown], known: KnownRings) -> Iterator[_FoundRing]:
    """Rings with what is known of them at once."""
    first = shown[0].pair
    circles = found.rings.circles(np.zeros(len(found)))
    lines = np.max([scored(circles, one.maps, first.grid).scores for one in shown], axis=0)
    beyond = np.max([line_beyond(circles, one.maps, first.grid) for one in shown], axis=0)
    distinct = np.max([lines_stand_out(found.rings, one.maps, first.grid) for one in shown], axis=0)
    curves = found.rings.points()
    for k, rareness in enumerate(found.rareness.tolist()):
        moved = [by[k] for by in found.moved]
        seen = float(lines[k]), rareness, float(beyond[k]), float(distinct[k])
        yield _FoundRing(found.rings[k : k + 1], moved, *seen, known.adds(curves[k], first.pair.stamp_ns))


def _looked_at(one: _FoundRing, closeups: RingCloseups, first: LaidPair, known: KnownRings) -> Candidate | None:
    """A ring in its close-up; None where both planes do not show something of one there."""
    pair = closeups.of(one.ring, one.moved)
    whole = WholeImages(pair.frames)
    images = SeedImages(pair, bright=first.bright, whole=whole)
    seen = _seen_along(one.ring, images, first.grid)
    if seen is None:
        return None
    model, agreement, evidence, elsewhere = seen
    worth = one.lines + TUNING.agreement_share * agreement
    so_far = worth, one.rareness, one.line_beyond, evidence, elsewhere
    before, added = known.of(model.points), known.adds(model.points, pair.stamp_ns)
    return Candidate(model, images, whole, pair, *so_far, before, added)


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
    if not has_ring_size(model.diameter_mm):
        return None
    seen = images.working(model.centre, {p: model.shift(p, images.projections[p]) for p in PLANES})
    along = {p: image.projection.project(model.points) for p, image in seen.items()}
    shown = {p: image.evidence_at(along[p]) for p, image in seen.items()}
    glance = Glance.at(shown, places_along(model, images))
    if not glance.is_worth_following:
        return None
    return model, glance.agreement, shown, CurveElsewhere(seen, along)
