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
from functools import cache, cached_property

import numpy as np
import numpy.typing as npt

from lasso_motion_ros.core.compiled import has_kernels
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
    """What the pairs so far tell; of arrays the first axis is the planes'.

    Attributes:
        tuning: what is expected.
        told: (2, A) log odds that a plane shows nothing of the ring on each arc of `_arcs`.
        variances: (2,) of a segment's evidence about what is usual of a whole ring.
        count: pairs that they were learned from.
        share: how much of it is gone by the last pair, if any is, 0 to 1.
    """

    tuning: WithdrawalTuning
    told: Array
    variances: Array
    count: float
    share: float = 0.0

    @staticmethod
    def first(tuning: WithdrawalTuning) -> Withdrawal:
        """Of a ring that is whole."""
        told = np.full((len(PLANES), len(_arcs())), -tuning.there)
        return Withdrawal(tuning, told, np.full(len(PLANES), tuning.variance), tuning.pairs)

    @cached_property
    def probability(self) -> float:
        """Probability that a part of the ring is gone."""
        odds = self.tuning.prior * float(np.exp(self.told[0] + self.told[1]).mean())
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
        evidence = np.array([shown[plane] for plane in PLANES], dtype=np.float64)
        of_ring = _by_segment(np.array([usual[plane] for plane in PLANES], dtype=np.float64))
        middle = np.sort(of_ring, axis=1)[:, SEGMENTS // 2, None]
        expected = np.maximum(np.minimum(of_ring, middle), tuning.weakest)
        # What lies outside the image tells nothing, nor does what lies there in part.
        expected[_by_segment((evidence == 0.0).astype(np.float64)) > 0.0] = 0.0
        by_segment = _by_segment(evidence)
        tells = _tells(by_segment, expected, self.variances, tuning)
        told = np.minimum(np.maximum(tuning.kept * self.told + tells, -tuning.there), tuning.gone)
        longest = _arcs()[np.argmax(tells[0] + tells[1])]
        later = replace(self, told=told, share=float(longest.mean()))
        if later.probability > 0.5:
            return later
        count = min(self.count + 1.0, tuning.memory)
        scatter = np.maximum(_scatter(by_segment, expected, tuning), tuning.least_variance)
        return replace(later, variances=self.variances + (scatter - self.variances) / count, count=count)


def _tells(shown: Array, expected: Array, variances: Array, tuning: WithdrawalTuning) -> Array:
    """(2, A) log odds of nothing there against the ring there, for each arc, by the gain of the rest of the ring.

    Of an arc of which less than the shortest one is known, nothing.

    Args:
        shown: (2, S) evidence of each segment,
        expected: and of the ring, if it is there; zero where nothing is known.
        variances: (2,) of a segment's.
        tuning: between which gains.
    """
    if has_kernels():
        from lasso_motion_ros.ring.kernels.withdrawal import tells

        odds: Array = tells(shown, expected, variances, _SHORTEST, _LONGEST, *tuning.gains)
        return odds
    cross, energy = shown * expected, expected * expected
    on_cross, on_energy = cross @ _arcs().T, energy @ _arcs().T
    rest = cross.sum(axis=1, keepdims=True) - on_cross
    gain = np.clip(rest / np.maximum(energy.sum(axis=1, keepdims=True) - on_energy, 1e-6), *tuning.gains)
    is_known = (expected > 0.0).astype(np.float64) @ _arcs().T > _SHORTEST - 0.5
    odds = (gain * gain * on_energy - 2.0 * gain * on_cross) / (2.0 * variances[:, None])
    return np.asarray(np.where(is_known, odds, 0.0))


def _scatter(shown: Array, expected: Array, tuning: WithdrawalTuning) -> Array:
    """(2,) mean squared difference of (2, S) evidence from what is expected, the gain left out."""
    is_known = expected > 0.0
    gain = np.clip((shown * expected).sum(axis=1) / np.maximum((expected**2).sum(axis=1), 1e-6), *tuning.gains)
    off = np.square(shown - gain[:, None] * expected) * is_known
    return np.asarray(off.sum(axis=1) / np.maximum(is_known.sum(axis=1), 1))


def _by_segment(values: Array) -> Array:
    """(2, S) means of values (2, L) along the curve."""
    starts = np.arange(SEGMENTS) * values.shape[1] // SEGMENTS
    return np.asarray(np.add.reduceat(values, starts, axis=1) / np.diff(starts, append=values.shape[1]))


@cache
def _arcs() -> Array:
    """(A, S) 1 where an arc holds a segment, else 0; the curve is taken to be closed, as it nearly is."""
    segment = np.arange(SEGMENTS)
    return np.array(
        [(segment - first) % SEGMENTS < count for count in range(_SHORTEST, _LONGEST + 1) for first in range(SEGMENTS)],
        dtype=np.float64,
    )
