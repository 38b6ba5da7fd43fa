"""Rings that are looked for while there is no model, pair after pair."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from lasso_motion_ros.config.stream import StreamConfig
from lasso_motion_ros.geometry.frames import FramePair
from lasso_motion_ros.initialisation.ring_finder import PAIRS, Proposal, find_rings


class RingLookout:
    """Collects successive pairs and looks for rings in them, as many pairs at a time as have to show one.

    Args:
        config: the parameters.
    """

    def __init__(self, config: StreamConfig) -> None:
        self._config = config
        self._pairs: list[FramePair] = []
        self._other_polarity = False

    def reconfigure(self, config: StreamConfig) -> None:
        """Go on with other parameters."""
        self._config = config

    def forget(self) -> None:
        """Begin anew: the next pair is not of the same succession."""
        self._pairs.clear()

    def add(self, pair: FramePair) -> tuple[FramePair, ...]:
        """Take the next pair; the pairs to look at, or none where more are needed."""
        is_later = not self._pairs or pair.stamp_ns > self._pairs[-1].stamp_ns
        if not pair.is_whole or pair.new_run or not is_later:
            self._pairs.clear()
        if pair.is_whole:
            self._pairs.append(pair)
        if len(self._pairs) < PAIRS:
            return ()
        pairs, self._pairs = tuple(self._pairs), []
        return pairs

    def look(self, pairs: Sequence[FramePair], go_on: Callable[[], bool] = lambda: True) -> list[Proposal]:
        """The rings that successive pairs show, best first.

        Args:
            pairs: from `add`.
            go_on: asked between the steps of a look.

        Raises:
            OvertakenError: `go_on` has said no.
        """
        found = find_rings(pairs, self._config, other_polarity=self._other_polarity, go_on=go_on)
        # Where the likelier polarity has shown none, the other has its turn.
        self._other_polarity = not found and not self._other_polarity
        return found


def only_ring(proposals: list[Proposal]) -> Proposal | None:
    """The ring that may be started with unasked: the only one, without any that fits nearly as well."""
    return proposals[0] if len(proposals) == 1 and proposals[0].rivals == 0 else None
