"""How much of the last image is in the next one, told by the noise of film that was filtered over time.

Many systems show y_k = (1−λ) x_k + λ y_{k−1} in place of the image x_k (`display_chain`). Let images be noise alone:
x_k white in time with variance σ², d1 = y_k − y_{k−1}, d0 = y_{k−1} − y_{k−2}, u = 1 − λ, and v_k the
variance of y_k. The filter's equation gives d1 = u (x_k − y_{k−1}), so that

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
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
import numpy.typing as npt

from lasso_motion_ros.core.compiled import has_kernels
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
