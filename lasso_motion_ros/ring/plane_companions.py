"""The companions in one plane's view: how the ring moves with each, how far each is believed, and what they tell.

Each is followed, and a linear function of its place is fitted to where the ring was seen in the same image (Bayesian
linear regression: Bishop, "Pattern Recognition and Machine Learning", 2006, section 3.3). How far it is believed grows
as far as it explains how the ring has moved, and falls where it does not. The newest places vouch for nothing: a
sliding ring would take the fit along.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace

import numpy as np
import numpy.typing as npt

from lasso_motion_ros.core.compiled import has_kernels
from lasso_motion_ros.geometry.covariance import inverses, log_student, squared_mahalanobis
from lasso_motion_ros.geometry.frames import Frame
from lasso_motion_ros.geometry.projection import Projection
from lasso_motion_ros.ring.companion_patches import CompanionGrid, CompanionPatch, PatchTuning, follow_patch
from lasso_motion_ros.ring.companion_slide import CompanionSlideTuning, SlideSight

Array = npt.NDArray[np.float64]
Index = npt.NDArray[np.int_]

_IDENTITY_2 = np.eye(2)


@dataclass(frozen=True)
class CompanionTuning:
    """What companions are, and what they are worth."""

    patches: PatchTuning = field(default_factory=PatchTuning)
    slide: CompanionSlideTuning = field(default_factory=CompanionSlideTuning)
    # Of how the ring moves with a companion, before any motion was seen: as it does, but for a linear part of this
    # standard deviation, and a constant by which both were seen beside their places in the first image, mm;
    linear: float = 0.25
    constant_mm: float = 0.2
    noise_mm: float = 0.4  # and of what is left, which counts as so many places;
    noise_weight: float = 2.0
    smallest_noise_mm: float = 0.1
    unforeseen: float = 0.2  # and so much of the way beyond where it was seen before, standard deviation
    freedom: float = 4.0  # of Student's distribution of what is left
    moves: float = 0.3  # probability that a thing beside the ring moves with the heart, before it was seen to
    most_odds: float = 5.0  # log odds that it does, at most
    explained_mm: float = 1.0  # what is not larger than this, either way, shows nothing
    most_step: float = 1.5  # log odds that one image can add: those of one beat or breath say the same,
    least_step: float = -3.0  # or take away;
    denied_step: float = -0.5  # but of one that denies the ring's place: either may be in the wrong
    fails: float = 0.01  # a companion is taken for something else, or moved by itself
    elsewhere_mm: float = 7.0  # standard deviation of a ring that is not in its place, about it
    sure: float = 0.9  # probability that it moves with the heart, of one whose word counts for a slide
    denied: float = -2.0  # log odds that the ring is in its place: with less nothing is learned from that
    vouches_after_s: float = 4.0  # what is younger does not vouch, but for
    fewest: int = 6  # the first places
    spacing_s: float = 0.25  # places nearer in time share a heartbeat, and count as one
    kept: int = 2  # in a plane, once so many places have told which; not
    kept_after: int = 5
    often: float = 0.5  # what was seen in less of them
    same_view_px: float = 1.0  # by which what is about the ring may lie elsewhere: else the C-arm was moved


@dataclass(frozen=True, eq=False)
class Sighting:
    """Where companions and ring were seen in one plane of one pair.

    Attributes:
        index: (C,) which companions were seen.
        places: (C, 2) their displacements from their homes, mm.
        ring: (2,) the ring's, mm.
        off: (C, 2) the ring's, from where each companion has it, mm.
        variance: (C,) mm² of that, along either axis.
        log_odds: that the ring is in its place.
        slid: the ring's way from there by those that surely move with the heart, metres; None where there is none.
    """

    index: Index
    places: Array
    ring: Array
    off: Array
    variance: Array
    log_odds: float
    slid: SlideSight | None

    def of(self, kept: Index) -> Sighting:
        """The same where only some of the companions (K,), in order, are followed on."""
        seen = np.isin(self.index, kept)
        index = np.searchsorted(kept, self.index[seen])
        return replace(self, index=index, places=self.places[seen], off=self.off[seen], variance=self.variance[seen])


class PlaneCompanions:
    """The companions in one plane's view, all at once: the first axis of the arrays.

    Args:
        patches: what was found, each where it was when the ring was at home.
        grid: the image's cells.
        home: (3,) the ring's centre then, world metres.
        projection: of that image.
        tuning: what they are worth.
    """

    def __init__(
        self,
        patches: list[CompanionPatch],
        grid: CompanionGrid,
        home: Array,
        projection: Projection,
        tuning: CompanionTuning,
    ) -> None:
        self._patches, self._grid, self._tuning = patches, grid, tuning
        self._home, self._projection, self._home_px = home, projection, projection.project(home)
        self._mm_per_px = grid.cell_mm / grid.cell_px
        count = len(patches)
        self._odds = np.full(count, math.log(tuning.moves / (1.0 - tuning.moves)))
        self._places = np.zeros((count, 2))
        # Sums over the places w that vouch, the ring's being r: of (w, 1)ᵀ(w, 1), (w, 1)ᵀ(r − w) and |r − w|².
        self._square = np.zeros((count, 3, 3))
        self._product = np.zeros((count, 3, 2))
        self._rest = np.zeros(count)
        self._seen = np.zeros(count)
        self._lowest, self._highest = np.zeros((count, 2)), np.zeros((count, 2))  # of the places that vouch
        self._waiting: list[tuple[float, Sighting]] = []
        self._last_s = -math.inf  # of the last place that waited
        self._learned = 0
        # Of the ring by itself: a sum over its places, and of their squares.
        self._ring_count, self._ring_sum, self._ring_square = 1, np.zeros(2), np.zeros((2, 2))
        self._noise = np.full(count, tuning.noise_mm**2)
        self._fit()

    def take_centre(self, by: Array) -> None:
        """Take note that another point is the ring's centre from now on, (3,) m from the one before."""
        self._home = self._home + by
        self._home_px = self._projection.project(self._home)

    def is_same_view(self, projection: Projection) -> bool:
        """Whether a projection shows what is about the ring's home where that of the first image does."""
        return is_same_view(self._projection, projection, self._home, self._tuning)

    def look(self, frame: Frame, ring: Array, foretold: Array) -> Sighting:
        """Look for the companions in an image.

        Args:
            frame: the image.
            ring: (3,) world point at which it shows the ring's centre, metres.
            foretold: (3,) where that was foretold to be.
        """
        moved, expected = (self._projection.project(np.array([ring, foretold])) - self._home_px) * self._mm_per_px
        index, places = [], []
        for i, patch in enumerate(self._patches):
            likely = np.array([self._places[i], expected, moved])
            place, likeness = follow_patch(patch, frame, self._grid, likely, self._tuning.patches)
            if likeness >= self._tuning.patches.same:
                index.append(i)
                places.append(place)
        seen, where = np.array(index, dtype=int), np.array(places).reshape(-1, 2)
        self._places[seen] = where
        off, variance, moves, odds = self._told(seen, where, moved)
        return Sighting(seen, where, moved, off, variance, odds, self._slid(seen, moves, off, variance, ring))

    def weigh(self, sighting: Sighting, least_step: float) -> None:
        """Believe more, or less, in those that told where the ring was seen better, or worse, than its own past does.

        Args:
            sighting: of a ring that is believed to be in its place.
            least_step: log odds that may be taken away by it.
        """
        at = sighting.index
        step = np.maximum(self._steps(sighting), least_step)
        self._odds[at] = np.minimum(self._odds[at] + step, self._tuning.most_odds)

    def _steps(self, sighting: Sighting) -> Array:
        """(C,) log odds by which those that a sighting saw are to be believed more."""
        tuning, ring = self._tuning, sighting.ring
        if has_kernels():
            from lasso_motion_ros.ring.kernels import companions as kernels

            steps: Array = kernels.steps(
                sighting.off,
                sighting.variance,
                ring,
                self._ring_sum,
                self._ring_square,
                self._ring_count,
                tuning.explained_mm,
                tuning.freedom,
                tuning.most_step,
            )
            return steps
        mean = self._ring_sum / self._ring_count
        own = self._ring_square / self._ring_count - np.outer(mean, mean)
        least = np.maximum(sighting.variance, tuning.explained_mm**2)
        with_it = log_student(np.square(sighting.off).sum(axis=1) / least, least**2, tuning.freedom)
        spread = own + tuning.explained_mm**2 * _IDENTITY_2
        away = np.asarray(squared_mahalanobis(ring - mean, spread))
        alone = log_student(away, inverses(spread)[1], tuning.freedom)
        return np.minimum(with_it - alone, tuning.most_step)

    def learn(self, time_s: float, sighting: Sighting) -> None:
        """Take in a sighting of a ring that is in its place."""
        tuning, ring = self._tuning, sighting.ring
        self._ring_count += 1
        self._ring_sum = self._ring_sum + ring
        self._ring_square = self._ring_square + np.outer(ring, ring)
        if time_s - self._last_s >= tuning.spacing_s:
            self._waiting.append((time_s, sighting))
            self._last_s = time_s
        learned = self._learned
        while self._waiting and (
            self._learned < tuning.fewest or self._waiting[0][0] <= time_s - tuning.vouches_after_s
        ):
            self._vouch(self._waiting.pop(0)[1])
        if self._learned > learned:
            self._fit()
        if learned < tuning.kept_after <= self._learned:
            self._drop()

    def _vouch(self, sighting: Sighting) -> None:
        at, places = sighting.index, sighting.places
        self._learned += 1
        if has_kernels():
            from lasso_motion_ros.ring.kernels import companions as kernels

            sums = self._square, self._product, self._rest, self._seen, self._lowest, self._highest
            kernels.vouch(at, places, sighting.ring, *sums)
            return
        rows = np.concatenate([places, np.ones((len(places), 1))], axis=1)
        beside = sighting.ring - places
        self._square[at] += rows[:, :, None] * rows[:, None]
        self._product[at] += rows[:, :, None] * beside[:, None]
        self._rest[at] += np.square(beside).sum(axis=1)
        self._seen[at] += 1.0
        self._lowest[at] = np.minimum(self._lowest[at], places)
        self._highest[at] = np.maximum(self._highest[at], places)

    def _fit(self) -> None:
        """Fit the ring's places to those of each companion, with the noise that the last fit left.

        Noise and fit are found together, a round with each place that is learned.
        """
        tuning, noise = self._tuning, self._noise
        if has_kernels():
            from lasso_motion_ros.ring.kernels import companions as kernels

            count = len(noise)
            self._known, self._fitted = np.empty((count, 3, 3)), np.empty((count, 3, 2))
            self._noise, self._unlike = noise.copy(), np.empty(count)
            widths = tuning.linear, tuning.constant_mm, tuning.noise_mm, tuning.noise_weight, tuning.smallest_noise_mm
            sums = self._square, self._product, self._rest, self._seen
            kernels.fit(*sums, widths, self._known, self._fitted, self._noise, self._unlike)
            return
        prior = np.diag([tuning.linear**-2, tuning.linear**-2, tuning.constant_mm**-2])
        self._known = np.linalg.inv(prior + self._square / noise[:, None, None])
        self._fitted = self._known @ (self._product / noise[:, None, None])
        explained = 2.0 * self._product - self._square @ self._fitted
        left = np.maximum(self._rest - (self._fitted * explained).sum(axis=(1, 2)), 0.0)
        expected = tuning.noise_weight * tuning.noise_mm**2
        self._noise = np.maximum(
            (expected + 0.5 * left) / (tuning.noise_weight + self._seen), tuning.smallest_noise_mm**2
        )
        # Log odds against what moves like nothing in the heart.
        self._unlike = 0.5 * np.square(self._fitted[:, :2]).sum(axis=(1, 2)) / tuning.linear**2

    def _told(self, index: Index, places: Array, ring: Array) -> tuple[Array, Array, Array, float]:
        """What companions tell of where the ring is seen.

        Args:
            index: (C,) which companions were seen.
            places: (C, 2) where, mm from their homes.
            ring: (2,) likewise the ring.

        Returns:
            (C, 2) how far the ring is from where each has it, mm; (C,) mm² of that; (C,) the probability that it moves
            with the heart; log odds that the ring is in its place.
        """
        if has_kernels():
            from lasso_motion_ros.ring.kernels import companions as kernels

            tuning = self._tuning
            said: tuple[Array, Array, Array, float] = kernels.told(
                index,
                places,
                ring,
                self._fitted,
                self._known,
                self._noise,
                self._lowest,
                self._highest,
                self._odds - self._unlike,
                (tuning.unforeseen, tuning.freedom, tuning.fails, tuning.elsewhere_mm),
            )
            return said
        off, variance = self._off(index, places, ring)
        moves = 1.0 / (1.0 + np.exp(self._unlike[index] - self._odds[index]))
        return off, variance, moves, self._log_odds(moves, off, variance)

    def _off(self, index: Index, places: Array, ring: Array) -> tuple[Array, Array]:
        """How far the ring (2,) mm is from where companions at places (C, 2) mm have it: (C, 2) mm, and (C,) mm²."""
        rows = np.concatenate([places, np.ones((len(places), 1))], axis=1)
        off = ring - places - (rows[:, None] @ self._fitted[index])[:, 0]
        known = self._noise[index] + (rows[:, None] @ self._known[index] @ rows[:, :, None])[:, 0, 0]
        # Only so far as both were seen together is the one a linear function of the other.
        beyond = places - np.clip(places, self._lowest[index], self._highest[index])
        return off, known + self._tuning.unforeseen**2 * np.square(beyond).sum(axis=1)

    def _log_odds(self, moves: Array, off: Array, variance: Array) -> float:
        """Log odds that the ring is in its place: by the companion that speaks most for it, and most against it.

        Several are often of one device, which may be moved by itself: they do not count for more than one.
        """
        if not len(moves):
            return 0.0
        tuning = self._tuning
        squares = np.square(off).sum(axis=1)
        here = log_student(squares / variance, variance**2, tuning.freedom)
        elsewhere = -0.5 * squares / tuning.elsewhere_mm**2 - math.log(2.0 * math.pi * tuning.elsewhere_mm**2)
        moves = (1.0 - tuning.fails) * moves
        odds = np.log(moves * np.exp(here - elsewhere) + 1.0 - moves)
        return float(max(odds.max(), 0.0) + min(odds.min(), 0.0))

    def _slid(self, index: Index, moves: Array, off: Array, variance: Array, ring: Array) -> SlideSight | None:
        """By the one that tells best, of those that surely move with the heart."""
        sure = moves >= self._tuning.sure
        if not sure.any():
            return None
        # One that was moved by itself tells the worse the longer it is.
        best = int(np.argmin(np.where(sure, variance, np.inf)))
        across = 1e-3 * self._mm_per_px * self._projection.jacobian(ring)  # nearly unit vectors across the ray
        noise = float(self._noise[index[best]])
        return SlideSight(across, 1e-3 * off[best], 1e-6 * noise, 1e-6 * (float(variance[best]) - noise))

    def _drop(self) -> None:
        """Follow only those on which something is to be built: what is looked for costs time."""
        rare = self._seen < self._tuning.often * self._learned
        order = np.lexsort((np.log(self._noise) + self._unlike - self._odds, rare))
        keep = np.sort(order[: self._tuning.kept])
        self._patches = [self._patches[i] for i in keep.tolist()]
        self._odds, self._places, self._seen = self._odds[keep], self._places[keep], self._seen[keep]
        self._noise = self._noise[keep]
        self._lowest, self._highest = self._lowest[keep], self._highest[keep]
        self._square, self._product, self._rest = self._square[keep], self._product[keep], self._rest[keep]
        self._waiting = [(time_s, one.of(keep)) for time_s, one in self._waiting]
        self._fit()


def is_same_view(one: Projection, other: Projection, centre: Array, tuning: CompanionTuning) -> bool:
    """Whether two projections show what is about a world point (3,) m in the same place."""
    if one is other or np.array_equal(one.matrix, other.matrix):
        return True
    points = centre + 0.01 * np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]])
    return bool(np.abs(one.project(points) - other.project(points)).max() < tuning.same_view_px)
