"""Rings that are looked for while there is no model, pair after pair, and the clicks that a found one makes."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

from lasso_motion_ros.config.stream import StreamConfig
from lasso_motion_ros.geometry.frames import PLANES, FramePair, Plane
from lasso_motion_ros.initialisation.ring_finder import PAIRS, Proposal, find_rings
from msg_adapters.messages import MessageFactory, header_fields
from msg_adapters.seeds import encode_polygon
from msg_adapters.topics import seed_topic


class RingLookout:
    """Collects successive pairs and looks for rings in them, as many pairs at a time as have to show one.

    Args:
        config: the parameters.
    """

    def __init__(self, config: StreamConfig) -> None:
        self._config = config
        self._pairs: list[FramePair] = []
        self._looks = 0

    def forget(self) -> None:
        """Begin anew: the next pair is not of the same succession."""
        self._pairs.clear()

    def add(self, pair: FramePair) -> tuple[FramePair, ...]:
        """Take the next pair; the pairs to look at, or none where more are needed."""
        if not pair.is_whole or pair.new_run:
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
        self._looks += 1
        # Where the likelier polarity has shown none, the other has its turn.
        return find_rings(pairs, self._config, other_polarity=self._looks % 2 == 0, go_on=go_on)


def only_ring(proposals: list[Proposal]) -> Proposal | None:
    """The ring that may be started with unasked: the only one, without any that fits nearly as well."""
    return proposals[0] if len(proposals) == 1 and proposals[0].rivals == 0 else None


def click_messages(proposal: Proposal, messages: MessageFactory) -> dict[Plane, Any]:
    """Per plane, the PolygonStamped of a proposal's clicks, as if a person had set them."""
    made = {}
    for plane in PLANES:
        frame = proposal.pair.frames[plane]
        fields = encode_polygon(proposal.seed.points(plane), header_fields(frame.stamp_ns))
        made[plane] = messages.make(seed_topic(plane).type_name, fields)
    return made
