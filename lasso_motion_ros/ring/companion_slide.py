"""How far the ring has slid from what moves with the heart beside it: a filter over what each pair shows of that.

One pair tells it to half a millimetre or worse, by how unlike ring and companions beat and breathe; a slide lasts.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
import numpy.typing as npt

from lasso_motion_ros.geometry.frames import PLANES

Array = npt.NDArray[np.float64]


@dataclass(frozen=True)
class CompanionSlideTuning:
    """How a ring slides, and what is known of that at first."""

    first_mm: float = 0.1  # standard deviation in the seed pair: it is where it was clicked
    wander_mm: float = 0.3  # in a second, of a slide that is not foreseen
    freedom: float = 4.0  # of Student's distribution of what one pair shows
    known_mm: float = 0.8  # in every direction: then companions tell of a slide what the ring's own past cannot,
    known_for_s: float = 2.0  # for so long after both planes have shown some


@dataclass(frozen=True, eq=False)
class Offset:
    """How far a plane shows the ring from where its companions have it.

    Attributes:
        across: (2, 3) unit vectors across the plane's ray.
        along: (2,) the offset along them, mm.
        variance: of it along either, mm².
    """

    across: Array
    along: Array
    variance: float


@dataclass(frozen=True, eq=False)
class CompanionSlide:
    """The ring's place by that of its companions, as far as it is known.

    Attributes:
        offset: (3,) from where they have it, mm.
        covariance: (3, 3) mm².
        unseen_s: time since both planes have shown companions, seconds.
        tuning: how a ring slides.
    """

    tuning: CompanionSlideTuning
    offset: Array = field(default_factory=lambda: np.zeros(3))
    covariance: Array = field(default_factory=lambda: np.zeros((3, 3)))
    unseen_s: float = math.inf

    @staticmethod
    def first(tuning: CompanionSlideTuning) -> CompanionSlide:
        """In the seed pair."""
        return CompanionSlide(tuning, np.zeros(3), tuning.first_mm**2 * np.eye(3))

    def after(self, interval_s: float, shown: Sequence[Offset]) -> CompanionSlide:
        """After a pair.

        Args:
            interval_s: since the pair before, seconds.
            shown: by each plane that shows companions.
        """
        tuning = self.tuning
        offset, covariance = self.offset, self.covariance
        if shown:  # what no plane shows is not less known than it was: it comes back by itself, or not at all
            directions = np.linalg.svd(np.vstack([one.across for one in shown]), full_matrices=False)[2]
            covariance = covariance + tuning.wander_mm**2 * interval_s * directions.T @ directions
        for one in shown:
            innovation = one.along - one.across @ offset
            expected, noise = one.across @ covariance @ one.across.T, one.variance * np.eye(2)
            distance = float(innovation @ np.linalg.solve(expected + noise, innovation))
            # What is far off counts for less: it is something else, or a hand, which shows at once anyway.
            unusual = max((tuning.freedom + distance) / (tuning.freedom + 2.0), 1.0)
            gain = covariance @ one.across.T @ np.linalg.inv(expected + unusual * noise)
            offset = offset + gain @ innovation
            covariance = covariance - gain @ one.across @ covariance
        unseen_s = 0.0 if len(shown) == len(PLANES) else self.unseen_s + interval_s
        return replace(self, offset=offset, covariance=0.5 * (covariance + covariance.T), unseen_s=unseen_s)

    @property
    def size_mm(self) -> float:
        """How far it has slid, mm."""
        return float(np.linalg.norm(self.offset))

    @property
    def is_known(self) -> bool:
        """Whether it is known in every direction."""
        largest = float(np.linalg.eigvalsh(self.covariance)[-1])
        return self.unseen_s <= self.tuning.known_for_s and largest < self.tuning.known_mm**2

    def log_odds(self, limit_mm: float) -> float:
        """Natural logarithm of the odds that it has slid by more than a limit, mm."""
        beyond = min(max(self.beyond(limit_mm), 1e-12), 1.0 - 1e-12)
        return math.log(beyond / (1.0 - beyond))

    def beyond(self, limit_mm: float) -> float:
        """Probability that it has slid by more than a limit, mm."""
        size = self.size_mm
        if size == 0.0:
            return 0.0
        way = self.offset / size
        sigma = math.sqrt(float(way @ self.covariance @ way))
        return 0.5 * math.erfc((limit_mm - size) / (math.sqrt(2.0) * sigma))
