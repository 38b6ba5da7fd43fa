"""From exposure to exposure: what was measured at each is taken in by all filters, each at its own time.

What time does in between is told by `motion_model`; where R peaks tell of the beats the state does, too, for as long as
the phase is known. Compiled, exposures in turn are gone through at once.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import accumulate, groupby, pairwise

import numpy as np
import numpy.typing as npt

from lasso_motion_ros.core.compiled import has_kernels
from lasso_motion_ros.motion.heart_bank import HeartBank
from lasso_motion_ros.motion.heartbeat import Beats
from lasso_motion_ros.motion.hearts import Hearts
from lasso_motion_ros.motion.motion_model import (
    NOTHING,
    MotionTuning,
    Observation,
    Spread,
    displacement_at,
    moved_on,
    since_b_at,
)

Array = npt.NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Exposure:
    """One exposure of a plane, as it is taken in.

    Attributes:
        time_s: of the exposure.
        seen: what was measured; None where only the time counts.
        is_since_b: whether of how far the ring is from plane B's origin, instead of its displacement.
        block: of the state, if one becomes the displacement then.
        is_telling: whether it tells of the heart, and how likely it is.
    """

    time_s: float
    seen: Observation | None
    is_since_b: bool
    block: slice | None
    is_telling: bool = True


class ExposureFilter(HeartBank):
    """Filters that go from exposure to exposure.

    Args:
        hearts: what the heart may do, of each filter.
        spread: of breathing.
        tuning: what is expected of measurements.
        time_s: of the states, seconds.
        beats: the heart's, by the R peaks known; None without any.
    """

    def __init__(
        self, hearts: Hearts, spread: Spread, tuning: MotionTuning, time_s: float, beats: Beats | None
    ) -> None:
        super().__init__(hearts, tuning, time_s, beats)
        self._spread = spread

    @property
    def spread(self) -> Array:
        """(3, 3) covariance of the motion about its mean, learned so far, m²."""
        return self._spread.covariance

    def _beats_at(self, time_s: float) -> Beats | None:
        """The beats, if they tell the phase at a time."""
        return self._beats if self._beats is not None and self._beats.is_known(time_s) else None

    def _take_in(self, steps: Sequence[Exposure]) -> float:
        """The state after steps in turn; returns how likely their measurements were, given all before."""
        likelihood = 0.0
        if has_kernels():
            for is_known, some in groupby(steps, lambda step: self._beats_at(step.time_s) is not None):
                alike = list(some)
                if is_known != self._tells_of_beats:
                    self._advance(alike[0].time_s)
                likelihood += self._go_through(alike)
            return likelihood
        for step in steps:
            self._advance(step.time_s)
            weights, function = self._log_weights, self._since_b if step.is_since_b else self._displacement
            if step.seen is not None:
                told = self._update(step.seen, function)
                if step.is_telling:
                    likelihood += told
                else:
                    self._weigh(weights)
            if step.block is not None:
                self._clone(function, step.block)
        return likelihood

    def _go_through(self, steps: Sequence[Exposure]) -> float:
        """The same, compiled, where the state tells of beats before and after all of them, or does not."""
        from lasso_motion_ros.motion import kernels

        times_s = list(accumulate((step.time_s for step in steps), max, initial=self._time_s))
        intervals_s = [later - before for before, later in pairwise(times_s)]
        passages = [self._tuning.passage(interval_s) for interval_s in intervals_s]
        seen = [step.seen or NOTHING for step in steps]
        functions = [
            (since_b_at if step.is_since_b else displacement_at)(self._phase(time_s))
            for step, time_s in zip(steps, times_s[1:], strict=True)
        ]
        state, covariance, log_weights, likelihood = kernels.gone_through(
            self._state,
            self._covariance,
            self._log_weights,
            self._hearts.log_odds,
            self._hearts.odds,
            self.spread,
            self._random_heart,
            np.array(intervals_s),
            _stacked([one.breathing for one in passages]),
            _stacked([one.beating for one in passages]),
            _stacked([one.breathing_noise for one in passages]),
            _stacked([one.beating_noise for one in passages]),
            np.array([self._tuning.heart_kept(interval_s) for interval_s in intervals_s]),
            np.array([step.seen is not None for step in steps]),
            np.array([step.is_telling for step in steps]),
            _stacked(functions),
            _stacked([one.across for one in seen]),
            _stacked([one.value for one in seen]),
            _stacked([one.covariance for one in seen]),
            np.array([-1 if step.block is None else step.block.start for step in steps]),
            self._tuning.freedom,
            self._tuning.unusual_share,
        )
        self._become(state, covariance)
        self._weigh(log_weights)
        self._time_s = times_s[-1]
        return likelihood

    def _advance(self, time_s: float) -> None:
        if time_s > self._time_s:
            is_known = self._beats_at(time_s) is not None
            if not is_known:
                self._switch(False)
            interval_s = time_s - self._time_s
            self._become(
                *moved_on(self._state, self._covariance, interval_s, self.spread, self._random_heart, self._tuning)
            )
            usual = self._hearts.log_odds
            self._weigh(usual + self._tuning.heart_kept(interval_s) * (self._log_weights - usual))
            self._time_s = time_s
            if is_known:
                self._switch(True)


def _stacked(values: Sequence[Array]) -> Array:
    """(S, ...) of values (...)."""
    return values[0][None] if len(values) == 1 else np.array(values)
