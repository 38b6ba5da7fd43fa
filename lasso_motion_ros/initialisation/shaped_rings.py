"""Rings that are no circles, many at a time, fitted to the points about them; and what the points say for each.

A lasso is wound a little too far or not far enough, squeezed by its vein, and bent: to a circle come a second harmonic
in its plane and one across it. How surely points lie on a ring is told by how seldom so many of them would by chance
(an a-contrario test; Desolneux, Moisan, Morel, From Gestalt Theory to Image Analysis, 2008, ch. 3).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields
from typing import Any

import numpy as np
import numpy.typing as npt
from scipy.special import gammainc

from lasso_motion_ros.core.compiled import has_kernels
from lasso_motion_ros.geometry.directions import axes_across
from lasso_motion_ros.initialisation.circles import TURN, Circles
from lasso_motion_ros.initialisation.nearby_points import LEVELS, Nearby
from lasso_motion_ros.seeding.cones import Ellipse3D

Array = npt.NDArray[np.float64]


@dataclass(frozen=True)
class _Tuning:
    """How rings are shaped, and which points lie on one."""

    strongest: float = 3.0  # that a point counts as
    lift_sigma_m: float = 0.35e-3
    # How far rings go from where they were begun, in units of a point's scatter.
    point_m: float = 0.3e-3
    ellipse_share: float = 0.05  # standard deviation of the second harmonic, of the radius
    saddle_m: float = 0.5e-3
    inertia: float = 1e-2
    largest_step_m: float = 2e-3
    largest_ellipse_m: float = 2.5e-3
    largest_saddle_m: float = 2e-3
    radii_m: tuple[float, float] = (5e-3, 18e-3)
    # On a ring are points
    on_m: float = 0.9e-3  # from its curve,
    on_lift_m: float = 0.45e-3  # whose lift differs from its by less.
    fewest: int = 4
    # The largest gap between neighbours, of a turn, that an open loop with few poles has, and that no ring has.
    gaps: tuple[float, float] = (0.25, 0.5)


TUNING = _Tuning()


@dataclass(frozen=True, eq=False)
class ShapedRings:
    """Some rings in space.

    Attributes:
        centres: (N, 3) m.
        normals: (N, 3) unit vectors.
        first: (N, 3) unit vectors across them, from which angles are told,
        second: (N, 3) towards a quarter of a turn.
        radii: (N,) m.
        lifts: (N,) m by which plane B sees each higher than plane A.
        ellipses: (N, 2) m, cosine and sine of twice the angle, in the ring's plane.
        saddles: (N, 2) m, likewise, along its normal.
    """

    centres: Array
    normals: Array
    first: Array
    second: Array
    radii: Array
    lifts: Array
    ellipses: Array
    saddles: Array

    def __len__(self) -> int:
        return len(self.radii)

    def __getitem__(self, index: npt.NDArray[np.generic] | slice) -> ShapedRings:
        return ShapedRings(*(getattr(self, one.name)[index] for one in fields(self)))

    @classmethod
    def joined(cls, parts: Sequence[ShapedRings]) -> ShapedRings:
        """All rings of some parts, one after another."""
        return cls(*(np.concatenate([getattr(part, one.name) for part in parts]) for one in fields(cls)))

    @classmethod
    def of(cls, circles: Circles) -> ShapedRings:
        """Circles as rings."""
        first, second = axes_across(circles.normals)
        flat = np.zeros((len(circles), 2))
        return cls(circles.centres, circles.normals, first, second, circles.radii, circles.lifts, flat, flat)

    def circles(self, scores: Array) -> Circles:
        """The circles that they are but for their shape, with scores (N,)."""
        return Circles(self.centres, self.normals, self.radii, self.lifts, scores)

    def points(self, turns: Array = TURN) -> Array:
        """(N, P, 3) points at angles (P,), world metres."""
        double = np.stack([np.cos(2.0 * turns), np.sin(2.0 * turns)])
        out = (self.radii[:, None] + self.ellipses @ double)[..., None]
        spokes = np.cos(turns)[:, None] * self.first[:, None] + np.sin(turns)[:, None] * self.second[:, None]
        return np.asarray(
            self.centres[:, None] + out * spokes + (self.saddles @ double)[..., None] * self.normals[:, None]
        )

    def ellipse(self, number: int) -> Ellipse3D:
        """The flat ellipse nearest to one of them."""
        turn, longer = self._longest(number)
        major = np.cos(turn) * self.first[number] + np.sin(turn) * self.second[number]
        minor = np.cos(turn) * self.second[number] - np.sin(turn) * self.first[number]
        radius = self.radii[number]
        return Ellipse3D(self.centres[number], (radius + longer) * major, (radius - longer) * minor)

    def beside_ellipse(self, number: int, angles: Array) -> Array:
        """(P, 3) points of one of them at eccentric angles (P,) of its ellipse, world metres."""
        turn, _ = self._longest(number)
        return np.asarray(self[number : number + 1].points(angles + turn)[0])

    def _longest(self, number: int) -> tuple[float, float]:
        """The angle at which one of them is farthest from its middle, and by how much more than its radius, metres."""
        cosine, sine = self.ellipses[number]
        return float(0.5 * np.arctan2(sine, cosine)), float(np.hypot(cosine, sine))

    def fitted(self, nearby: Nearby, sigmas_m: Sequence[float]) -> ShapedRings:
        """The rings where the points about them lie on them best (least squares, reweighted).

        Args:
            nearby: the points.
            sigmas_m: round by round, the distance to which points count.
        """
        if has_kernels():
            return self._fitted_by_kernels(nearby, sigmas_m)
        rings = self
        for sigma_m in sigmas_m:
            rings = rings._moved(nearby, sigma_m)
        return rings

    def _fitted_by_kernels(self, nearby: Nearby, sigmas_m: Sequence[float]) -> ShapedRings:
        """As `fitted`, compiled."""
        from lasso_motion_ros.initialisation import point_kernels

        rings = [np.array(getattr(self, one.name), np.float64, order="C") for one in fields(self)]
        points = nearby.places, nearby.lifts, nearby.strengths, np.array(sigmas_m, np.float64)
        tuning = (
            TUNING.strongest,
            TUNING.lift_sigma_m,
            TUNING.point_m,
            TUNING.ellipse_share,
            TUNING.saddle_m,
            TUNING.inertia,
            TUNING.largest_step_m,
            TUNING.largest_ellipse_m,
            TUNING.largest_saddle_m,
            *TUNING.radii_m,
        )
        everything: list[Any] = [*rings, *points, *tuning]
        point_kernels.fitted(*everything)
        return ShapedRings(*rings)

    def _moved(self, nearby: Nearby, sigma_m: float) -> ShapedRings:
        """The rings after one step."""
        at = self._residuals(nearby)
        far = (at.outward**2 + at.along**2) / sigma_m**2 + (at.lifted / TUNING.lift_sigma_m) ** 2
        weights = np.minimum(nearby.strengths, TUNING.strongest) * np.exp(-0.5 * far)
        turn, ones = at.turn, np.ones_like(at.turn)
        double = (np.cos(2.0 * turn), np.sin(2.0 * turn))
        # In the ring's plane: middle, radius, second harmonic. Along its normal: middle, tilt, second harmonic.
        flat = np.stack([np.cos(turn), np.sin(turn), ones, *double], axis=2)
        unit = np.mean(self.radii)
        reach = at.out / unit
        across = np.stack([ones, reach * np.cos(turn), reach * np.sin(turn), *double], axis=2)
        loose = np.full((len(self), 3), TUNING.inertia)
        held_flat = np.repeat((TUNING.point_m / (TUNING.ellipse_share * self.radii))[:, None] ** 2, 2, axis=1)
        held_across = np.full((len(self), 2), (TUNING.point_m / TUNING.saddle_m) ** 2)
        nothing = np.zeros((len(self), 3))
        step = _step(
            flat,
            weights,
            at.outward,
            np.concatenate([loose, held_flat], axis=1),
            np.concatenate([nothing, self.ellipses], axis=1),
        )
        rise = _step(
            across,
            weights,
            at.along,
            np.concatenate([loose, held_across], axis=1),
            np.concatenate([nothing, self.saddles], axis=1),
        )
        normals = self.normals - (rise[:, 1:2] * self.first + rise[:, 2:3] * self.second) / unit
        normals /= np.linalg.norm(normals, axis=1, keepdims=True)
        first = self.first - (self.first * normals).sum(axis=1, keepdims=True) * normals
        first /= np.linalg.norm(first, axis=1, keepdims=True)
        lifted = (weights * at.lifted).sum(axis=1) / (weights.sum(axis=1) + 0.5)
        most, bent = TUNING.largest_ellipse_m, TUNING.largest_saddle_m
        return ShapedRings(
            self.centres + step[:, :1] * self.first + step[:, 1:2] * self.second + rise[:, :1] * self.normals,
            normals,
            first,
            np.cross(normals, first),
            np.clip(self.radii + step[:, 2], *TUNING.radii_m),
            self.lifts + lifted,
            np.clip(self.ellipses + step[:, 3:], -most, most),
            np.clip(self.saddles + rise[:, 3:], -bent, bent),
        )

    def _residuals(self, nearby: Nearby) -> _Residuals:
        away = nearby.places - self.centres[:, None]
        x, y, z = (np.einsum("nmi,ni->nm", away, axis) for axis in (self.first, self.second, self.normals))
        turn, out = np.arctan2(y, x), np.hypot(x, y)
        double = np.stack([np.cos(2.0 * turn), np.sin(2.0 * turn)], axis=2)
        outward = out - self.radii[:, None] - np.einsum("nmi,ni->nm", double, self.ellipses)
        along = z - np.einsum("nmi,ni->nm", double, self.saddles)
        return _Residuals(turn, out, outward, along, nearby.lifts - self.lifts[:, None])

    @property
    def tubes(self) -> Array:
        """(N,) m³ of space and m of lift in which points lie on each."""
        return np.asarray(2.0 * np.pi * self.radii * np.pi * TUNING.on_m**2 * 2.0 * TUNING.on_lift_m, np.float64)

    def support(self, nearby: Nearby) -> Support:
        """Which of the points about the rings lie on each."""
        if has_kernels():
            from lasso_motion_ros.initialisation import point_kernels

            support = Support(
                np.empty((len(self), len(LEVELS)), np.int64),
                np.empty(len(self)),
                np.empty(nearby.strengths.shape, np.bool_),
            )
            everything: list[Any] = [
                *(np.ascontiguousarray(getattr(self, one.name)) for one in fields(self)),
                *(getattr(nearby, one.name) for one in fields(nearby)),
                *(LEVELS, TUNING.on_m, TUNING.on_lift_m),
                *(support.counts, support.gaps, support.is_on),
            ]
            point_kernels.support(*everything)
            return support
        at = self._residuals(nearby)
        is_on = (at.outward**2 + at.along**2 < TUNING.on_m**2) & (np.abs(at.lifted) < TUNING.on_lift_m)
        is_on &= nearby.strengths > 0.0
        # Each electrode is a spot of its own in either plane.
        strong = [is_on & (nearby.strengths >= level) for level in LEVELS]
        counts = [np.minimum(*(_distinct(nearby.spots[..., k], which) for k in range(2))) for which in strong]
        return Support(np.stack(counts, axis=1), _largest_gaps(at.turn, is_on), is_on)


@dataclass(frozen=True, eq=False)
class Support:
    """What points say for rings.

    Attributes:
        counts: (N, LEVELS) electrodes on each that are as strong as each level.
        gaps: (N,) the largest gap between them, of a turn.
        is_on: (N, M) which of the points lie on it.
    """

    counts: npt.NDArray[np.intp]
    gaps: Array
    is_on: npt.NDArray[np.bool_]

    def evidence(self, expected: Array) -> Array:
        """(N,) how seldom chance would put so many electrodes on each (minus the logarithm to base ten).

        Less where they leave a part of the ring out; nothing of too few.

        Args:
            expected: (N, LEVELS) how many of each level chance puts there.
        """
        # Of as many or more, by Poisson's law.
        chance = np.where(self.counts > 0, gammainc(np.maximum(self.counts, 1), expected), 1.0)
        surest = -np.log10(np.maximum(chance.min(axis=1), 1e-300))
        low, high = TUNING.gaps
        whole = np.clip((high - self.gaps) / (high - low), 0.0, 1.0)
        return np.where(self.is_on.sum(axis=1) >= TUNING.fewest, surest * whole, 0.0)


@dataclass(frozen=True, eq=False)
class _Residuals:
    """Where points (N, M) lie beside rings: angle, distance from the axis, beyond the curve, along the normal, lift."""

    turn: Array
    out: Array
    outward: Array
    along: Array
    lifted: Array


def _step(design: Array, weights: Array, residuals: Array, held: Array, now: Array) -> Array:
    """(N, K) least squares of residuals (N, M) on designs (N, M, K), held (N, K) at nothing from where it is (N, K)."""
    weighted = design * weights[..., None]
    normal = np.matmul(weighted.transpose(0, 2, 1), design) + held[:, :, None] * np.eye(design.shape[2])
    right = np.einsum("nmk,nm->nk", weighted, residuals) - held * now
    return np.clip(np.linalg.solve(normal, right[..., None])[..., 0], -TUNING.largest_step_m, TUNING.largest_step_m)


def _distinct(numbers: npt.NDArray[np.intp], is_one: npt.NDArray[np.bool_]) -> npt.NDArray[np.intp]:
    """(N,) how many different numbers (N, M) there are among those that count."""
    ordered = np.sort(np.where(is_one, numbers, -1), axis=1)
    return np.asarray((np.diff(ordered, axis=1, prepend=-1) > 0).sum(axis=1), np.intp)


def _largest_gaps(turns: Array, is_one: npt.NDArray[np.bool_]) -> Array:
    """(N,) the largest gap between neighbours of some angles (N, M), of a turn; 1 where there is none."""
    # What does not count comes to lie on the last that does, which changes no gap.
    last = np.where(is_one, turns, -np.pi).max(axis=1, keepdims=True)
    ordered = np.sort(np.where(is_one, turns, last), axis=1)
    around = ordered[:, :1] + 2.0 * np.pi - ordered[:, -1:]
    gaps = np.concatenate([np.diff(ordered, axis=1), around], axis=1).max(axis=1) / (2.0 * np.pi)
    return np.where(is_one.any(axis=1), gaps, 1.0)
