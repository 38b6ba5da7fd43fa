"""Whether a part of the ring is gone: an arc on which both planes show nothing of it, though they show the rest.

A ring that is drawn into its sheath slides along its own curve. Its electrodes come to lie where others were, pole by
pole, and what is left of it looks like the ring in both planes; only an arc of it is missing, in both planes the same
one, and it grows. Something that lies over the ring takes an arc from it as well, but in one plane, and may stay there
as long as it likes; and an ablation tip that lay on the ring while its looks were learned leaves an arc that shows
less. So nothing is asked of an arc that the middle one of all does not show; every arc is a hypothesis, and each plane
tells by itself, over the pairs, whether it shows the ring there, but never more than that something lies over a ring
now and then.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cache

import numpy as np
import numpy.typing as npt

from lasso_motion_ros.geometry.frames import PLANES, Plane
from lasso_motion_ros.ring.working_image import Image

Array = npt.NDArray[np.float64]

SEGMENTS = 24  # of the curve, each a third of the distance between the poles of a ring of eight
_SHORTEST, _LONGEST = 5, 14  # segments of an arc: less may be where an ablation tip was; of more the ring is lost


@dataclass(frozen=True)
class WithdrawalTuning:
    """What is expected of a ring that is whole, and of one that is not (docs/constants.md)."""

    prior: float = 0.01  # that a part of it is gone, whichever
    # Natural logarithms of odds, that a plane may tell of an arc, over all pairs: that it is gone (something hides an
    # arc of a whole ring in one plane in 1 of 200), and that it is there (what has gone must be noticed soon).
    gone: float = 5.3
    there: float = 2.5
    kept: float = 0.8  # of what a pair told, with the next one
    variance: float = 0.2  # of a segment's evidence about what is usual, at first
    least_variance: float = 0.05
    pairs: float = 4.0  # that this counts as many as
    memory: float = 20.0  # pairs over which it is learned
    weakest: float = 0.05  # expected evidence of a segment, at least
    gains: tuple[float, float] = (0.3, 1.2)  # of what is usual, that the rest of the ring may show in one pair


@dataclass(frozen=True, eq=False)
class Withdrawal:
    """What the pairs so far tell.

    Attributes:
        tuning: what is expected.
        told: per plane, (A,) log odds that it shows nothing of the ring on each arc of `_arcs`.
        variances: per plane, of a segment's evidence about what is usual of a whole ring.
        count: pairs that they were learned from.
        share: how much of it is gone by the last pair, if any is, 0 to 1.
    """

    tuning: WithdrawalTuning
    told: dict[Plane, Array]
    variances: dict[Plane, float]
    count: float
    share: float = 0.0

    @staticmethod
    def first(tuning: WithdrawalTuning) -> Withdrawal:
        """Of a ring that is whole."""
        told = {plane: np.full(len(_arcs()), -tuning.there) for plane in PLANES}
        return Withdrawal(tuning, told, dict.fromkeys(PLANES, tuning.variance), tuning.pairs)

    @property
    def probability(self) -> float:
        """Probability that a part of the ring is gone."""
        odds = self.tuning.prior * float(np.exp(self.told["a"] + self.told["b"]).mean())
        return odds / (1.0 + odds)

    @property
    def text(self) -> str:
        """What is to be said of it."""
        return f"both planes show nothing on {100 * self.share:.0f} % of the lasso: drawn into its sheath?"

    def after(self, shown: Mapping[Plane, Image], usual: Mapping[Plane, Image]) -> Withdrawal:
        """What is known with one more pair.

        Args:
            shown: per plane, (L,) the evidence along the ring's curve in this pair; zero outside the image.
            usual: per plane, (L,) that of the pairs so far in the mean.
        """
        tuning = self.tuning
        planes = {plane: _Segments.of(shown[plane], usual[plane], tuning) for plane in PLANES}
        tells = {plane: one.told(_arcs(), self.variances[plane], tuning) for plane, one in planes.items()}
        told = {
            plane: np.clip(tuning.kept * self.told[plane] + odds, -tuning.there, tuning.gone)
            for plane, odds in tells.items()
        }
        likeliest = _arcs()[np.argmax(tells["a"] + tells["b"])]
        later = replace(self, told=told, share=float(likeliest.mean()))
        if later.probability > 0.5:
            return later
        count = min(self.count + 1.0, tuning.memory)
        variances = {
            plane: variance + (max(planes[plane].scatter(tuning), tuning.least_variance) - variance) / count
            for plane, variance in self.variances.items()
        }
        return replace(later, variances=variances, count=count)


@dataclass(frozen=True, eq=False)
class _Segments:
    """The evidence of one plane, segment by segment of the curve.

    Attributes:
        shown: (S,) in this pair.
        expected: (S,) of the ring, if it is there.
    """

    shown: Array
    expected: Array

    @staticmethod
    def of(shown: Image, usual: Image, tuning: WithdrawalTuning) -> _Segments:
        """From the evidence (L,) along the curve in this pair, and as it is usual."""
        of_ring = _by_segment(usual)
        expected = np.maximum(np.minimum(of_ring, np.median(of_ring)), tuning.weakest)
        # What lies outside the image tells nothing.
        return _Segments(_by_segment(shown), np.where(_by_segment(np.abs(shown)) > 0.0, expected, 0.0))

    def told(self, arcs: Array, variance: float, tuning: WithdrawalTuning) -> Array:
        """(A,) log odds of nothing there against the ring there, for each arc, by the gain of the rest of the ring."""
        cross, energy = self.shown * self.expected, self.expected * self.expected
        on_cross, on_energy = arcs @ cross, arcs @ energy
        rest = (cross.sum() - on_cross) / np.maximum(energy.sum() - on_energy, 1e-6)
        gain = np.clip(rest, *tuning.gains)
        return np.asarray((gain * gain * on_energy - 2.0 * gain * on_cross) / (2.0 * variance))

    def scatter(self, tuning: WithdrawalTuning) -> float:
        """Mean squared difference from what is expected, the gain left out."""
        gain = np.clip((self.shown @ self.expected) / max(float(self.expected @ self.expected), 1e-6), *tuning.gains)
        off = np.square(self.shown - gain * self.expected)[self.expected > 0.0]
        return float(off.mean()) if off.size else 0.0


def _by_segment(values: Image) -> Array:
    """(S,) means of values (L,) along the curve."""
    starts = np.arange(SEGMENTS) * len(values) // SEGMENTS
    counts = np.diff(starts, append=len(values))
    return np.asarray(np.add.reduceat(values.astype(np.float64), starts) / counts)


@cache
def _arcs() -> Array:
    """(A, S) 1 where an arc holds a segment, else 0; the curve is taken to be closed, as it nearly is."""
    segment = np.arange(SEGMENTS)
    return np.array(
        [(segment - first) % SEGMENTS < count for count in range(_SHORTEST, _LONGEST + 1) for first in range(SEGMENTS)],
        dtype=np.float64,
    )
