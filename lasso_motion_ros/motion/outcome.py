"""What a pair's measurements would make of the motion, told before any of it is adopted.

Of many places in which the ring may be, at most one is: what the measurements there tell of how likely it is asks for
two places of the ring alone, at both planes' exposures, not for the filters' whole states.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Generic, TypeVar

import numpy as np
import numpy.typing as npt

from lasso_motion_ros.motion.hearts import Hearts
from lasso_motion_ros.motion.motion_model import NOTHING, Estimate, MotionTuning, Observation

Array = npt.NDArray[np.float64]
Motion = TypeVar("Motion")


@dataclass(frozen=True, eq=False)
class Outcome(Generic[Motion]):
    """What a pair's measurements would make of the motion.

    Attributes:
        likelihood: how likely they were, given all before: natural logarithm, per metre and component.
        at_a: the displacement at plane A's exposure.
        between: how far plane B's origin lies from it at plane B's exposure, by plane A's measurement; None where not
            both planes measure.
        take_in: makes the motion after them.
    """

    likelihood: float
    at_a: Estimate
    between: Estimate | None
    take_in: Callable[[], Motion]

    @cached_property
    def motion(self) -> Motion:
        """After the measurements; worked out when asked for."""
        return self.take_in()


@dataclass(frozen=True, eq=False)
class Outlook:
    """What a pair's exposures will show, by each filter.

    Attributes:
        times_s: of plane A's exposure and plane B's, seconds.
        values: (6, filters) m: the displacement at plane A's; how far it is from plane B's origin at plane B's.
        covariance: (6, 6, filters) m² of them, one half.
        kept: share of what was learned of the heart that is left at the first, and then at the other.
        at_a: the first over all filters.
        between: the other.
    """

    times_s: tuple[float, float]
    values: Array
    covariance: Array
    kept: tuple[float, float]
    at_a: Estimate
    between: Estimate

    def outcome(
        self,
        a: Observation | None,
        b: Observation | None,
        log_weights: Array,
        hearts: Hearts,
        tuning: MotionTuning,
        take_in: Callable[[], Motion],
    ) -> Outcome[Motion]:
        """What measurements of either plane, or both, would tell.

        Args:
            a: plane A's, if it has one.
            b: plane B's, likewise.
            log_weights: (filters,) logarithms of the filters' weights, but for a constant.
            hearts: of the filters.
            tuning: what is expected of measurements.
            take_in: see `Outcome`.
        """
        from lasso_motion_ros.motion import kernels

        one, other = a or NOTHING, b or NOTHING
        likelihood, mean, covariance, between, spread = kernels.outcome(
            self.values,
            self.covariance,
            log_weights,
            hearts.log_odds,
            hearts.odds,
            self.kept,
            (a is not None, b is not None),
            (one.across, other.across),
            (one.value, other.value),
            (one.covariance, other.covariance),
            tuning.freedom,
            tuning.unusual_share,
        )
        is_whole = a is not None and b is not None
        told = Estimate(between, spread) if is_whole else None
        return Outcome(likelihood, Estimate(mean, covariance), told, take_in)
