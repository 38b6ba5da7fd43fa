"""Whether the planes show one and the same thing: the gap between their rays, pair after pair.

Both planes see how the ring moves along the normal of their epipolar plane. Where they do not agree on it, the heart
may have moved the ring between their exposures: then each pair has a gap of its own. Or one plane shows something else,
ECG electrodes that lie still, say, while the other plane shows the ring breathe: then the gap is as smooth as a breath,
from pair to pair. Of two models of the gap the one is right that foretells it better.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace

import numpy as np
import numpy.typing as npt

from lasso_motion_ros.core.logistic import logistic
from lasso_motion_ros.motion import matern

Array = npt.NDArray[np.float64]


@dataclass(frozen=True)
class ContradictionTuning:
    """What is expected of the gap, either way."""

    odds: float = -4.0  # natural logarithm, that the planes contradict each other, before any gap is known
    size_mm: float = 3.0  # standard deviation of a gap that breathes,
    time_scale_s: float = 1.0  # as smooth as breathing,
    noise_mm: float = 0.4  # and what else it holds
    agreement_mm: float = 0.15  # of planes that agree, besides what moves between their exposures
    freedom: float = 4.0  # degrees of freedom of the latter: some beats are stronger than others
    most: float = 3.0  # log odds that one pair may tell, either way
    surest: float = 6.0  # and that all together may
    memory_s: float = 10.0  # what they told fades: planes that agreed may contradict now, and the reverse


@dataclass(frozen=True, eq=False)
class PlaneContradiction:
    """What the gaps so far tell.

    Attributes:
        tuning: what is expected of them.
        evidence: log odds that the planes contradict each other, by the gaps alone.
        time_s: of the last gap, seconds since the seed pair.
        state: (3,) the gap that breathes, mm, with its first two derivatives.
        covariance: (3, 3) of that.
        squares: weighted sum of the squared gaps, mm², the last ones counting most,
        count: and of their weights.
    """

    tuning: ContradictionTuning
    evidence: float = 0.0
    time_s: float = 0.0
    state: Array = field(default_factory=lambda: np.zeros(3))
    covariance: Array | None = None
    squares: float = 0.0
    count: float = 0.0

    @property
    def probability(self) -> float:
        """Probability that one of the planes shows something else."""
        return logistic(self.evidence + self.tuning.odds)

    @property
    def size_mm(self) -> float:
        """Root mean square of the gaps of late, mm: a small contradiction misleads nobody."""
        return math.sqrt(self.squares / self.count) if self.count > 0.0 else 0.0

    @property
    def text(self) -> str:
        """What is to be said of it."""
        return f"the planes disagree by {self.size_mm:.1f} mm, as the breath goes: one of them shows something else?"

    def after(self, time_s: float, gap_mm: float, slack_mm: float) -> PlaneContradiction:
        """What is known with one more gap.

        Args:
            time_s: of the pair, seconds since the seed pair.
            gap_mm: signed.
            slack_mm: what the motion between the exposures may add to it, standard deviation.
        """
        tuning, interval_s = self.tuning, max(time_s - self.time_s, 0.0)
        unknown = tuning.size_mm**2 * matern.stationary(tuning.time_scale_s)
        passage = matern.transition(interval_s, tuning.time_scale_s)
        known = unknown if self.covariance is None else self.covariance
        state, covariance = passage @ self.state, unknown + passage @ (known - unknown) @ passage.T
        variance = float(covariance[0, 0]) + tuning.noise_mm**2
        breathes = _log_normal(gap_mm - float(state[0]), variance)
        told = breathes - _log_student(gap_mm, slack_mm**2 + tuning.agreement_mm**2, tuning.freedom)
        kept = math.exp(-interval_s / tuning.memory_s)
        evidence = self.evidence * kept + min(max(told, -tuning.most), tuning.most)
        gain = covariance[:, 0] / variance
        return replace(
            self,
            evidence=min(max(evidence, -tuning.surest), tuning.surest),
            time_s=time_s,
            state=state + gain * (gap_mm - float(state[0])),
            covariance=covariance - np.outer(gain, covariance[0]),
            squares=self.squares * kept + gap_mm**2,
            count=self.count * kept + 1.0,
        )


def _log_normal(off: float, variance: float) -> float:
    return -0.5 * (math.log(2.0 * math.pi * variance) + off**2 / variance)


def _log_student(off: float, variance: float, freedom: float) -> float:
    """Logarithm of Student's density about zero, its scale squared being `variance`."""
    scale = (
        math.lgamma(0.5 * (freedom + 1.0)) - math.lgamma(0.5 * freedom) - 0.5 * math.log(freedom * math.pi * variance)
    )
    return scale - 0.5 * (freedom + 1.0) * math.log1p(off**2 / (freedom * variance))
