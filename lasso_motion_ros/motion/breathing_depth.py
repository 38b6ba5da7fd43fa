"""Depth of the ring while one plane alone shows it: by how it has breathed while both did.

Where the heart is along the ray follows from where it is across it, and from how fast it goes there, since a breath
goes in on one way and out on another beside it. How, is learned from the places that both planes have shown: a
Gaussian process over time about a linear function of that (Rasmussen and Williams, "Gaussian Processes for Machine
Learning", 2006, section 2.7, with a normal prior of the function's coefficients). What the function leaves over, a ring
that goes to and fro on its seat and a heart that beats as nothing shows, is of a size that the places tell, too:
several are weighed by how probable each makes them.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from lasso_motion_ros.geometry.directions import cross, reflected_axes
from lasso_motion_ros.motion.motion_model import Estimate

Array = npt.NDArray[np.float64]

_IDENTITY_3 = np.eye(3)
_SMALLEST = 1e-6  # of a unit vector's part across another


@dataclass(frozen=True)
class DepthTuning:
    """How depth follows from the rest of a breath (docs/constants.md)."""

    # Standard deviations of the function's coefficients: metres, at the mean place; metres of depth per metre across;
    # per metre a second along the breath; and per square metre from the mean place, since the heart's way is bent.
    mean_m: float = 0.001
    slope: float = 0.6
    speed_s: float = 0.1
    bend_per_m: float = 20.0
    # Of what is left: a part that comes back after so long, and a part that each place has for itself,
    lasting_m: float = 2.5e-4
    lasting_s: float = 10.0
    noise_m: float = 3e-4
    # times one of these, and their odds before any was seen.
    sizes: tuple[tuple[float, float], ...] = (
        (0.5, 0.5),
        (1.0, 1.0),
        (2.0, 0.5),
        (4.0, 0.25),
        (8.0, 0.13),
        (16.0, 0.06),
    )
    # Of the variance of a depth that both planes have shown, this share is the same error in all: what is not known of
    # a heart between the planes' exposures.
    common_share: float = 0.5
    kept: int = 40  # places
    spacing_s: float = 0.25  # places nearer in time share a heartbeat, and count as one
    longest_interval_s: float = 0.75  # after a longer one nothing is known of the speed,
    usual_speed_m_s: float = 0.010  # which then is like this, or as it was seen to be


@dataclass(frozen=True, eq=False)
class BreathingDepth:
    """The places that both planes have shown, and the last one that any did.

    Attributes:
        tuning: what is expected of them.
        times_s: (N,) when, seconds.
        places: (N, 3) displacements, metres.
        covariances: (N, 3, 3) m² of them.
        shared: (N, 3, 3) m² of an error that is one and the same of all that have it: they were moved together.
        velocities: (N, 3) m/s on the way there.
        last_s: time of the last place that was seen.
        last: (3,) that place, metres.
    """

    tuning: DepthTuning
    times_s: Array
    places: Array
    covariances: Array
    shared: Array
    velocities: Array
    last_s: float
    last: Array

    @staticmethod
    def first(time_s: float, place: Array, tuning: DepthTuning | None = None) -> BreathingDepth:
        """At the first place (3,) m, where nothing is known of its speed."""
        at = np.array([time_s]), place[None], np.zeros((1, 3, 3)), np.zeros((1, 3, 3)), np.zeros((1, 3))
        return BreathingDepth(tuning or DepthTuning(), *at, time_s, place)

    def seen(self, time_s: float, place: Estimate) -> BreathingDepth:
        """With a place that both planes have shown."""
        later = self.passed(time_s, place.displacement)
        if time_s - self.times_s[-1] < self.tuning.spacing_s:
            return later
        kept = slice(-self.tuning.kept, None)
        return replace(
            later,
            times_s=np.append(self.times_s, time_s)[kept],
            places=np.vstack([self.places, place.displacement])[kept],
            covariances=np.concatenate([self.covariances, place.covariance[None]])[kept],
            shared=np.concatenate([self.shared, np.zeros((1, 3, 3))])[kept],
            velocities=np.vstack([self.velocities, self._velocity(time_s, place.displacement)])[kept],
        )

    def passed(self, time_s: float, place: Array) -> BreathingDepth:
        """With a place (3,) m of which nothing is to be learned but how fast it goes on from there."""
        return replace(self, last_s=time_s, last=place)

    def moved(self, shift: Array, covariance: Array) -> BreathingDepth:
        """The same of a ring put elsewhere by a shift (3,) m, known to (3, 3) m², where it breathes as it did."""
        return replace(self, places=self.places + shift, shared=self.shared + covariance, last=self.last + shift)

    def _velocity(self, time_s: float, place: Array) -> Array:
        """(3,) m/s on the way to a place (3,) m; zero where it was not seen just before."""
        interval_s = time_s - self.last_s
        return np.asarray((place - self.last) / interval_s) if self._is_just_before(time_s) else np.zeros(3)

    def _is_just_before(self, time_s: float) -> bool:
        return 0.0 < time_s - self.last_s <= self.tuning.longest_interval_s

    def with_depth(self, time_s: float, shown: Estimate, ray: Array, way: Array, heartbeat: Array) -> Estimate:
        """What one plane shows, with the depth that follows from it.

        Args:
            time_s: when, seconds.
            shown: the displacement; only what it says across the ray counts.
            ray: (3,) unit vector of the plane's ray to the ring.
            way: (3,) unit vector along which it breathes.
            heartbeat: (3, 3) m² of the heart's own motion.
        """
        axes, middle = _across(ray, way), self.places.mean(axis=0)
        off = shown.displacement - middle
        terms = _terms(self.places - middle, self.velocities, axes)
        (here,) = _terms(off[None], self._velocity(time_s, shown.displacement)[None], axes)
        beat = float(ray @ heartbeat @ ray)
        depths, errors = (self.places - middle) @ ray, self._errors(ray, beat)
        vague = float((self.shared @ ray @ ray).max())
        means, variances, slopes, odds = self._by_size(time_s, terms, here, depths, errors, beat, vague)
        # Where the plane has it is not sure, either: the function's slope makes depth of that.
        across = slopes @ axes
        variances = variances + ((across @ shown.covariance) * across).sum(axis=1)
        shares = np.exp(odds - odds.max())
        shares /= shares.sum()
        depth = float(shares @ means)
        variance = float(shares @ (variances + np.square(means - depth)))
        flat, along = _IDENTITY_3 - np.outer(ray, ray), np.outer(ray, ray)
        return Estimate(middle + flat @ off + depth * ray, flat @ shown.covariance @ flat + variance * along)

    def _errors(self, ray: Array, beat: float) -> Array:
        """(N, N) m² of the places' depths: their own errors, those that several share, and the heartbeat's m²."""
        own, shared = self.covariances @ ray @ ray, np.sqrt(self.shared @ ray @ ray)
        share = self.tuning.common_share
        common = share * np.sqrt(np.outer(own, own)) + np.outer(shared, shared)
        return np.asarray(common + np.diag((1.0 - share) * own + beat))

    def _by_size(
        self, time_s: float, terms: Array, here: Array, depths: Array, errors: Array, beat: float, vague: float
    ) -> tuple[Array, Array, Array, Array]:
        """The depth at a time, for each size S of what the function leaves over.

        Args:
            time_s: when, seconds.
            terms: (N, 5) of the places.
            here: (5,) of the one at that time.
            depths: (N,) of the places from their mean, metres.
            errors: (N, N) m² of those depths.
            beat: m² of the heartbeat along the ray.
            vague: m² of the mean depth, by what the places share.

        Returns:
            (S,) metres from their mean; (S,) m²; (S, 2) metres of depth per metre across; (S,) log odds of the size.
        """
        tuning = self.tuning
        sizes, odds = np.array(tuning.sizes).T
        prior = np.square([tuning.mean_m, tuning.slope, tuning.slope, tuning.speed_s, tuning.bend_per_m])
        prior[0] += vague
        lasting, noise, scales = tuning.lasting_m**2, tuning.noise_m**2, np.square(sizes)
        apart = np.abs(self.times_s[:, None] - self.times_s)
        left = lasting * np.exp(-apart / tuning.lasting_s) + noise * np.eye(len(apart))
        since = lasting * np.exp(-np.abs(time_s - self.times_s) / tuning.lasting_s)
        known = (terms * prior) @ terms.T + errors + scales[:, None, None] * left
        cross = terms @ (prior * here) + scales[:, None] * since
        speeds = terms[:, 3]
        told = np.stack([np.broadcast_to(one, cross.shape) for one in (depths, cross, speeds)], axis=-1)
        of_depths, of_cross, of_speeds = np.moveaxis(np.linalg.solve(known, told), -1, 0)
        likely = np.log(odds) - 0.5 * (np.linalg.slogdet(known)[1] + of_depths @ depths)
        variances = prior @ np.square(here) + scales * (lasting + noise) + beat - (cross * of_cross).sum(axis=1)
        if not self._is_just_before(time_s):
            # How fast it goes is not known, and what that makes of the depth only so well.
            a_second = np.square(prior[3] * (of_depths @ speeds)) + prior[3] - prior[3] ** 2 * (of_speeds @ speeds)
            variances = variances + a_second * max(np.square(speeds).mean(), tuning.usual_speed_m_s**2)
        return (cross * of_depths).sum(axis=1), variances, prior[1:3] * (of_depths @ terms[:, 1:3]), likely


def _across(ray: Array, way: Array) -> Array:
    """(2, 3) unit vectors across a ray (3,), the first along the breath's way (3,) as far as that is not along it."""
    first = way - (way @ ray) * ray
    size = math.sqrt(first @ first)
    if size < _SMALLEST:
        return np.asarray(reflected_axes(ray[None])[0])
    first = first / size
    return np.stack([first, cross(ray, first)])


def _terms(places: Array, velocities: Array, axes: Array) -> Array:
    """(N, 5) what depth is a linear function of.

    Args:
        places: (N, 3) from their mean, metres.
        velocities: (N, 3) m/s.
        axes: (2, 3) unit vectors across the ray, the first along the breath.
    """
    along, beside = (places @ axes.T).T
    return np.column_stack([np.ones(len(along)), along, beside, velocities @ axes[0], np.square(along)])
