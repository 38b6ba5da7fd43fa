"""The stages of a tracker's work on a pair: it names them, and whoever measures it listens."""

from __future__ import annotations

from contextlib import AbstractContextManager, nullcontext
from typing import Literal, Protocol

Stage = Literal["working image", "search", "alignment", "filter", "judgement", "features", "registration"]
"""In the order of the work; the last two are the published method's."""


class Stages(Protocol):
    """What a tracker tells of its stages."""

    def __call__(self, stage: Stage, /) -> AbstractContextManager[None]:
        """Holds while the stage lasts; one may be entered within itself."""


_NOTHING = nullcontext()


def no_stages(stage: Stage, /) -> AbstractContextManager[None]:
    """Nobody listens."""
    del stage
    return _NOTHING
