"""Whether the ring is in its place, elsewhere, or out of view: probabilities, and what a state asks of them.

A hidden Markov model with three states, in place, displaced and absent, is told of each pair: how probable it is that
what was detected is the ring, and how far from breathing it is. What is out of view was somewhere, and is to be
expected there again: so the last state is two. Whether it is in its place follows by the probabilities below; what else
makes it LOST or DEGRADED: `ring/validation.py`.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]


@dataclass(frozen=True)
class StateTuning:
    """Chances of a change, and the probabilities that a state asks for."""

    # Chances of a change, per second.
    leaves_per_s: float = 0.01
    returns_per_s: float = 0.01
    vanishes_per_s: float = 0.05
    appears_per_s: float = 0.5
    # Where it comes into view again, of 1: in its place if it vanished there, and if it vanished elsewhere.
    comes_back: float = 0.8
    comes_home: float = 0.03
    elsewhere_sigmas: float = 3.3  # off the curve: as likely displaced as in place
    along_share: float = 0.1  # of what is displaced, goes the way of a breath
    largest_sigmas: float = 6.0  # no one pair may say more
    surprise_sigmas: float = 1.8  # of the filter's, sideways, count for one: hearts surprise it more than normally
    # Likewise before a breath is complete, when nothing else tells of a hand; but not before the heart had time for a
    # beat.
    first_surprise_sigmas: float = 1.3
    longest_beat_s: float = 1.25
    # Of being in place, and the detection being the ring:
    tracking: float = 0.97  # with less a pose is DEGRADED
    pose: float = 0.9  # with less there is none
    displaced: float = 0.6  # of being elsewhere
    # Of the detection being the ring, for its looks to be learned, pose or not: among many pairs one that is mistaken
    # does no harm, and a faint ring is believed only once it is known better.
    learned: float = 0.7
    # Of the pose being off by more than this, in whichever direction:
    misleading_mm: float = 2.0
    misleads_tracking: float = 0.01  # with more a pose is DEGRADED,
    misleads_pose: float = 0.05  # and with more than this there is none: it is within that in 19 of 20 cases

    def surprise(self, time_s: float, *, is_complete: bool) -> float:
        """How many standard deviations of the filter's, sideways, count for one.

        Args:
            time_s: since the seed pair.
            is_complete: a breath has been seen from its beginning to its end.
        """
        is_first = not is_complete and time_s > self.longest_beat_s
        return self.first_surprise_sigmas if is_first else self.surprise_sigmas

    @property
    def misleading_m(self) -> float:
        """How far off a pose misleads, metres."""
        return 1e-3 * self.misleading_mm


@dataclass(frozen=True)
class TrackBelief:
    """Probabilities of the states.

    Attributes:
        in_place: the ring moves with the atrium.
        elsewhere: it is seen, but moves otherwise.
        hidden: it is out of view, or hidden, and was in its place before.
        hidden_elsewhere: likewise, and was elsewhere.
    """

    in_place: float = 1.0
    elsewhere: float = 0.0
    hidden: float = 0.0
    hidden_elsewhere: float = 0.0

    @property
    def absent(self) -> float:
        """Probability that it is out of view, wherever it is."""
        return self.hidden + self.hidden_elsewhere

    @property
    def away(self) -> float:
        """Probability that it is not in its place, in view or not."""
        return self.elsewhere + self.hidden_elsewhere

    def after(
        self,
        interval_s: float,
        seen: float,
        sigmas: float,
        tuning: StateTuning,
        companions: float = 0.0,
        turned: float = 0.0,
    ) -> TrackBelief:
        """The belief after a pair.

        Args:
            interval_s: since the pair before, seconds.
            seen: probability that what was detected is the ring.
            sigmas: how far it lies off the breathing curve, standard deviations.
            tuning: chances of a change.
            companions: log odds that it is in its place by what moves with the heart beside it. They only speak against
                it: a ring that is near them may be one that slides.
            turned: log odds that a hand has put it elsewhere, by how it is turned.
        """
        before = self._changed(interval_s, tuning)
        on_curve = np.exp(-0.5 * min(sigmas, tuning.largest_sigmas) ** 2)
        believed = np.exp(min(companions, 0.0))
        fits = on_curve * believed
        # Where they deny it, it may as well have been taken the way of a breath, where the curve does not tell.
        other = np.exp(-0.5 * tuning.elsewhere_sigmas**2) + tuning.along_share * on_curve * (1.0 - believed)
        other *= np.exp(turned)
        nothing = (1.0 - seen) * max(fits, other)
        likelihood = np.array([seen * fits, seen * other, nothing, nothing])
        now = before * (likelihood + 1e-9)
        return TrackBelief(*(now / now.sum()).tolist())

    def _changed(self, interval_s: float, tuning: StateTuning) -> Array:
        leaves, returns, vanishes, appears = (
            1.0 - np.exp(-rate * interval_s)
            for rate in (tuning.leaves_per_s, tuning.returns_per_s, tuning.vanishes_per_s, tuning.appears_per_s)
        )
        change = np.array(
            [
                [1.0 - leaves - vanishes, leaves, vanishes, 0.0],
                [returns, 1.0 - returns - vanishes, 0.0, vanishes],
                [tuning.comes_back * appears, (1.0 - tuning.comes_back) * appears, 1.0 - appears, 0.0],
                [tuning.comes_home * appears, (1.0 - tuning.comes_home) * appears, 0.0, 1.0 - appears],
            ]
        )
        # Out of view it may be moved as well.
        hands = np.array([[1.0 - leaves, leaves], [returns, 1.0 - returns]])
        change[:, 2:] = change[:, 2:] @ hands
        return np.asarray(np.array([self.in_place, self.elsewhere, self.hidden, self.hidden_elsewhere]) @ change)
