"""The stages of a tracker's work on a pair: it names them, and whoever measures it listens."""

from __future__ import annotations

from contextlib import AbstractContextManager, nullcontext
from typing import Literal, Protocol

Stage = Literal[
    "display filter",
    "working image",
    "search",
    "alignment",
    "detection",
    "filter",
    "judgement",
    "learning",
    "report",
    "features",
    "registration",
]
"""In the order of the work; the last two are the published method's.

The working image, the search and the alignment lie inside the detection, whose own share is what else it does: where to
look, which peaks of the planes belong together, and what a place that was aligned shows of the ring.
"""


class Stages(Protocol):
    """What a tracker tells of its stages."""

    def __call__(self, stage: Stage, /) -> AbstractContextManager[None]:
        """Holds while the stage lasts; one may lie within itself or another."""


_NOTHING = nullcontext()


def no_stages(stage: Stage, /) -> AbstractContextManager[None]:
    """Nobody listens."""
    del stage
    return _NOTHING
