"""Which of the curves that the clicks allow is the ring's: the pairs after the seed pair tell what that one cannot.

A curve is bent to what the seed pair shows, noise included, and several may look as good there. The right one shows the
ring in the next pairs, too.
"""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

from lasso_motion_ros.core.errors import ReconstructionError, SeedError
from lasso_motion_ros.geometry.frames import FramePair
from lasso_motion_ros.ring.loop_model import LoopModel
from lasso_motion_ros.ring.track import Track
from lasso_motion_ros.tracking.tracker import TrackResult

Begin = Callable[[LoopModel], tuple[Track, TrackResult]]
Follow = Callable[[Track, FramePair], TrackResult]


@dataclass(frozen=True)
class ChoiceTuning:
    """When other curves are tried, and what they have to be better by."""

    holds: float = 0.75  # of the seed pair's support: a curve that shows so much in the next pair is right
    pairs: int = 3  # without it, until another is taken
    # Mean support over these pairs by which another curve has to show more of the ring. Clutter varies by 0.15
    # from pair to pair, so that of two means over three pairs one exceeds the other by 0.12 by chance.
    better: float = 0.3
    curves: int = 3  # tried at most


@dataclass(eq=False)
class _Trial:
    """One of the other curves, followed through the pairs so far.

    Attributes:
        track: what it has made of them.
        result: of the last one.
        supports: what it has shown in each.
    """

    track: Track
    result: TrackResult
    supports: list[float] = field(default_factory=list)


@dataclass(eq=False)
class SeedChoice:
    """The other curves, until one has proved right.

    To begin with one takes as long as two pairs, and then one more for each pair that it is followed through. Whoever
    has time between two pairs goes on with it (`step`), so that the last of them need not wait for all of it.

    Attributes:
        others: models, the best by the seed pair first.
        tuning: when they are tried.
        later: the pairs since the seed pair.
        supports: what the present curve has shown in each.
    """

    others: Sequence[LoopModel]
    tuning: ChoiceTuning
    later: list[FramePair] = field(default_factory=list)
    supports: list[float] = field(default_factory=list)
    _begun: int = 0
    _trials: list[_Trial] = field(default_factory=list)

    def is_open_after(self, pair: FramePair, track: Track) -> bool:
        """Take note of one more pair; returns whether the present curve may still be the wrong one."""
        self.later.append(pair)
        self.supports.append(track.last_support)
        return bool(self.others) and track.last_support < self.tuning.holds * track.seed_support

    @property
    def is_due(self) -> bool:
        """Whether it can be told now which curve is the right one."""
        return len(self.later) >= self.tuning.pairs

    def step(self, begin: Begin, follow: Follow) -> bool:
        """Take one of the other curves to one more pair, or begin with the next.

        Args:
            begin: starts a track of a model on the seed pair; raises where the seed is refused with it.
            follow: takes a track to the next pair.

        Returns:
            Whether there was anything left to do.
        """
        for trial in self._trials:
            for pair in self.later[len(trial.supports) :]:
                trial.result = follow(trial.track, pair)
                trial.supports.append(trial.track.last_support)
                return True
        for model in self.others[self._begun : self.tuning.curves]:
            self._begun += 1
            with contextlib.suppress(SeedError, ReconstructionError):
                self._trials.append(_Trial(*begin(model)))
            return True
        return False

    @property
    def better(self) -> tuple[Track, TrackResult] | None:
        """The curve that shows more of the ring in the pairs since, and what it makes of the last one, if any does."""
        best: tuple[Track, TrackResult] | None = None
        most = sum(self.supports) + self.tuning.better * len(self.supports)
        for trial in self._trials:
            # Where no ring was in view, one curve shows more of nothing than another.
            is_shown = max(trial.supports) >= self.tuning.holds * trial.track.seed_support
            if is_shown and sum(trial.supports) > most:
                best, most = (trial.track, trial.result), sum(trial.supports)
        return best
