"""The way of an alignment: steps of Gauss and Newton, until none is worth while or no loop is there."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from lasso_motion_ros.geometry.transforms import rotation_from_vector
from lasso_motion_ros.ring.loop_views import LoopViews

Array = npt.NDArray[np.float64]


@dataclass(frozen=True)
class _Tuning:
    """How far an alignment goes, and when it is given up."""

    iterations: int = 8
    renewals: int = 2  # of the derivative, at the first looks
    converged_mm: float = 0.015
    # What one step may change at most: further off, the derivative says nothing.
    largest_step_mm: float = 0.4
    largest_turn_rad: float = 0.03
    largest_stretch: float = 0.02  # of the size's natural logarithm
    ridge: float = 1e-12  # a trace of damping, for a plane that shows nothing
    # Mean of the planes' correlations, relative to what it usually is, below which no loop is there; look by look.
    hopeless_likeness: tuple[float, float, float] = (0.27, 0.45, 0.55)
    # A plane that shows next to nothing is not waited for from the third look (counted from 0) on: it would cost them
    # all.
    first_sure_look: int = 2
    afar_prior: float = 2.5  # times as loose: a ring that is looked for from afar may have turned more than usual
    nothing_seen_m: float = 5e-3  # standard deviation of a place that was given up at once


TUNING = _Tuning()


@dataclass(frozen=True, eq=False)
class Descent:
    """How an alignment went; its views stand where it ended.

    Attributes:
        ring: (4,) turn, rad, and stretch of the ring.
        correlations: mean of the planes' correlations, look by look.
        is_given_up: whether it was left before it was done, since no loop is there.
        covariance: (N, N) of the parameters, prior included: planes' shifts, m, then turn, rad, and stretch.
    """

    ring: Array
    correlations: tuple[float, ...]
    is_given_up: bool
    covariance: Array


def descend(views: LoopViews, arms: Array, ring: Array, precision: Array) -> Descent:
    """Go from where the views and the ring are to where the planes show the loop.

    Args:
        views: the planes; their centres are moved.
        arms: (L, 3) the loop about its centre at the seed pair, metres.
        ring: (4,) turn and stretch to start from.
        precision: (4,) of their prior.
    """
    count = len(views.centres)
    shared = 2 * count  # the parameters: two shifts a plane, then turn (3) and stretch
    limits = np.array(
        [TUNING.largest_step_mm * 1e-3] * shared + [TUNING.largest_turn_rad] * 3 + [TUNING.largest_stretch]
    )
    usual = float(views.usual.sum()) / count
    normal = np.diag([*[TUNING.nothing_seen_m**-2] * shared, *precision])
    correlations: tuple[float, ...] = ()
    is_given_up = False
    for iteration in range(TUNING.iterations):
        views.look(arms @ rotation_from_vector(ring[:3]).T * np.exp(ring[3]))
        correlations += (float(views.correlation.sum()) / count,)
        if is_given_up := _is_hopeless(correlations, usual):
            break
        # The derivative changes little on the way; the residual is what has to be exact.
        normal, gradient = views.equations(renew=iteration < TUNING.renewals)
        diagonal = np.einsum("ii->i", normal)  # a view
        diagonal[shared:] += precision
        diagonal += TUNING.ridge * diagonal.sum()
        gradient[shared:] -= precision * ring
        step: Array = np.linalg.solve(normal, gradient).astype(np.float64)
        np.minimum(np.maximum(step, -limits, out=step), limits, out=step)
        views.shift(step[:shared].reshape(-1, 2))
        ring = ring + step[shared:]
        if _has_arrived(step, limits, views, iteration):
            break
    covariance = np.linalg.inv(normal) if is_given_up else views.covariance(normal)
    return Descent(ring, correlations, is_given_up, np.asarray(covariance, dtype=np.float64))


def _is_hopeless(correlations: tuple[float, ...], usual: float) -> bool:
    """Whether no loop is there, by the planes' mean correlation so far and where the loop is seen."""
    look, now = len(correlations) - 1, correlations[-1]
    limits = TUNING.hopeless_likeness
    return look < len(limits) and now < limits[look] * usual


def _has_arrived(step: Array, limits: Array, views: LoopViews, look: int) -> bool:
    """Whether a step (N,) was so small that no other is needed."""
    size = np.abs(step)
    shifts = size[:-4]  # before turn and stretch
    if look >= TUNING.first_sure_look:
        shifts *= np.repeat(views.is_hopeful, 2)
    # A turn or stretch that was cut to its limit is not done, though the shifts may be.
    return bool(shifts.max() < TUNING.converged_mm * 1e-3 and (size < limits).all())
