"""A place where the ring may be: its alignment, and how much each plane shows of the ring there."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt

from lasso_motion_ros.geometry.directions import cross
from lasso_motion_ros.geometry.frames import PLANES, Plane
from lasso_motion_ros.motion.motion_model import Observation
from lasso_motion_ros.ring.alignment import Alignment
from lasso_motion_ros.ring.loop_views import PlaneFit

Array = npt.NDArray[np.float64]

_IDENTITY_2 = np.eye(2)


@dataclass(frozen=True)
class DetectionTuning:
    """What the evidence of two planes is worth."""

    stronger_share: float = (
        0.3  # of the stronger plane's evidence, added to the weaker plane's: no plane may contradict
    )
    alone_penalty: float = 0.15  # what one plane alone shows is a coincidence more often
    smallest_coverage: float = 0.5  # of the profile inside the image: with less, a plane cannot show the ring
    systematic_m: float = 2e-5  # interpolation, a background that moves
    # Where less of the ring is shown the noise tells less of where it is: its variance is e to the power of so much for
    # each unit of support below (docs/constants.md).
    clear_support: float = 2.2
    pull: float = 1.09
    # And where the template fits still less well, something pulls at it, whatever the noise:
    pulled_support: float = 1.95
    pulled_m: float = 4.5e-4  # standard deviation for each unit of support that is missing
    same_m: float = 3e-4  # alignments that end so close are one


@dataclass(frozen=True, eq=False)
class Detection:
    """One candidate, aligned.

    Attributes:
        alignment: where the ring would be.
        tuning: what the planes' evidence is worth.
    """

    alignment: Alignment
    tuning: DetectionTuning

    @cached_property
    def planes(self) -> dict[Plane, PlaneFit]:
        """The planes that could show the ring there: their fits."""
        fits = self.alignment.planes
        return {plane: fit for plane, fit in fits.items() if fit.coverage >= self.tuning.smallest_coverage}

    @cached_property
    def support(self) -> float:
        """What the planes show of the ring, the weaker one above all; 2.6 at most, about 1 where there is no ring."""
        evidence = sorted(fit.evidence for fit in self.planes.values())
        if not evidence:
            return -1.0
        support = evidence[0] + self.tuning.stronger_share * evidence[-1]
        return support if len(evidence) == len(PLANES) else support - self.tuning.alone_penalty

    def is_same(self, other: Detection) -> bool:
        """Whether another detection is of the same place."""
        if self.planes.keys() != other.planes.keys():
            return False
        there = other.planes
        return all(
            float(np.abs(fit.across @ (fit.centre - there[plane].centre)).max()) < self.tuning.same_m
            for plane, fit in self.planes.items()
        )

    def observation(self, plane: Plane, centre: Array) -> Observation:
        """A plane's fit as a measurement of the displacement from the ring's centre (3,) m at the seed pair."""
        fit = self.planes[plane]
        vaguer = math.exp(self.tuning.pull * (self.tuning.clear_support - self.support))
        pulled_m = self.tuning.pulled_m * max(self.tuning.pulled_support - self.support, 0.0)
        covariance = vaguer * fit.covariance + (self.tuning.systematic_m**2 + pulled_m**2) * _IDENTITY_2
        return Observation(fit.across, fit.across @ (fit.centre - centre), covariance)

    def gap(self, expected_b: Array) -> tuple[float, Array]:
        """How far the two planes' rays through the ring's centre pass each other.

        Args:
            expected_b: (3,) where plane B should see the centre, by what plane A shows, world metres.

        Returns:
            The signed gap in metres, and the (3,) unit direction along which it was measured.
        """
        a, b = (self.planes[plane] for plane in PLANES)
        across = cross(a.ray, b.ray)
        across /= math.sqrt(across @ across)
        return float(across @ (b.centre - expected_b)), across
