"""How far the ring has slid from what moves with the heart beside it: two models of that, weighed by what pairs show.

One pair tells it to half a millimetre or worse, by how unlike ring and companions beat and breathe; a slide lasts. A
filter that lets the ring wander follows a slide of half a millimetre a second a millimetre late, and is sure of it. So
there are two: the ring *stands*, or it *slides* with a velocity of its own, which is learned from pair to pair; what
each of them foretold tells how probable it is (interacting multiple models: Blom and Bar-Shalom, IEEE Transactions on
Automatic Control 33(8), 1988).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from lasso_motion_ros.core.compiled import has_kernels
from lasso_motion_ros.core.logistic import logistic
from lasso_motion_ros.geometry.covariance import inverses, largest_sigma, log_student, probability_beyond
from lasso_motion_ros.geometry.frames import PLANES
from lasso_motion_ros.ring.slide import Slide

Array = npt.NDArray[np.float64]

STANDS, SLIDES = 0, 1
PLACE, SPEED = slice(0, 3), slice(3, 6)
_IDENTITY_2, _IDENTITY_3 = np.eye(2), np.eye(3)


@dataclass(frozen=True)
class CompanionSlideTuning:
    """How a ring slides, and what is known of that at first."""

    first_m: float = 1e-4  # standard deviation in the seed pair: it is where it was clicked
    wander_m: float = 1.5e-4  # in a second, of what goes with the heart only nearly as the companions do
    begins_per_s: float = 0.005  # chance that it begins to slide,
    rests_per_s: float = 0.02  # and that it comes to rest
    speed_m_s: float = 4e-4  # of a slide, standard deviation in each direction
    freedom: float = 4.0  # of Student's distribution of what one pair shows
    spacing_s: float = 0.25  # pairs nearer in time share a heartbeat, and tell less each,
    breath_s: float = 1.5  # and so near a way into the breath, on which companions are learned about as well or badly
    # What is so unlike what was known, twice: a hand has put it there, anywhere within a standard deviation of this.
    unlike: float = 25.0  # squared Mahalanobis distance, for each plane
    put_m: float = 7e-3
    known_m: float = 8e-4  # in every direction: then companions tell of a slide what the ring's own past cannot,
    known_for_s: float = 2.0  # for so long after both planes have shown some
    own_m: float = 4e-4  # to which the ring's own past tells how far it has slid across its breathing


@dataclass(frozen=True, eq=False)
class SlideSight:
    """How far the ring is from where companions have it, as a plane shows it.

    Attributes:
        across: (2, 3) unit vectors across its ray.
        value: (2,) metres along them.
        noise: m² along either, another one with each heartbeat.
        learned: m² besides, by how far it is known where companions have it; the same for a part of a breath.
    """

    across: Array
    value: Array
    noise: float
    learned: float


@dataclass(frozen=True, eq=False)
class CompanionSlide:
    """The ring's place by that of its companions, as far as it is known.

    Attributes:
        tuning: how a ring slides.
        states: (2, 6) of a ring that stands, and of one that slides: from where they have it, metres, and m/s.
        covariances: (2, 6, 6) m², m²/s and m²/s².
        log_odds_of_slide: natural logarithm of the odds that it slides, or has.
        since_s: time since a plane has shown companions, seconds; minus infinity where none has.
        unseen_s: time since both planes have, seconds.
        was_unlike: whether the last pair that showed some was unlike what was known before.
        directions: (3, 3) onto those in which they told of it last.
        trust: probability that it is the ring that has moved, where they tell that ring and device have parted.
    """

    tuning: CompanionSlideTuning
    states: Array
    covariances: Array
    log_odds_of_slide: float = -20.0
    since_s: float = -math.inf
    unseen_s: float = math.inf
    was_unlike: bool = False
    directions: Array = field(default_factory=lambda: np.eye(3))
    trust: float = 1.0

    @staticmethod
    def first(tuning: CompanionSlideTuning) -> CompanionSlide:
        """In the seed pair."""
        return CompanionSlide.at(tuning, np.zeros(3), tuning.first_m**2 * _IDENTITY_3)

    @staticmethod
    def at(
        tuning: CompanionSlideTuning, offset: Array, covariance: Array, since_s: float = -math.inf
    ) -> CompanionSlide:
        """At an offset (3,) m from where companions have had it some seconds since, known to a covariance (3, 3) m²."""
        states, covariances = np.zeros((2, 6)), np.zeros((2, 6, 6))
        states[:, PLACE], covariances[:, PLACE, PLACE] = offset, covariance
        covariances[SLIDES, SPEED, SPEED] = tuning.speed_m_s**2 * _IDENTITY_3
        unseen_s = since_s if math.isfinite(since_s) else math.inf
        return CompanionSlide(tuning, states, covariances, since_s=since_s, unseen_s=unseen_s)

    def after(self, interval_s: float, shown: Sequence[SlideSight]) -> CompanionSlide:
        """After a pair.

        Args:
            interval_s: since the pair before, seconds.
            shown: by each plane that shows companions, the ring's offset from where they have it.
        """
        unseen_s = 0.0 if len(shown) == len(PLANES) else self.unseen_s + interval_s
        since_s = self.since_s + interval_s
        if not shown:  # what no plane shows is not less known than it was: it comes back by itself, or not at all
            return replace(self, since_s=since_s, unseen_s=unseen_s)
        # What is told for the first time is told by what was learned until just before.
        since_s = max(since_s, interval_s)
        tuning = self.tuning
        directions = _IDENTITY_3 if len(shown) == len(PLANES) else shown[0].across.T @ shown[0].across
        # What is shared by several pairs counts as one: each of them tells less.
        beat, breath = (max(1.0, time_s / max(since_s, 1e-3)) for time_s in (tuning.spacing_s, tuning.breath_s))
        noises = [beat * one.noise + breath * one.learned for one in shown]
        states, covariances, log_odds, is_unlike = self._taken_in(since_s, directions, shown, noises)
        return CompanionSlide(tuning, states, covariances, log_odds, 0.0, unseen_s, is_unlike, directions)

    def _taken_in(
        self, interval_s: float, directions: Array, shown: Sequence[SlideSight], noises: Sequence[float]
    ) -> tuple[Array, Array, float, bool]:
        """States, covariances and log odds with what planes show after an interval, and whether that is unlike them.

        Args:
            interval_s: seconds.
            directions: (3, 3) onto those in which it is seen.
            shown: by each plane that shows companions.
            noises: likewise, m² along either of its directions.
        """
        tuning = self.tuning
        if has_kernels():
            from lasso_motion_ros.ring.kernels.companion_slide import taken_in

            known: tuple[Array, Array, float, bool] = taken_in(
                self.states,
                self.covariances,
                self.log_odds_of_slide,
                self.was_unlike,
                interval_s,
                directions,
                np.array([one.across for one in shown]),
                np.array([one.value for one in shown]),
                np.array(noises),
                (
                    tuning.wander_m,
                    tuning.begins_per_s,
                    tuning.rests_per_s,
                    tuning.speed_m_s,
                    tuning.freedom,
                    tuning.unlike,
                    tuning.put_m,
                ),
            )
            return known
        states, covariances, log_odds = self._moved_on(interval_s, directions)
        seen = [(one.across, one.value, noise * _IDENTITY_2) for one, noise in zip(shown, noises, strict=True)]
        told = [_innovation(states, covariances, *one) for one in seen]
        is_unlike = bool(np.sum([one.far for one in told], axis=0).min() > tuning.unlike * len(shown))
        if is_put := is_unlike and self.was_unlike:
            covariances[:, PLACE, PLACE] += tuning.put_m**2 * directions
        for number, (one, (across, value, noise)) in enumerate(zip(told, seen, strict=True)):
            if number or is_put:  # models that have changed since foretell something else
                one = _innovation(states, covariances, across, value, noise)
            likelihood = log_student(one.far, one.determinant, tuning.freedom)
            log_odds += float(likelihood[SLIDES] - likelihood[STANDS])
            precision, unusual = one.precision, (tuning.freedom + one.far) / (tuning.freedom + 2.0)
            if max(unusual) > 1.0:
                # What is far off once counts for less: it is something else, or a hand, which shows at once anyway.
                precision = inverses(one.expected + np.maximum(unusual, 1.0)[:, None, None] * noise)[0]
            cross = covariances[:, :, PLACE] @ across.T
            gain = cross @ precision
            states = states + (gain @ one.value[..., None])[..., 0]
            covariances = covariances - gain @ cross.swapaxes(-1, -2)
        covariances = 0.5 * (covariances + covariances.swapaxes(-1, -2))
        log_odds = min(max(log_odds, -25.0), 25.0)
        return states, covariances, log_odds, is_unlike

    def _moved_on(self, interval_s: float, directions: Array) -> tuple[Array, Array, float]:
        """States, covariances and log odds after an interval in which it may have begun to slide, or come to rest.

        Args:
            interval_s: seconds.
            directions: (3, 3) onto those in which it is seen: in others it does not wander.
        """
        tuning, slides = self.tuning, self.probability
        begins, rests = (1.0 - math.exp(-rate * interval_s) for rate in (tuning.begins_per_s, tuning.rests_per_s))
        # What begins to slide has any velocity, what comes to rest none.
        begun, rested = self.covariances[STANDS].copy(), np.zeros((6, 6))
        begun[SPEED, SPEED] = tuning.speed_m_s**2 * _IDENTITY_3
        rested[PLACE, PLACE] = self.covariances[SLIDES, PLACE, PLACE]
        there = np.concatenate([self.states[SLIDES, PLACE], np.zeros(3)])
        stand, stand_squares, stands = _merged(
            (1.0 - slides) * (1.0 - begins),
            self.states[STANDS],
            self.covariances[STANDS],
            slides * rests,
            there,
            rested,
        )
        slide, slide_squares, now_slides = _merged(
            slides * (1.0 - rests),
            self.states[SLIDES],
            self.covariances[SLIDES],
            (1.0 - slides) * begins,
            self.states[STANDS],
            begun,
        )
        slide[PLACE] += interval_s * slide[SPEED]
        slide_squares[PLACE] += interval_s * slide_squares[SPEED]
        slide_squares[:, PLACE] += interval_s * slide_squares[:, SPEED]
        states, covariances = np.array([stand, slide]), np.array([stand_squares, slide_squares])
        covariances[:, PLACE, PLACE] += tuning.wander_m**2 * interval_s * directions
        return states, covariances, math.log(now_slides / stands)

    def joined(self, own: Slide) -> CompanionSlide:
        """With what the ring's own past tells of a slide: it does not count for later pairs, which tell it anew."""
        # What one plane alone shows to leave the ring may be a device that a hand moves: as likely as not, unless the
        # ring's own past tells.
        trust = logistic(max(own.log_odds, 0.0)) if self._is_of_one_plane else 1.0
        if own.log_odds <= 0.0:
            return self if trust == self.trust else replace(self, trust=trust)
        tuning, across = self.tuning, np.asarray(own.across)
        size = float(np.linalg.norm(across))
        state, covariance = self.states[SLIDES], self.covariances[SLIDES].copy()
        # A slide has gone on since their last word, or begun.
        gone_on_m = tuning.speed_m_s * max(self.since_s, 0.0)
        covariance[PLACE, PLACE] += gone_on_m**2 * _IDENTITY_3
        cross = covariance[:, PLACE] @ (across / size)
        variance = float(across @ cross[PLACE]) / size + tuning.own_m**2
        innovation = size - float(across @ state[PLACE]) / size
        states, covariances = self.states.copy(), self.covariances.copy()
        states[SLIDES] = state + cross * (innovation / variance)
        covariances[SLIDES] = covariance - np.outer(cross, cross) / variance
        # Where they tell of another way it is the less likely that either slides.
        log_odds = self.log_odds_of_slide + own.log_odds - 0.5 * innovation**2 / variance
        log_odds = min(max(log_odds, -25.0), 25.0)
        return replace(self, states=states, covariances=covariances, log_odds_of_slide=log_odds, trust=trust)

    def hidden(self, own: Slide) -> Slide:
        """The part of a slide by the ring's own past of which companions tell nothing: one plane alone shows them."""
        if not self._is_of_one_plane:
            return Slide()
        x, y, z = ((_IDENTITY_3 - self.directions) @ np.asarray(own.across)).tolist()
        return Slide((x, y, z), own.log_odds)

    @property
    def _is_of_one_plane(self) -> bool:
        """Whether only one plane had shown companions for a while when the last word on them came."""
        return self.unseen_s - self.since_s > self.tuning.known_for_s

    @property
    def probability(self) -> float:
        """That it slides, or has slid."""
        return logistic(self.log_odds_of_slide)

    @property
    def offset(self) -> Array:
        """(3,) from where companions have it, metres."""
        slides = self.probability
        return np.asarray((1.0 - slides) * self.states[STANDS, PLACE] + slides * self.states[SLIDES, PLACE])

    @property
    def covariance(self) -> Array:
        """(3, 3) of it, m², both models considered."""
        slides, apart = self.probability, self.states[SLIDES, PLACE] - self.states[STANDS, PLACE]
        stands, moves = self.covariances[:, PLACE, PLACE]
        return np.asarray((1.0 - slides) * stands + slides * moves + slides * (1.0 - slides) * np.outer(apart, apart))

    @property
    def size_m(self) -> float:
        """How far it has slid, metres."""
        return float(np.linalg.norm(self.offset))

    @property
    def is_known(self) -> bool:
        """Whether it is known in every direction."""
        return self.unseen_s <= self.tuning.known_for_s and largest_sigma(self.covariance) < self.tuning.known_m

    @property
    def is_told(self) -> bool:
        """Whether a plane has shown companions of late: what it does not show, the ring's own past does."""
        return self.since_s <= self.tuning.known_for_s and math.isfinite(self.since_s)

    def log_odds(self, limit_m: float) -> float:
        """Natural logarithm of the odds that it has slid by more than a limit, metres."""
        beyond = min(max(self.beyond(limit_m), 1e-12), 1.0 - 1e-12)
        return math.log(beyond / (1.0 - beyond))

    def beyond(self, limit_m: float) -> float:
        """Probability that it has slid by more than a limit, metres."""
        slides = self.probability
        stands, moves = (
            probability_beyond(limit_m, covariance[PLACE, PLACE], state[PLACE])
            for state, covariance in zip(self.states, self.covariances, strict=True)
        )
        return self.trust * ((1.0 - slides) * stands + slides * moves)


class _Innovation(NamedTuple):
    """What a plane shows beside what the two models foretold.

    Attributes:
        value: (2, 2) metres.
        expected: (2, 2, 2) m², covariances of what was foretold, without the noise.
        precision: (2, 2, 2) inverses of the values' covariances.
        determinant: (2,) of these covariances.
        far: (2,) squared Mahalanobis distances.
    """

    value: Array
    expected: Array
    precision: Array
    determinant: Array
    far: Array


def _innovation(states: Array, covariances: Array, across: Array, value: Array, noise: Array) -> _Innovation:
    innovation = value - states[:, PLACE] @ across.T
    expected = across @ covariances[:, PLACE, PLACE] @ across.T
    precision, determinant = inverses(expected + noise)
    far = (innovation * (precision @ innovation[..., None])[..., 0]).sum(axis=-1)
    return _Innovation(innovation, expected, precision, determinant, far)


def _merged(
    weight: float, state: Array, covariance: Array, other_weight: float, other: Array, other_covariance: Array
) -> tuple[Array, Array, float]:
    """Mean and covariance of a mixture of two normal distributions, and the sum of their weights."""
    total = weight + other_weight
    share, apart = other_weight / total, other - state
    mean = state + share * apart
    spread = share * (1.0 - share) * (apart[:, None] * apart)
    merged = (1.0 - share) * covariance + share * other_covariance + spread
    return mean, merged, total
