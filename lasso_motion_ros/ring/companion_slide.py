"""How far the ring has slid from what moves with the heart beside it: a filter over what each pair shows of that.

One pair tells it to half a millimetre or worse, by how unlike ring and companions beat and breathe; a slide lasts.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
import numpy.typing as npt

from lasso_motion_ros.geometry.covariance import inverses, largest_sigma, squared_mahalanobis
from lasso_motion_ros.geometry.frames import PLANES
from lasso_motion_ros.motion.motion_model import Observation

Array = npt.NDArray[np.float64]

_IDENTITY_3 = np.eye(3)


@dataclass(frozen=True)
class CompanionSlideTuning:
    """How a ring slides, and what is known of that at first."""

    first_m: float = 1e-4  # standard deviation in the seed pair: it is where it was clicked
    wander_m: float = 3e-4  # in a second, of a slide that is not foreseen
    freedom: float = 4.0  # of Student's distribution of what one pair shows
    # What is so unlike what was known, twice: a hand has put it there, anywhere within a standard deviation of this.
    unlike: float = 25.0  # squared Mahalanobis distance, for each plane
    put_m: float = 7e-3
    known_m: float = 8e-4  # in every direction: then companions tell of a slide what the ring's own past cannot,
    known_for_s: float = 2.0  # for so long after both planes have shown some


@dataclass(frozen=True, eq=False)
class CompanionSlide:
    """The ring's place by that of its companions, as far as it is known.

    Attributes:
        tuning: how a ring slides.
        offset: (3,) from where they have it, metres.
        covariance: (3, 3) m².
        unseen_s: time since both planes have shown companions, seconds.
        was_unlike: whether the last pair that showed some was unlike what was known before.
    """

    tuning: CompanionSlideTuning
    offset: Array = field(default_factory=lambda: np.zeros(3))
    covariance: Array = field(default_factory=lambda: np.zeros((3, 3)))
    unseen_s: float = math.inf
    was_unlike: bool = False

    @staticmethod
    def first(tuning: CompanionSlideTuning) -> CompanionSlide:
        """In the seed pair."""
        return CompanionSlide(tuning, np.zeros(3), tuning.first_m**2 * _IDENTITY_3)

    def after(self, interval_s: float, shown: Sequence[Observation]) -> CompanionSlide:
        """After a pair.

        Args:
            interval_s: since the pair before, seconds.
            shown: by each plane that shows companions, the ring's offset from where they have it.
        """
        unseen_s = 0.0 if len(shown) == len(PLANES) else self.unseen_s + interval_s
        if not shown:  # what no plane shows is not less known than it was: it comes back by itself, or not at all
            return replace(self, unseen_s=unseen_s)
        tuning = self.tuning
        across = shown[0].across
        directions = _IDENTITY_3 if len(shown) == len(PLANES) else across.T @ across
        offset, covariance = self.offset, self.covariance + tuning.wander_m**2 * interval_s * directions
        distance = sum(
            squared_mahalanobis(
                one.value - one.across @ offset, one.across @ covariance @ one.across.T + one.covariance
            )
            for one in shown
        )
        is_unlike = distance > tuning.unlike * len(shown)
        if is_unlike and self.was_unlike:
            covariance = covariance + tuning.put_m**2 * directions
        for one in shown:
            innovation = one.value - one.across @ offset
            expected = one.across @ covariance @ one.across.T
            # What is far off once counts for less: it is something else, or a hand, which shows at once anyway.
            far = squared_mahalanobis(innovation, expected + one.covariance)
            unusual = max((tuning.freedom + far) / (tuning.freedom + 2.0), 1.0)
            gain = covariance @ one.across.T @ inverses(expected + unusual * one.covariance)[0]
            offset = offset + gain @ innovation
            covariance = covariance - gain @ one.across @ covariance
        covariance = 0.5 * (covariance + covariance.T)
        return replace(self, offset=offset, covariance=covariance, unseen_s=unseen_s, was_unlike=is_unlike)

    @property
    def size_m(self) -> float:
        """How far it has slid, metres."""
        return float(np.linalg.norm(self.offset))

    @property
    def is_known(self) -> bool:
        """Whether it is known in every direction."""
        return self.unseen_s <= self.tuning.known_for_s and largest_sigma(self.covariance) < self.tuning.known_m

    def log_odds(self, limit_m: float) -> float:
        """Natural logarithm of the odds that it has slid by more than a limit, metres."""
        beyond = min(max(self.beyond(limit_m), 1e-12), 1.0 - 1e-12)
        return math.log(beyond / (1.0 - beyond))

    def beyond(self, limit_m: float) -> float:
        """Probability that it has slid by more than a limit, metres."""
        size = self.size_m
        if size == 0.0:
            return 0.0
        way = self.offset / size
        sigma = math.sqrt(float(way @ self.covariance @ way))
        return 0.5 * math.erfc((limit_m - size) / (math.sqrt(2.0) * sigma))
