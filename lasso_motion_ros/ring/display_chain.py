"""Film that was filtered over time on its way to us: the filter is recognised by its noise, and undone.

Many systems show y_k = (1−λ) x_k + λ y_{k−1} in place of the image x_k. A ring that moves then lags, and where it was a
ghost is left. With λ known, x_k = (y_k − λ y_{k−1}) / (1−λ).

**How λ is recognised.** Let the images be noise alone: x_k white in time with variance σ², d1 = y_k − y_{k−1},
d0 = y_{k−1} − y_{k−2}, u = 1 − λ, and v_k the variance of y_k. The filter's equation gives d1 = u (x_k − y_{k−1}), so
that

    E1 = ⟨d1²⟩ = u² (σ² + v_{k−1}),    E0 = ⟨d0²⟩ = u² (σ² + v_{k−2}),
    C = ⟨d1 d0⟩ = −u ⟨y_{k−1} d0⟩ = −u ½ (E0 + v_{k−1} − v_{k−2}),

since 2 ⟨y_{k−1} (y_{k−1} − y_{k−2})⟩ = ⟨d0²⟩ + v_{k−1} − v_{k−2}. With v_{k−1} − v_{k−2} = (E1 − E0) / u² follows
E0 u² + 2 C u + (E1 − E0) = 0, and of its two roots the larger one is the filter's:

    λ = 1 − (−C + √(C² − E0 (E1 − E0))) / E0.

In a filter that has run for long E1 = E0, and this is λ = 1 + 2ρ with ρ = C / E0 = −(1−λ)/2. The general form also
holds from the filter's first image on (y_0 = x_0), where λ = 1 + 2ρ is up to 0.5 too large. A sum over triples of
successive images has an E1 − E0 that is nearly its last minus its first term: it adds less and less noise.

What stands still cancels in differences. What moves does not: a 3×3 mean is subtracted, and of small blocks only those
are used whose *smoothed* difference is the smallest. (Choosing by the energy of what is measured would bias it: blocks
where d1 and d0 happen to be opposed have more of it.) Rounding to whole grey values adds 1/12 to each image's variance
without correlation: 1/6 to E1 and E0, −1/12 to C.

**What happens before λ is known.** The images before the seed pair are not there: the seed pair stays as it is, and
with it what its clicks, model and template hold of a lag. The estimate begins with it; three images give a first one.
Until λ is significant, pairs are what they are without this module, in image, state and covariance: an unfiltered
system is the rule, and no doubt is raised without evidence.

**Where the filter's last state is not there.** Of an image that did not come, with the chain running on,
y_k − λⁿ y_{k−n} leaves what is newer than the last image seen, n periods ago; so much is undone. If the chain had stood
still as well, λ − λⁿ of a ghost is left, less than the λ of doing nothing, and never an inverted one. An image that
comes twice is no step of the filter. At an interval that is no multiple of the period nothing is undone; with another
rate, size, read-out, geometry, dose or window all is learned anew.
"""

from __future__ import annotations

import copy
import math
from dataclasses import dataclass, replace

import cv2
import numpy as np
import numpy.typing as npt

from lasso_motion_ros.core.compiled import has_kernels
from lasso_motion_ros.geometry.frames import PLANES, Frame, FramePair, Plane
from lasso_motion_ros.ring.strip import upper_median

Array = npt.NDArray[np.float64]
Image = npt.NDArray[np.float32]
Pixels = npt.NDArray[np.uint8] | npt.NDArray[np.uint16]


@dataclass(frozen=True)
class DisplayChainTuning:
    """When images are taken to be filtered over time."""

    undo: bool = True  # False: images are taken as they come
    block_px: int = 16
    blocks_a_side: int = 12  # at most: a subsample, the same for all sizes of image
    still_share: float = 0.25  # of the blocks, those in which least moves
    fewest_blocks: int = 32
    groups: int = 8  # of blocks, by whose spread λ's error is told
    smallest_noise: float = 0.25  # variance of a difference, grey values²: less is lost in the rounding
    outlier_mads: float = 5.0  # from the median block's correlation
    energy_ratio: tuple[float, float] = (0.6, 1.3)  # E1/E0: a filter that starts gives 0.75 at least; beyond: the dose
    contradiction: float = 0.2  # of λ, by one triple against all before it: another filter
    contradiction_sigmas: float = 5.0  # of that triple's
    projection_step: float = 1e-3  # of the focal length: the C-arm turned by 0.06°, or moved by 1 mm
    grey_step: float = 0.1  # relative change of the grey between two images: another window, no hunting exposure
    memory: float = 0.9  # weight of the sums so far against a new triple
    settled_triples: int = 8  # after so many, and while there is no filter to undo,
    rest: int = 3  # images are let pass after each triple: what is settled takes that long to change at most
    smallest: float = 0.1  # λ below it is not undone: the lag is a ninth of the way between two images at most
    largest: float = 0.8  # λ above it cannot be undone: nine times the noise would be left
    sigmas: float = 4.0  # by which λ has to exceed zero
    sigma_floor: float = 0.01  # of λ: what a display curve does to the noise
    interval_slack: float = 0.25  # of the period: jitter of the stamps
    longest_gap: int = 3  # periods
    ghost_reach_m: float = 1e-3  # a wire's and an electrode's width: a ghost further off pulls at no alignment


QUANTISATION = 1.0 / 12.0  # variance of rounding, grey values²
THIRDS = np.full(3, 1.0 / 3.0, dtype=np.float32)
HIGH_PASS_POWER = 8.0 / 9.0  # sum of the squared weights of a pixel minus its 3×3 mean


@dataclass(frozen=True, eq=False)
class Sample:
    """Blocks from all over an image.

    Attributes:
        values: (n · p, m · p) float32 grey values of n × m blocks, side by side.
        grey: (n · m,) float32, their means.
    """

    values: Image
    grey: Image


@dataclass(frozen=True, eq=False)
class Difference:
    """Two successive images' difference in the sampled blocks.

    Attributes:
        fine: (n · p, m · p) float32, high-passed, grey values; zero at the blocks' edges, where neighbours have a say.
        energy: (n · m,) float32, mean square of it.
        moved: (n · m,) float32, mean square of what is smooth.
    """

    fine: Image
    energy: Image
    moved: Image


class PlaneChain:
    """One plane's display chain: its last image, and what is known of its filter.

    Args:
        tuning: see there.
    """

    def __init__(self, tuning: DisplayChainTuning) -> None:
        self._tuning = tuning
        self._last: Frame | None = None
        self._shown: Pixels = np.zeros((0, 0), np.uint8)  # what was made of the last image
        self._sample: Sample | None = None
        self._interval_ns = 0  # before the last image; 0: none that counts
        self._difference: Difference | None = None
        self._period_ns = 0
        self._sums: Array = np.zeros((3, tuning.groups))  # of C, E1, E0 by group
        self._triples, self._rest = 0, 0  # looked at since all was forgotten, and images yet to let pass
        self.filter, self.sigma = 0.0, np.inf  # λ, and its standard deviation
        # Of the last image in what was made of this one: unsure, and known to be left.
        self.error, self.ghost = 0.0, 0.0

    @property
    def is_filtered(self) -> bool:
        """Whether λ is significantly above zero."""
        tuning = self._tuning
        return tuning.smallest < self.filter < tuning.largest and self.filter > tuning.sigmas * self.sigma

    @property
    def is_too_strong(self) -> bool:
        """Whether the images surely show more of what was than can be undone."""
        return self.filter >= self._tuning.largest and self.filter > self._tuning.sigmas * self.sigma

    def undone(self, frame: Frame) -> Frame:
        """The frame as it was before the filter; the same frame where there is none, or where it cannot be undone.

        `error` and `ghost` say afterwards what is left of images before, as a share of the image's own.
        """
        self.error, self.ghost = 0.0, 0.0
        if min(frame.pixels.shape) < self._tuning.block_px:  # too small to tell anything
            self._forget()
            self._last = None
            return frame
        sample = sampled(frame.pixels, self._tuning)
        last = self._last
        if last is None or self._sample is None or not self._is_comparable(frame, last, sample, self._sample):
            self._forget()
            self._period_ns = 0
            return self._kept(frame, frame.pixels, sample, 0, None)
        # The blocks' means tell nearly always that it is another image.
        is_like = sample.grey.tobytes() == self._sample.grey.tobytes()
        if is_like and np.array_equal(sample.values, self._sample.values) and np.array_equal(frame.pixels, last.pixels):
            # The last image once more: no step of the filter.
            return frame if self._shown is last.pixels else replace(frame, pixels=self._shown)
        interval_ns = frame.stamp_ns - last.stamp_ns
        periods = self._periods(interval_ns)
        change = None
        if periods == 1:
            change = self._change(sample, self._sample)
            if change is not None and self._difference is not None:
                if not self._learn(change, self._difference):
                    self._forget()
                elif self._triples >= self._tuning.settled_triples and not self.is_filtered:
                    self._rest = self._tuning.rest
        pixels = frame.pixels
        if self.is_filtered:
            pixels = self._undo(frame.pixels, last.pixels, periods)
        return self._kept(frame, pixels, sample, interval_ns, change)

    def _change(self, sample: Sample, before: Sample) -> Difference | None:
        """The difference of two successive images' samples; None where they are let pass."""
        self._rest = max(self._rest - 1, 0)
        return None if self._rest else difference(sample, before, self._tuning)

    def _kept(self, frame: Frame, pixels: Pixels, sample: Sample, interval_ns: int, change: Difference | None) -> Frame:
        self._last, self._shown, self._sample = frame, pixels, sample
        self._interval_ns, self._difference = interval_ns, change
        return frame if pixels is frame.pixels else replace(frame, pixels=pixels)

    def _is_comparable(self, frame: Frame, last: Frame, sample: Sample, before: Sample) -> bool:
        """Whether the last image may be the filter's state in this one: later, and of the same read-out and window."""
        if frame.stamp_ns <= last.stamp_ns or frame.pixels.shape != last.pixels.shape:
            return False
        if frame.pixels.dtype != last.pixels.dtype:
            return False
        if frame.projection is not last.projection:
            now, then = frame.projection.matrix, last.projection.matrix  # of the same scale: Projection sees to that
            if np.abs(now - then).max() > self._tuning.projection_step * math.sqrt(float(then[0, :3] @ then[0, :3])):
                return False
        return abs(grey_change(sample, before)) <= self._tuning.grey_step

    def _periods(self, interval_ns: int) -> int:
        """How many periods an interval is; 0: none that is known.

        The period is that of two like intervals in succession; where another one sets in, the filter is learned anew.
        """
        slack = self._tuning.interval_slack
        is_repeated = abs(interval_ns - self._interval_ns) <= slack * interval_ns
        if self._period_ns:
            ratio = interval_ns / self._period_ns
            count = round(ratio)
            if count == 1 and abs(ratio - 1.0) <= slack:
                return 1
            if not is_repeated:
                is_gap = 1 < count <= self._tuning.longest_gap and abs(ratio - count) <= slack
                return count if is_gap else 0
            self._forget()
        self._period_ns = interval_ns
        return 1

    def _forget(self) -> None:
        self._sums = np.zeros((3, self._tuning.groups))
        self._triples, self._rest = 0, 0
        self.filter, self.sigma = 0.0, np.inf

    def _learn(self, new: Difference, old: Difference) -> bool:
        """Take three successive images in; False where the noise has changed, and with it perhaps the filter."""
        self._triples += 1
        sums = group_sums(new, old, self._tuning)
        if sums is None:
            return True
        total = sums.sum(axis=1)
        low, high = self._tuning.energy_ratio
        if not low * total[2] <= total[1] <= high * total[2]:
            return False
        alone, sigma = filter_of(sums)
        off = abs(alone - self.filter)
        if self._sums.any() and off > max(self._tuning.contradiction, self._tuning.contradiction_sigmas * sigma):
            return False
        # In units of this triple's energy: all triples count alike, whatever the grey level.
        self._sums = self._tuning.memory * self._sums + sums / total[2]
        self.filter, self.sigma = filter_of(self._sums)
        self.sigma = max(self.sigma, self._tuning.sigma_floor)
        return True

    def _undo(self, pixels: Pixels, before: Pixels, periods: int) -> Pixels:
        """(H, W) without what is left of the image so many periods before."""
        if periods == 0:
            self.ghost = self.filter / (1.0 - self.filter)
            return pixels
        share = self.filter**periods
        self.error = periods * self.filter ** (periods - 1) * self.sigma / (1.0 - share)
        # The images that did not come have λ − λⁿ, the image itself 1 − λ.
        self.ghost = (self.filter - share) / (1.0 - self.filter)
        return unfiltered(pixels, before, share)


@dataclass(frozen=True, eq=False)
class _Ahead:
    """A frame that was undone before the rest of its pair has come.

    Attributes:
        frame: as it came.
        undone: as it was before the filter.
        chain: its plane's, with the frame taken in.
    """

    frame: Frame
    undone: Frame
    chain: PlaneChain


class DisplayChain:
    """Both planes' display chains.

    Args:
        tuning: when images are taken to be filtered.
    """

    def __init__(self, tuning: DisplayChainTuning) -> None:
        self._tuning = tuning
        self._planes: dict[Plane, PlaneChain] = {plane: PlaneChain(tuning) for plane in PLANES}
        self._ahead: dict[Plane, _Ahead] = {}
        self.error, self.ghost = 0.0, 0.0  # of the worse plane

    def undone(self, pair: FramePair) -> FramePair:
        """The pair as it was before the display's filter; the very pair where there is none."""
        if not self._tuning.undo:
            return pair
        frames = {plane: self._undone(plane, frame) for plane, frame in pair.frames.items()}
        self.error = max((self._planes[plane].error for plane in frames), default=0.0)
        self.ghost = max((self._planes[plane].ghost for plane in frames), default=0.0)
        if all(frame is pair.frame(plane) for plane, frame in frames.items()):
            return pair
        return replace(pair, a=frames.get("a"), b=frames.get("b"))

    def undone_ahead(self, plane: Plane, frame: Frame) -> Frame:
        """A frame as `undone` will give it with the next pair; where that has another one, this has never come."""
        if not self._tuning.undo:
            return frame
        chain = copy.copy(self._planes[plane])  # what it holds is replaced, never changed in place
        self._ahead[plane] = _Ahead(frame, chain.undone(frame), chain)
        return self._ahead[plane].undone

    def _undone(self, plane: Plane, frame: Frame) -> Frame:
        ahead = self._ahead.pop(plane, None)
        if ahead is None or ahead.frame is not frame:
            return self._planes[plane].undone(frame)
        self._planes[plane] = ahead.chain
        return ahead.undone

    @property
    def filters(self) -> dict[Plane, float]:
        """Per plane λ, where images are filtered."""
        return {plane: chain.filter for plane, chain in self._planes.items() if chain.is_filtered}

    @property
    def too_strong(self) -> tuple[Plane, ...]:
        """The planes whose filter is too strong to be undone: they show the ring where it was."""
        return tuple(plane for plane, chain in self._planes.items() if chain.is_too_strong)

    def covariance(self, way: Array) -> Array:
        """(3, 3) m² of the displacement, by the lag that is left of a ring that came (3,) m since the last pair.

        An error σ of λ leaves a share σ/(1−λ) of the last image, and puts the ring off by that share of its way at
        most. A ghost that is known to be left pulls likewise, but only while it overlaps the ring.
        """
        length = float(np.linalg.norm(way))
        near = min(1.0, self._tuning.ghost_reach_m / length) if length > 0.0 else 0.0
        return np.asarray((self.error**2 + (near * self.ghost) ** 2) * np.outer(way, way))


def unfiltered(pixels: Pixels, before: Pixels, share: float) -> Pixels:
    """(H, W) image without a share of the one before, rounded and held within its type's range.

    Args:
        pixels: (H, W) y_k.
        before: (H, W) y_{k−1}, of the same type.
        share: λ, below 1.
    """
    return np.asarray(cv2.addWeighted(pixels, 1.0 / (1.0 - share), before, -share / (1.0 - share), 0.0))


def sampled(pixels: Pixels, tuning: DisplayChainTuning) -> Sample:
    """Blocks from all over an image (H, W)."""
    size, most = tuning.block_px, tuning.blocks_a_side
    if has_kernels():
        from lasso_motion_ros.ring.kernels import display as kernels

        return Sample(*kernels.sampled(np.ascontiguousarray(pixels), size, most))
    down, right = (max(1, side // size // most) for side in pixels.shape)
    rows, columns = pixels.shape[0] // (size * down), pixels.shape[1] // (size * right)
    whole = pixels[: rows * down * size, : columns * right * size]
    blocks = whole.reshape(rows, down, size, columns, right, size)[:, down // 2, :, :, right // 2, :]
    values = blocks.astype(np.float32).reshape(rows * size, columns * size)
    return Sample(values, block_means(values, size))


def block_means(values: Image, size: int) -> Image:
    """(n · m,) means of square blocks of values (n · size, m · size)."""
    rows, columns = (side // size for side in values.shape)
    return np.asarray(cv2.resize(values, (columns, rows), interpolation=cv2.INTER_AREA).ravel())


def grey_change(sample: Sample, before: Sample) -> float:
    """Relative change of the grey between two samples, of the median block: most of an image does not move."""
    now, then = sample.grey, before.grey
    if has_kernels():
        from lasso_motion_ros.ring.kernels import display as kernels

        return float(kernels.grey_change(now, then))
    change = np.asarray((now - then) / np.maximum(np.maximum(now, then), 1.0), dtype=np.float32)
    return float(upper_median(change[None])[0])


def difference(sample: Sample, before: Sample, tuning: DisplayChainTuning) -> Difference:
    """The difference of two samples, what is fine and what is smooth in it apart."""
    size, cell = tuning.block_px, tuning.block_px // 4
    if has_kernels():
        from lasso_motion_ros.ring.kernels import display as kernels

        return Difference(*kernels.difference(sample.values, before.values, size))
    change = cv2.subtract(sample.values, before.values)
    fine = cv2.subtract(change, cv2.sepFilter2D(change, cv2.CV_32F, THIRDS, THIRDS))  # twice as fast as cv2.blur
    for first in (0, size - 1):
        fine[first::size] = 0.0
        fine[:, first::size] = 0.0
    smooth = cv2.resize(change, None, fx=1.0 / cell, fy=1.0 / cell, interpolation=cv2.INTER_AREA)
    return Difference(fine, block_means(fine * fine, size), block_means(smooth * smooth, size // cell))


def group_sums(new: Difference, old: Difference, tuning: DisplayChainTuning) -> Array | None:
    """(3, groups) C, E1, E0, summed over groups of the blocks in which least moves; None for too little noise.

    Args:
        new: d1.
        old: d0.
        tuning: which blocks.
    """
    inner = ((tuning.block_px - 2) / tuning.block_px) ** 2
    rounding = QUANTISATION * HIGH_PASS_POWER * inner
    smallest = tuning.smallest_noise * HIGH_PASS_POWER * inner
    if has_kernels():
        from lasso_motion_ros.ring.kernels import display as kernels

        sums: Array = kernels.group_sums(
            new.fine,
            old.fine,
            np.stack([new.energy, old.energy]),
            np.stack([new.moved, old.moved]),
            tuning.block_px,
            rounding,
            smallest,
            tuning.still_share,
            tuning.fewest_blocks,
            tuning.outlier_mads,
            tuning.groups,
        )
        return sums if sums.size else None
    energies = np.stack([new.energy, old.energy]) - 2.0 * rounding
    noisy = np.flatnonzero(energies.min(axis=0) > smallest)
    count = int(tuning.still_share * noisy.size)
    if count < tuning.fewest_blocks:
        return None
    product = block_means(new.fine * old.fine, tuning.block_px) + np.float32(rounding)
    still = noisy[np.argpartition((new.moved + old.moved)[noisy], count - 1)[:count]]
    correlation = 2.0 * product[still] / energies[:, still].sum(axis=0)
    off = np.abs(correlation - upper_median(correlation[None]))
    still = still[off <= tuning.outlier_mads * max(float(upper_median(off[None])[0]), 1e-3)]
    still.sort()
    values = np.stack([product[still], *energies[:, still]]).astype(np.float64)
    return np.asarray(values @ np.eye(tuning.groups)[np.arange(still.size) % tuning.groups])


def filter_of(sums: Array) -> tuple[float, float]:
    """λ of C, E1, E0 (3, G), summed over groups of blocks, and its standard deviation by the jackknife."""
    if has_kernels():
        from lasso_motion_ros.ring.kernels import display as kernels

        share, sigma = kernels.filter_of(sums)
        return share, sigma
    total = sums.sum(axis=1)
    without = filter_from(*(total[:, None] - sums))
    count = sums.shape[1]
    spread = (count - 1) / count * float(((without - without.mean()) ** 2).sum())
    return float(filter_from(*total)), float(np.sqrt(spread))


def filter_from(product: npt.ArrayLike, energy_1: npt.ArrayLike, energy_0: npt.ArrayLike) -> Array:
    """λ of C, E1, E0, as derived above; of any like shapes. Where no filter fits, that of E1 = E0."""
    c, e1, e0 = (np.asarray(value, dtype=np.float64) for value in (product, energy_1, energy_0))
    root = np.sqrt(np.maximum(c**2 - e0 * (e1 - e0), 0.0))
    return np.asarray(1.0 - (root - c) / e0)
