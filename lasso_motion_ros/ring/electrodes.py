"""The electrodes as such: a comb of poles fitted to what both planes show along the ring's curve.

Poles stay where they are on the curve while all else moves on, so that the mean of several pairs shows them. A comb,
even or in pairs, is fitted to both planes' evidence at once, by maximum likelihood, with an amplitude for each plane.
Its score is the logarithm of how much likelier the evidence is with it than without one, whatever its place.

A closed curve does not tell where the loop begins and ends. There the distance from pole to pole is another one, and a
comb that goes on across it agrees with the poles of one side only: so every such seam is tried.
"""

from __future__ import annotations

from collections.abc import Generator, Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import TypeVar

import numpy as np
import numpy.typing as npt

from lasso_motion_ros.config.catheters import Catheter, catalogue
from lasso_motion_ros.core.compiled import has_kernels
from lasso_motion_ros.geometry.curves import arc_length
from lasso_motion_ros.geometry.frames import PLANES, Plane
from lasso_motion_ros.ring.working_image import Image

Array = npt.NDArray[np.float64]
Outcome = TypeVar("Outcome")


@dataclass(frozen=True)
class ElectrodesTuning:
    """What a pole looks like along the arc, which combs are tried, and when one is believed."""

    fine_mm: float = 0.6  # the evidence's own differences of Gaussians, and what it blurs besides
    coarse_mm: float = 1.6
    coarse_share: float = 0.72  # of the area of the one in the other
    independent_mm: float = 1.2  # evidence further apart along the arc has noise of its own
    slow_terms: int = 4  # Legendre polynomials: what changes over the whole ring is no comb
    even_lengths_mm: tuple[float, ...] = (1.0, 1.8, 2.6, 3.5)
    pair_shares: tuple[float, ...] = (0.25, 0.35)  # from the first to the second of a pair, of a period
    pair_length_mm: float = 1.0
    even_mm: tuple[float, float] = (2.7, 14.0)
    pairs_mm: tuple[float, float] = (5.5, 13.0)
    distance_step: float = 0.02  # of its logarithm
    table_step_mm: float = 0.05
    place_step_mm: float = 0.45
    together: int = 8  # distances that are tried in one step
    closed_mm: float = 1.2  # ends of a curve that are nearer to each other than this are one place
    seams: int = 12  # of a closed curve, that are tried
    largest_correlation: float = 0.97  # of one plane's evidence with a comb
    resolved_score: float = 12.0
    resolved_probability: float = 0.9  # of the distance, within
    closest_pair_mm: float = 1.75  # a closer pair looks like one long electrode
    same_distance: float = 0.06  # of its logarithm
    beyond_mm: float = 1.0  # the curve's ends: clicks end a little inside
    faintest_end: float = 0.5  # of the poles' usual evidence: less of it at an end, and there is no pole
    near_diameter: float = 0.12  # of a catalogue's: a loop is squeezed by its vein
    near_distance: float = 0.08
    near_share: float = 0.05  # of a pair's: from edge to edge or from centre to centre, it differs by as much
    fewest_seen: float = 0.6  # of its poles: where a loop overlaps, some lie beside the curve


TUNING = ElectrodesTuning()


@dataclass(frozen=True)
class Comb:
    """Poles along the ring.

    Attributes:
        period_mm: from pole to pole where they are even, else from pair to pair.
        share: from the first to the second of a pair, of the period; 0 where they are even.
        length_mm: of an electrode, the nearest of those that were tried.
        places_mm: of the poles, from the curve's beginning.
        score: natural logarithm of how much likelier the evidence is than without a comb.
        probability: that the period is this one, if it is any.
        paired: probability that they are in pairs, if the period is this one.
    """

    period_mm: float
    share: float
    length_mm: float
    places_mm: tuple[float, ...]
    score: float
    probability: float
    paired: float

    @property
    def is_resolved(self) -> bool:
        """Whether dose and view show the poles."""
        return self.score >= TUNING.resolved_score and self.probability >= TUNING.resolved_probability

    @property
    def is_kind_resolved(self) -> bool:
        """Whether even poles are told from pairs."""
        if self.share and self.share * self.period_mm < TUNING.closest_pair_mm:
            return False
        return not 1.0 - TUNING.resolved_probability < self.paired < TUNING.resolved_probability

    @property
    def distances(self) -> str:
        """In words."""
        if self.share:
            first = self.share * self.period_mm
            return f"{first:.1f} and {self.period_mm - first:.1f} mm apart"
        return f"{self.period_mm:.1f} mm apart"


@dataclass(frozen=True, eq=False)
class RingEvidence:
    """What both planes show along the ring, and the poles in it; worked out when somebody asks.

    Args:
        points: (L, 3) of the ring's curve, evenly spaced, metres.
        shown: per plane, (L,) the mean evidence.
        diameter_mm: of the ring.
        catheter: that was named, or None.
    """

    points: Array
    shown: Mapping[Plane, Image]
    diameter_mm: float
    catheter: Catheter | None = None

    @cached_property
    def comb(self) -> Comb | None:
        """The likeliest comb; None where the named catheter has no distances."""
        return _outcome(self._fitting())

    def work(self) -> Iterator[None]:
        """See `Description.work`: a step is one distance between poles, in all its places."""
        if "comb" not in self.__dict__:
            self.__dict__["comb"] = yield from self._fitting()

    @property
    def known(self) -> str | None:
        """See `Description.known`."""
        return self.text if "comb" in self.__dict__ else None

    def _fitting(self) -> Generator[None, None, Comb | None]:
        if self.catheter is None:
            return (yield from _fitting(self.points, self.shown, _any_kind()))
        unit_mm = self.catheter.unit_mm
        if unit_mm is None:
            return None
        length = self.catheter.electrode_length_mm or TUNING.pair_length_mm
        return (yield from _fitting(self.points, self.shown, [(self.catheter.share, length, _distances(*unit_mm))]))

    @cached_property
    def text(self) -> str:
        """What is known of the catheter, for people."""
        comb, across = self.comb, f"{self.diameter_mm:.0f} mm across"
        if self.catheter is not None:
            name = f"{self.catheter.name}, {self.catheter.poles} poles"
            if comb is None:
                return f"{name} (distances not in the catalogue), {across}"
            if comb.score < TUNING.resolved_score:
                return f"{name}, {comb.distances}: not resolved in the images, {across}"
            return f"{name}, {comb.distances}: {len(comb.places_mm)} seen along the ring, {across}"
        if comb is None or not comb.is_resolved:
            return f"not resolved, {across}"
        nearest, poles = nearest_catheter(comb, self.diameter_mm), f"{len(comb.places_mm)} poles, {comb.distances}"
        if not comb.is_kind_resolved:
            count = len(comb.places_mm) // (2 if comb.share else 1)
            nearest, poles = None, f"{count} poles or pairs, {comb.period_mm:.1f} mm apart"
        return f"{'unknown' if nearest is None else f'like {nearest.name}'}, {poles}, {across}"


Kinds = list[tuple[float, float, Array]]
"""Which combs are tried: share of a pair (0: even), length of an electrode in mm, periods in mm."""


def _any_kind() -> Kinds:
    even, pairs = _distances(*TUNING.even_mm), _distances(*TUNING.pairs_mm)
    kinds = [(0.0, length, even) for length in TUNING.even_lengths_mm]
    return kinds + [(share, TUNING.pair_length_mm, pairs) for share in TUNING.pair_shares]


def likeliest_comb(points: Array, shown: Mapping[Plane, Image]) -> Comb:
    """The likeliest comb of a catheter of any kind; arguments as of `RingEvidence`."""
    return _outcome(_fitting(points, shown, _any_kind()))


def _outcome(work: Generator[None, None, Outcome]) -> Outcome:
    """What work in steps gives in the end."""
    while True:
        try:
            next(work)
        except StopIteration as end:
            outcome: Outcome = end.value
            return outcome


def _fitting(points: Array, shown: Mapping[Plane, Image], kinds: Kinds) -> Generator[None, None, Comb]:
    """The likeliest comb of these kinds, in steps.

    The profile of each plane is a multiple, not negative, of the comb's, beside what varies slowly and normal noise of
    unknown size; both amplitudes and both sizes of noise are maximised over (profile likelihood), the place, and of a
    closed curve the seam, are averaged over.

    Args:
        points: (L, 3) of the curve, metres.
        shown: per plane, (L,) evidence.
        kinds: which combs are tried.
    """
    arc_mm = 1e3 * arc_length(points)
    length_mm = float(arc_mm[-1])
    is_closed = 1e3 * float(np.linalg.norm(points[0] - points[-1])) < TUNING.closed_mm
    # As many values as there are places: so a comb goes on by one of them from place to place.
    count = max(2, round(length_mm / TUNING.place_step_mm))
    step_mm = length_mm / (count if is_closed else count - 1)
    at_mm = np.linspace(0.0, step_mm * (count - 1), count)
    profiles: Array = np.stack([np.interp(at_mm, arc_mm, np.asarray(shown[plane], np.float64)) for plane in PLANES])
    seams = np.arange(TUNING.seams) * count // TUNING.seams if is_closed else np.zeros(1, np.intp)
    compared = np.ascontiguousarray(np.concatenate(_from_seams(profiles, seams), axis=1).T)
    independent = length_mm / TUNING.independent_mm
    found: list[tuple[float, float, float, float]] = []  # share, length, period, score
    best = -np.inf, 0.0, 0  # score, phase, seam
    for share, length, periods in kinds:
        pole = _pole(length)
        for first in range(0, len(periods), TUNING.together):
            some = periods[first : first + TUNING.together]
            means, likeliest = _likelihoods(some, share, pole, step_mm, compared, len(seams), independent)
            found += [(share, length, period, mean) for period, mean in zip(some.tolist(), means.tolist(), strict=True)]
            if means.max() > best[0]:
                which = int(np.argmax(means))
                place, seam = divmod(int(likeliest[which]), len(seams))
                best = float(means[which]), place * step_mm, int(seams[seam])
            yield
    scores = np.array([score for *_, score in found])
    weights = np.exp(scores - scores.max())
    (share, length, period, _), (score, phase, seam) = found[int(np.argmax(scores))], best
    same = np.array([abs(np.log(other / period)) < TUNING.same_distance for _, _, other, *_ in found])
    paired = np.array([other > 0.0 for other, *_ in found])
    mean_profile: Array = np.roll(profiles.mean(axis=0), -seam).astype(np.float64)
    places = _places(at_mm, mean_profile, period, share, phase)
    return Comb(
        period,
        share,
        length,
        tuple(sorted((place + seam * step_mm) % length_mm for place in places)) if seam else places,
        score,
        float(weights[same].sum() / weights.sum()),
        float(weights[same & paired].sum() / weights[same].sum()),
    )


def _from_seams(profiles: Array, seams: npt.NDArray[np.intp]) -> tuple[Array, Array]:
    """(N, seams times planes) the planes' profiles (planes, N) from each seam on, slow changes left out, of norm 1.

    And (N, terms) what varies slowly, orthonormal.
    """
    count = profiles.shape[1]
    terms = np.polynomial.legendre.legvander(np.linspace(-1.0, 1.0, count), TUNING.slow_terms)
    slow: Array = np.linalg.qr(terms)[0].astype(np.float64)
    begun = np.stack([np.roll(profiles, -seam, axis=1).T for seam in seams.tolist()], axis=1).reshape(count, -1)
    begun -= slow @ (slow.T @ begun)
    return np.asarray(begun / np.maximum(np.linalg.norm(begun, axis=0), 1e-9), np.float64), slow


def nearest_catheter(comb: Comb, diameter_mm: float) -> Catheter | None:
    """The entry of the catalogue whose distances and loop a comb has; None where there is none, or more than one."""
    near = [entry for entry in catalogue().values() if _is_near(entry, comb, diameter_mm)]
    return near[0] if len(near) == 1 else None


def _is_near(entry: Catheter, comb: Comb, diameter_mm: float) -> bool:
    if entry.unit_mm is None or abs(entry.share - comb.share) > TUNING.near_share:
        return False
    if not comb.share and entry.electrode_length_mm is not None:
        nearest = min(TUNING.even_lengths_mm, key=lambda length: abs(length - (entry.electrode_length_mm or 0.0)))
        if comb.length_mm != nearest:
            return False
    if not TUNING.fewest_seen * entry.poles <= len(comb.places_mm) <= entry.poles:
        return False
    (low, high), tolerance = entry.unit_mm, 1.0 + TUNING.near_distance
    if not low / tolerance <= comb.period_mm <= high * tolerance:
        return False
    return entry.diameter_mm is None or is_near_size(entry.diameter_mm, diameter_mm, TUNING.near_diameter)


def is_near_size(range_mm: tuple[float, float], diameter_mm: float, tolerance: float) -> bool:
    """Whether a ring is as large as a catheter's loop, within a share of it."""
    return range_mm[0] * (1.0 - tolerance) <= diameter_mm <= range_mm[1] * (1.0 + tolerance)


def _distances(low: float, high: float) -> Array:
    count = max(1, round(np.log(high / low) / TUNING.distance_step) + 1)
    return np.asarray(np.exp(np.linspace(np.log(low), np.log(high), count)))


def _likelihoods(
    periods: Array, share: float, pole: Array, step_mm: float, compared: Array, seams: int, independent: float
) -> tuple[Array, npt.NDArray[np.int64]]:
    """(N,) logarithms of the mean likelihoods of combs in all their places and from all seams, and their likeliest.

    That is (N,) its place times the number of seams, and its seam.

    Args:
        periods: (N,) of the combs, rising, mm.
        share: of a pair, see `Comb`.
        pole: one of their poles (`_pole`).
        step_mm: from place to place.
        compared: (seams times planes, and then the slow terms, L) from `_from_seams`.
        seams: how many.
        independent: how many values along the curve have noise of their own.
    """
    if has_kernels():
        from lasso_motion_ros.ring.kernels import combs as kernels

        means, likeliest = np.empty(len(periods)), np.empty(len(periods), np.int64)
        along = TUNING.table_step_mm, step_mm, compared, seams, independent, TUNING.largest_correlation
        kernels.likelihoods(periods, share, pole, *along, means, likeliest)
        return means, likeliest
    combs, power, begins = _combs(periods, share, pole, step_mm, compared.shape[1])
    products = combs @ compared.T
    of_slow = products[:, seams * len(PLANES) :]
    size = np.sqrt(np.maximum(power - np.einsum("ps,ps->p", of_slow, of_slow), 1e-18))
    correlations = np.clip(products[:, : seams * len(PLANES)] / size[:, None], 0.0, TUNING.largest_correlation)
    each = np.log1p(-np.square(correlations)).reshape(len(combs), -1, len(PLANES))
    likelihood = -0.5 * independent * each.sum(axis=2)
    ends = [*begins[1:], len(combs)]
    best = [int(np.argmax(likelihood[begin:end])) for begin, end in zip(begins, ends, strict=True)]
    return _log_means(likelihood, begins), np.array(best, np.int64)


def _combs(
    periods: Array, share: float, pole: Array, step_mm: float, count: int
) -> tuple[Array, Array, npt.NDArray[np.intp]]:
    """(P, count) what combs show every `step_mm` of the arc in each of their places, and (P,) the sums of its squares.

    And (N,) where those of each begin.

    Args:
        periods: (N,) of the combs, rising, mm.
        share: of a pair, see `Comb`.
        pole: one of their poles (`_pole`).
        step_mm: from place to place.
        count: of values.
    """
    places = np.ceil(periods / step_mm).astype(np.intp)
    most = int(places.max())
    # A comb in all its places is one row of values, from further and further back.
    along = step_mm * np.arange(1 - most, count)
    total = np.zeros((len(periods), len(along)))
    for offset in (0.0, share) if share else (0.0,):
        beside = (along - offset * periods[:, None]) % periods[:, None]
        for away in (beside, periods[:, None] - beside):
            total += pole[np.minimum((away / TUNING.table_step_mm).astype(np.intp), len(pole) - 1)]
    windows = np.lib.stride_tricks.sliding_window_view(total, count, axis=1)[:, ::-1]
    combs = windows[np.arange(most) < places[:, None]]
    return combs, np.einsum("pn,pn->p", combs, combs), np.cumsum(places) - places


def _log_means(values: Array, begins: npt.NDArray[np.intp]) -> Array:
    """(N,) logarithms of the means of the exponentials of some rows of values (P, K), from each beginning (N,) on."""
    most = np.maximum.reduceat(values.max(axis=1), begins)
    counts = np.diff(np.append(begins, len(values)))
    above = np.exp(values - np.repeat(most, counts)[:, None]).sum(axis=1)
    return np.asarray(most + np.log(np.add.reduceat(above, begins) / (counts * values.shape[1])))


def _pole(length: float) -> Array:
    """(T,) the evidence beside a pole of a length, mm, every `table_step_mm`.

    A difference of Gaussians, each widened by the electrode (a box has a twelfth of its squared length as variance).
    """
    beside = np.arange(0.0, 0.5 * length + 4.0 * TUNING.coarse_mm, TUNING.table_step_mm)
    fine, coarse = (float(np.hypot(sigma, length / np.sqrt(12.0))) for sigma in (TUNING.fine_mm, TUNING.coarse_mm))
    share = TUNING.coarse_share * fine / coarse
    return np.asarray(np.exp(-0.5 * (beside / fine) ** 2) - share * np.exp(-0.5 * (beside / coarse) ** 2))


def _places(arc_mm: Array, evidence: Array, period: float, share: float, phase: float) -> tuple[float, ...]:
    """Where a comb's poles lie on the curve, mm, in order; not beyond the last at either end that is seen."""
    first = np.arange(phase - 2.0 * period, arc_mm[-1] + 2.0 * period, period)
    every = np.sort(np.concatenate([first, first + share * period])) if share else first
    every = every[(every >= -TUNING.beyond_mm) & (every <= arc_mm[-1] + TUNING.beyond_mm)]
    seen = np.interp(every, arc_mm, evidence)
    plain = np.flatnonzero(seen >= TUNING.faintest_end * np.median(seen))
    return tuple(float(place) for place in every[plain[0] : plain[-1] + 1]) if len(plain) else ()
