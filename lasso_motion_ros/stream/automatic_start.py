"""Rings that are looked for while there is no model, pair after pair."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
import numpy.typing as npt

from lasso_motion_ros.config.stream import StreamConfig
from lasso_motion_ros.core.errors import TrackingError
from lasso_motion_ros.geometry.frames import FramePair
from lasso_motion_ros.initialisation.known_rings import FollowedRing
from lasso_motion_ros.initialisation.proposal import SAME_M, Proposal
from lasso_motion_ros.initialisation.ring_finder import PAIRS, find_rings

Array = npt.NDArray[np.float64]

FARTHEST_M = 0.03  # that a breath takes rings from look to look


class RingLookout:
    """Collects successive pairs and looks for rings in them: as many as have to show one, then with those before, too.

    What some pairs show too little of is shown by twice as many, and what looks that share no pair say of it adds up.

    Args:
        config: the parameters.
    """

    def __init__(self, config: StreamConfig) -> None:
        self._config = config
        self._pairs: list[FramePair] = []
        self._before: list[FramePair] = []  # those of the look before, if the others succeed them
        self._other_polarity = False
        self._known: list[FollowedRing] = []

    def reconfigure(self, config: StreamConfig) -> None:
        """Go on with other parameters."""
        self._config = config

    def forget(self) -> None:
        """Begin anew: nothing that was seen before counts."""
        self._pairs, self._before, self._known = [], [], []

    def add(self, pair: FramePair) -> tuple[FramePair, ...]:
        """Take the next pair; the pairs to look at, or none where more are needed."""
        known = [*self._before, *self._pairs]
        is_later = not known or pair.stamp_ns > known[-1].stamp_ns
        if pair.new_run or not is_later:
            self.forget()
        if not pair.is_whole:
            self._pairs, self._before = [], []  # of no succession any more; a ring is known again across the gap
        if pair.is_whole:
            self._pairs.append(pair)
        if len(self._pairs) < PAIRS:
            return ()
        pairs = (*self._before, *self._pairs)
        self._before, self._pairs = self._pairs, []
        return pairs

    def look(self, pairs: Sequence[FramePair], go_on: Callable[[], bool] = lambda: True) -> list[Proposal]:
        """The rings that successive pairs show, best first.

        Args:
            pairs: from `add`.
            go_on: asked between the steps of a look.

        Raises:
            OvertakenError: `go_on` has said no.
        """
        look = find_rings(pairs, self._config, known=self._known, other_polarity=self._other_polarity, go_on=go_on)
        self._known, found = look.followed, look.proposed
        # Where the likelier polarity has shown none, the other has its turn, if that is in doubt.
        self._other_polarity = not found and not self._other_polarity
        return found


class ProposedRings:
    """The rings that are proposed: the one that was first already, then the best; those that were passed over last.

    Attributes:
        rings: in that order.
    """

    def __init__(self) -> None:
        self.rings: list[Proposal] = []
        self._passed_over: list[Array] = []  # centres

    @property
    def first(self) -> Proposal:
        """The ring that would be started with.

        Raises:
            TrackingError: there is none.
        """
        if not self.rings:
            raise TrackingError("no ring is proposed")
        return self.rings[0]

    def replace(self, found: Sequence[Proposal]) -> None:
        """Propose what a look has found, best first; with nothing all is forgotten.

        The ring that was first stays so while it is found: who says yes means the one that he has before his eyes.
        """
        if not found:
            self._passed_over, self.rings = [], []
            return
        moved = _common_motion([one.centre for one in self.rings], [one.centre for one in found])
        self._passed_over = [centre + moved for centre in self._passed_over]
        first = [one.centre + moved for one in self.rings[:1]]
        self.rings = sorted(found, key=lambda ring: (self.was_passed_over(ring), not any(map(ring.is_at, first))))

    def pass_over(self) -> None:
        """Put the first ring last; when all have been passed over it is all of them again.

        Raises:
            TrackingError: there is no other.
        """
        first, others = self.first, self.rings[1:]
        if not others:
            raise TrackingError("no other ring is proposed")
        if all(map(self.was_passed_over, others)):
            self._passed_over.clear()
        self._passed_over.append(first.centre)
        self.rings = [*others, first]

    def was_passed_over(self, ring: Proposal) -> bool:
        """Whether somebody has said that it is not the one."""
        return any(ring.is_at(centre) for centre in self._passed_over)


def _common_motion(before: Sequence[Array], now: Sequence[Array]) -> Array:
    """(3,) m by which most rings have moved, by their centres (3,) m in two looks: a breath takes all along."""
    moves = sorted((later - earlier for earlier in before for later in now), key=_length)
    best, most = np.zeros(3), 0
    for move in (best, *moves):
        there = [min(_length(later - earlier - move) for later in now) for earlier in before]
        count = sum(away < SAME_M for away in there)
        if count > most and _length(move) < FARTHEST_M:
            best, most = move, count
    return best


def _length(vector: Array) -> float:
    return float(np.linalg.norm(vector))


def only_ring(proposals: list[Proposal]) -> Proposal | None:
    """The ring that may be started with unasked: the only one, without any that fits nearly as well."""
    return proposals[0] if len(proposals) == 1 and proposals[0].rivals == 0 else None
