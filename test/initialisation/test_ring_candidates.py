"""Of the rings that were found the likeliest is looked at first, and none where a ring is believed."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np
import pytest
from support.breathing_lasso import pair
from support.lasso_inputs import CURVE

from lasso_motion_ros.geometry.curves import distance_to_curve
from lasso_motion_ros.geometry.frames import FramePair
from lasso_motion_ros.initialisation.compensated_mean import motions_of
from lasso_motion_ros.initialisation.known_rings import KnownRings
from lasso_motion_ros.initialisation.laid_pair import LaidPair
from lasso_motion_ros.initialisation.ring_candidates import Candidate, RingQueue
from lasso_motion_ros.initialisation.ring_closeup import RingCloseups
from lasso_motion_ros.initialisation.ring_search import FoundRings, Shown, search_rings
from lasso_motion_ros.initialisation.shaped_rings import ShapedRings

PAIRS = [LaidPair.of(pair(index), bright=False) for index in range(3)]
SHOWN = [Shown.by(PAIRS[0])]
FOUND = search_rings(PAIRS, SHOWN)


class _Counted(RingCloseups):
    """Close-ups that are counted."""

    count = 0

    def of(self, ring: ShapedRings, told: object) -> FramePair:
        self.count += 1
        return super().of(ring, told)  # type: ignore[arg-type]


def _first(
    found: tuple[FoundRings, ...], is_taken: Callable[[np.ndarray], bool], known: KnownRings | None = None
) -> tuple[Iterator[Candidate], _Counted]:
    closeups = _Counted(PAIRS, motions_of(PAIRS))
    known = known or KnownRings([], PAIRS[0].pair)
    return RingQueue(found, closeups, SHOWN, known).likeliest_first(is_taken), closeups


def test_the_drawn_ring_comes_first_and_before_all_others_are_looked_at() -> None:
    candidates, closeups = _first(FOUND, lambda _: False)
    first = next(candidates)
    assert distance_to_curve(CURVE, first.model.points).mean() < 0.5e-3
    looked_at = closeups.count
    others = list(candidates)
    assert all(one.at_best.evidence <= first.at_best.evidence for one in others)
    assert not any(one.is_as(first) for one in others)  # many are begun with along the same lines
    assert looked_at < closeups.count < sum(map(len, FOUND))  # many leave no hope


def test_nothing_is_looked_at_where_a_ring_is_taken() -> None:
    taken: list[np.ndarray] = []
    candidates, closeups = _first(FOUND, lambda centre: any(np.linalg.norm(centre - one) < 8e-3 for one in taken))
    taken.append(next(candidates).centre)
    looked_at = closeups.count
    assert list(candidates) == []
    near = np.linalg.norm(FOUND[1].rings.centres - taken[0], axis=1) < 8e-3
    assert near.sum() > 1
    everything, all_closeups = _first(FOUND, lambda _: False)
    assert list(everything)
    assert closeups.count < all_closeups.count
    assert looked_at >= 1


def test_the_order_in_which_rings_come_in_does_not_matter() -> None:
    one, other = (next(_first(found, lambda _: False)[0]) for found in (FOUND, FOUND[::-1]))
    assert one.model.points == pytest.approx(other.model.points)
