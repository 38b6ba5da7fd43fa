"""Rings that may be proposed: beside each that was found the likeliest curve, and what a close-up shows along it."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

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
    is_hopeful,
)
from lasso_motion_ros.initialisation.known_rings import FollowedRing, KnownRings
from lasso_motion_ros.initialisation.ring_closeup import RingCloseups
from lasso_motion_ros.initialisation.ring_search import FoundRings, Shown
from lasso_motion_ros.initialisation.shaped_rings import ShapedRings
from lasso_motion_ros.ring.electrodes import Comb, likeliest_comb
from lasso_motion_ros.ring.loop_model import LoopModel
from lasso_motion_ros.ring.seed_images import SeedImages
from lasso_motion_ros.ring.working_image import Image, WholeImages


@dataclass(frozen=True)
class _Tuning:
    """Which candidates are the same, and how many are followed."""

    agreement_share: float = 0.5  # of the planes' agreement in a ring's worth
    lined: int = 3  # circles along lines that are followed beside the rings that electrodes tell of
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
            before=self.added,
        )


def worth_following(
    told: FoundRings,
    lined: FoundRings,
    closeups: RingCloseups,
    shown: Sequence[Shown],
    known: KnownRings,
    *,
    check: Callable[[], None],
) -> list[Candidate]:
    """The rings beside which both planes show something of one: by their electrodes, and the best by their lines.

    Args:
        told: rings that electrodes tell of.
        lined: circles along lines.
        closeups: of rings.
        shown: as of `search_rings`.
        known: rings of earlier looks.
        check: called again and again; what it raises ends it.
    """
    chosen: list[Candidate] = []
    grid = shown[0].pair.grid
    for found, most in ((told, len(told)), (lined, TUNING.lined)):
        circles = found.rings.circles(np.zeros(len(found)))
        scores = np.max([scored(circles, one.maps, grid).scores for one in shown], axis=0)
        beyond = np.max([line_beyond(circles, one.maps, grid) for one in shown], axis=0)
        candidates = []
        for k in range(len(found)):
            check()
            lines, rareness, line = float(scores[k]), float(found.rareness[k]), float(beyond[k])
            most_worth = lines + TUNING.agreement_share
            most_likely = at_most(worth=most_worth, rareness=rareness, line_beyond=line)
            if not is_hopeful(most_likely, Known.CIRCLE):
                continue
            ring = found.rings[k : k + 1]
            pair = closeups.of(ring, [by[k] for by in found.moved])
            whole = WholeImages(pair.frames)
            images = SeedImages(pair, bright=shown[0].pair.bright, whole=whole)
            seen = _seen_along(ring, images, grid)
            if seen is None:
                continue
            model, agreement, evidence, elsewhere = seen
            worth = lines + TUNING.agreement_share * agreement
            before = known.of(model.points)
            added = 0.0 if before is None else before.adds(pair.stamp_ns)
            candidate = Candidate(model, images, whole, pair, worth, rareness, line, evidence, elsewhere, before, added)
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
    if not has_ring_size(model.diameter_mm):
        return None
    seen = images.working(model.centre, {p: model.shift(p, images.projections[p]) for p in PLANES})
    along = {p: image.projection.project(model.points) for p, image in seen.items()}
    shown = {p: image.evidence_at(along[p]) for p, image in seen.items()}
    glance = Glance.at(shown, places_along(model, images))
    if not glance.is_worth_following:
        return None
    return model, glance.agreement, shown, CurveElsewhere(seen, along)
