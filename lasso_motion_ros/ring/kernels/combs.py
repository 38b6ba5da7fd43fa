"""How likely combs of poles are along a ring, compiled: see `core/compiled.py`."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from lasso_motion_ros.core.compiled import compiled

Array = npt.NDArray[np.float64]
Numbers = npt.NDArray[np.int64]


@compiled(
    "void(float64[::1], float64, float64[::1], float64, float64, float64[:, ::1], int64, float64, float64,"
    " float64[::1], int64[::1])"
)
def likelihoods(
    periods: Array,
    share: float,
    pole: Array,
    table_step_mm: float,
    step_mm: float,
    compared: Array,
    seams: int,
    independent: float,
    largest_correlation: float,
    means: Array,
    likeliest: Numbers,
) -> None:
    """How likely the combs of some periods are, over all their places and seams: `electrodes._likelihoods`.

    Args:
        periods: (N,) of the combs, mm.
        share: of a pair, of the period; 0 where they are even.
        pole: (T,) one of their poles, every `table_step_mm`.
        table_step_mm: of that.
        step_mm: from place to place.
        compared: (seams times two planes, and then the slow terms, L) what combs are compared with.
        seams: how many.
        independent: how many values have noise of their own.
        largest_correlation: of one plane's evidence with a comb.
        means: (N,) logarithms of the mean likelihoods, filled.
        likeliest: (N,) place times seams, and seam, of the likeliest of each, filled.
    """
    columns, count = compared.shape
    shown = np.empty(columns)
    for n in range(len(periods)):
        period = periods[n]
        places = math.ceil(period / step_mm)
        along = np.zeros(places - 1 + count)
        for k in range(len(along)):
            for second in range(2 if share else 1):
                beside = step_mm * (k + 1 - places) - (share * period if second else 0.0)
                beside -= math.floor(beside / period) * period
                along[k] += pole[min(int(beside / table_step_mm), len(pole) - 1)]
                along[k] += pole[min(int((period - beside) / table_step_mm), len(pole) - 1)]
        likelihood = np.empty(places * seams)
        for place in range(places):
            comb, power = along[places - 1 - place : places - 1 - place + count], 0.0
            for i in range(count):
                power += comb[i] * comb[i]
            for c in range(columns):
                profile, product = compared[c], 0.0
                for i in range(count):
                    product += comb[i] * profile[i]
                shown[c] = product
            for c in range(2 * seams, columns):
                power -= shown[c] * shown[c]
            size = math.sqrt(max(power, 1e-18))
            for seam in range(seams):
                one = min(max(shown[2 * seam] / size, 0.0), largest_correlation)
                other = min(max(shown[2 * seam + 1] / size, 0.0), largest_correlation)
                left = (1.0 - one * one) * (1.0 - other * other)
                likelihood[place * seams + seam] = -0.5 * independent * math.log(left) if left < 1.0 else 0.0
        best = int(np.argmax(likelihood))
        total = 0.0
        for k in range(len(likelihood)):
            total += math.exp(likelihood[k] - likelihood[best])
        means[n], likeliest[n] = likelihood[best] + math.log(total / len(likelihood)), best
