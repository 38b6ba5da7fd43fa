"""Whether the planes show one and the same thing: the gap between their rays, pair after pair.

Both planes see how the ring moves along the normal of their epipolar plane. Where they do not agree on it, the heart
may have moved the ring between their exposures: then the gap is as large as that, whatever the breath does. Or one
plane shows something else, ECG electrodes that lie still, say, while the other plane shows the ring breathe: then the
gap goes as the breath goes. Of two models of the gap the one is right that foretells it better. (A regular heart that
is in step with the exposures, or nearly so, makes a smooth gap, too: smoothness alone proves nothing.)
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from lasso_motion_ros.core.logistic import logistic

Array = npt.NDArray[np.float64]


@dataclass(frozen=True)
class ContradictionTuning:
    """What is expected of the gap, either way."""

    odds: float = -4.0  # natural logarithm, that the planes contradict each other, before any gap is known
    # Of a plane that shows what lies still the gap is twice as far as the ring was seen to go by both planes together;
    # less where it shows what breathes otherwise.
    shares: tuple[float, ...] = (-2.0, -1.2, -0.6, 0.6, 1.2, 2.0)
    offset_mm: float = 1.0  # what such a gap is where the ring was at first, standard deviation,
    change_mm: float = 0.3  # and by how much that changes in a second
    noise_mm: float = 0.4  # what else it holds, besides what moves between the exposures
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
        evidence: (S,) log odds that the planes contradict each other by each of the shares, by the gaps alone.
        time_s: of the last gap, seconds since the seed pair.
        offsets: (S,) what the gap is at the ring's first place then, mm,
        variances: and (S,) mm² of that.
        squares: weighted sum of the squared gaps, mm², the last ones counting most,
        count: and of their weights.
        home_mm: where it belongs along the direction of the gap, from the seed pair's place; None: where it is next.
    """

    tuning: ContradictionTuning
    evidence: Array
    offsets: Array
    variances: Array
    time_s: float = 0.0
    squares: float = 0.0
    count: float = 0.0
    home_mm: float | None = 0.0

    @staticmethod
    def first(tuning: ContradictionTuning) -> PlaneContradiction:
        """Before any gap is known."""
        count = len(tuning.shares)
        return PlaneContradiction(tuning, np.zeros(count), np.zeros(count), np.full(count, tuning.offset_mm**2))

    def anew(self) -> PlaneContradiction:
        """Of a ring that belongs elsewhere from now on."""
        return replace(PlaneContradiction.first(self.tuning), time_s=self.time_s, home_mm=None)

    @property
    def probability(self) -> float:
        """Probability that one of the planes shows something else."""
        return logistic(float(np.logaddexp.reduce(self.evidence)) - math.log(len(self.evidence)) + self.tuning.odds)

    @property
    def size_mm(self) -> float:
        """Root mean square of the gaps of late, mm: a small contradiction misleads nobody."""
        return math.sqrt(self.squares / self.count) if self.count > 0.0 else 0.0

    @property
    def text(self) -> str:
        """What is to be said of it."""
        return f"the planes disagree by {self.size_mm:.1f} mm, as the breath goes: one of them shows something else?"

    def after(self, time_s: float, gap_mm: float, slack_mm: float, along_mm: float) -> PlaneContradiction:
        """What is known with one more gap.

        Args:
            time_s: of the pair, seconds since the seed pair.
            gap_mm: signed.
            slack_mm: what the motion between the exposures may add to it, standard deviation.
            along_mm: how far the ring has gone along the direction of the gap since the seed pair, by both planes.
        """
        tuning, interval_s = self.tuning, max(time_s - self.time_s, 0.0)
        home_mm = along_mm if self.home_mm is None else self.home_mm
        variances = self.variances + interval_s * tuning.change_mm**2
        off = gap_mm - np.asarray(tuning.shares) * (along_mm - home_mm) - self.offsets
        expected = variances + slack_mm**2 + tuning.noise_mm**2
        agrees = _log_student(np.array([gap_mm]), np.array([slack_mm**2 + tuning.agreement_mm**2]), tuning.freedom)
        told = _log_student(off, expected, tuning.freedom) - agrees
        kept = math.exp(-interval_s / tuning.memory_s)
        evidence = self.evidence * kept + np.clip(told, -tuning.most, tuning.most)
        gain = variances / expected
        return replace(
            self,
            evidence=np.clip(evidence, -tuning.surest, tuning.surest),
            offsets=self.offsets + gain * off,
            variances=variances * (1.0 - gain),
            time_s=time_s,
            squares=self.squares * kept + gap_mm**2,
            count=self.count * kept + 1.0,
            home_mm=home_mm,
        )


def _log_student(off: Array, variance: Array, freedom: float) -> Array:
    """(N,) logarithms of Student's density about zero, the squares of its scale being `variance` (N,)."""
    scale = math.lgamma(0.5 * (freedom + 1.0)) - math.lgamma(0.5 * freedom) - 0.5 * np.log(freedom * np.pi * variance)
    return np.asarray(scale - 0.5 * (freedom + 1.0) * np.log1p(off**2 / (freedom * variance)))
