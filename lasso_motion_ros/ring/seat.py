"""How far the ring goes to and fro on its seat, against the atrium on which it lies.

It is pressed to the tissue by its shaft, and is not fixed to it: a tip that pushes, a shaft that follows another organ
take it half a millimetre aside and back. No picture tells that from what the atrium does. But breathing repeats, and
this does not: what is left of the places across the breath, once breathing and heart are taken off, tells how large it
is. A pose is as unsure as that, however well the ring is seen.

The places across are a Gaussian process about what breathing may be a linear function of; of a few sizes of it each is
as probable as it makes what was seen (Rasmussen and Williams, "Gaussian Processes for Machine Learning", 2006,
section 5.4.1; a linear mean taken out as in section 2.7).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from lasso_motion_ros.geometry.directions import reflected_axes
from lasso_motion_ros.ring.breathing_terms import breathing_terms, speed_along

Array = npt.NDArray[np.float64]


@dataclass(frozen=True)
class SeatTuning:
    """What is expected of a ring on its seat (docs/constants.md)."""

    time_scale_s: float = 1.5  # of a Matérn-3/2 process
    # Standard deviation in each direction, metres, and odds before anything was seen.
    sizes: tuple[tuple[float, float], ...] = ((2e-5, 0.5), (1e-4, 0.2), (2e-4, 0.2), (3.5e-4, 0.1))
    noises: tuple[float, ...] = (0.5, 1.0, 2.0, 4.0)  # what else is across, by what is expected of it: variances
    spacing_s: float = 0.25  # places nearer in time share a heartbeat, and count as one
    kept: int = 40  # places
    fewest: int = 8
    each: int = 4  # places after which it is worked out anew
    places_a_term: int = 3  # of what breathing is a function of


@dataclass(frozen=True, eq=False)
class Seat:
    """What is known of the ring's own motion on its seat.

    Attributes:
        tuning: what is expected of it.
        times_s: (N,) when both planes have shown it in its place.
        places: (N, 3) where, metres.
        noises: (N, 3, 3) m² how far each is off by itself, its heartbeat included.
        variance: m² of its own motion in each direction.
        count: how many places were ever taken note of.
    """

    tuning: SeatTuning
    times_s: Array
    places: Array
    noises: Array
    variance: float
    count: int = 0

    @staticmethod
    def first(tuning: SeatTuning) -> Seat:
        """Nothing seen."""
        usual = sum(odds * size_m**2 for size_m, odds in tuning.sizes) / sum(odds for _, odds in tuning.sizes)
        return Seat(tuning, np.zeros(0), np.zeros((0, 3)), np.zeros((0, 3, 3)), usual)

    def seen(self, time_s: float, place: Array, noise: Array, axis: Array) -> Seat:
        """With one more place.

        Args:
            time_s: of it.
            place: (3,) displacement of the ring's centre, metres.
            noise: (3, 3) m² of it, with the heartbeat's.
            axis: (3,) unit vector along which it breathes.
        """
        tuning = self.tuning
        if len(self.times_s) and time_s - self.times_s[-1] < tuning.spacing_s:
            return self
        more = replace(
            self,
            times_s=np.append(self.times_s, time_s)[-tuning.kept :],
            places=np.concatenate([self.places, place[None]])[-tuning.kept :],
            noises=np.concatenate([self.noises, noise[None]])[-tuning.kept :],
            count=self.count + 1,
        )
        is_due = more.count >= tuning.fewest and more.count % tuning.each == 0
        return replace(more, variance=more._learned(axis)) if is_due else more

    def anew(self) -> Seat:
        """The same ring put elsewhere."""
        return replace(Seat.first(self.tuning), variance=self.variance)

    def covariance(self, since_s: float) -> Array:
        """(3, 3) m² by which it may lie elsewhere on its seat than so many seconds ago."""
        together = float(_correlation(np.asarray(abs(since_s)), self.tuning.time_scale_s))
        return 2.0 * self.variance * (1.0 - together) * np.eye(3)

    def _learned(self, axis: Array) -> float:
        """The variance that the places tell of."""
        tuning = self.tuning
        along = self.places @ axis
        terms = breathing_terms(along, speed_along(along, np.diff(self.times_s)), tuning.places_a_term)
        together = _correlation(np.subtract.outer(self.times_s, self.times_s), tuning.time_scale_s)
        variances = np.square([size_m for size_m, _ in tuning.sizes])
        log_odds = np.log([odds for _, odds in tuning.sizes])[:, None] + np.zeros(len(tuning.noises))
        axes = reflected_axes(axis[None])[0]
        # The direction in which it is known best, and the other one.
        axes = np.linalg.eigh(axes @ self.noises.mean(axis=0) @ axes.T)[1].T @ axes
        for across in axes:
            sigmas = np.sqrt(np.einsum("i,nij,j->n", across, self.noises, across))
            log_odds = log_odds + _log_likelihoods(
                self.places @ across, sigmas, terms, together, variances, tuning.noises
            )
        odds = np.exp(log_odds - log_odds.max()).sum(axis=1)
        return float(odds @ variances / odds.sum())


def _log_likelihoods(
    values: Array, sigmas: Array, terms: Array, together: Array, variances: Array, noises: Sequence[float]
) -> Array:
    """(V, S) of the values (N,) m, by variances (V,) m² of the process and factors (S,) of their noise.

    Args:
        values: places along one direction.
        sigmas: (N,) of their noise, metres.
        terms: (N, K) what they are a linear function of besides.
        together: (N, N) correlation of the process.
        variances: of the process.
        noises: factors of the noise's variance.
    """
    basis, _ = np.linalg.qr(terms / sigmas[:, None], mode="complete")
    rest = basis[:, terms.shape[1] :]
    powers, ways = np.linalg.eigh(rest.T @ (together / np.outer(sigmas, sigmas)) @ rest)
    seen = np.square(ways.T @ (rest.T @ (values / sigmas)))
    # (V, S, N - K) variance of each independent part.
    expected = np.asarray(noises)[:, None] + variances[:, None, None] * np.maximum(powers, 0.0)
    return np.asarray(-0.5 * (np.log(expected) + seen / expected).sum(axis=-1))


def _correlation(interval_s: Array, scale_s: float) -> Array:
    """Of a Matérn-3/2 process with itself after an interval (Rasmussen and Williams, eq. 4.17)."""
    way = math.sqrt(3.0) * np.abs(interval_s) / scale_s
    return np.asarray((1.0 + way) * np.exp(-way))
