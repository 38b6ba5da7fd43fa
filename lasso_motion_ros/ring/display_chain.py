"""Film that was filtered over time on its way to us: the filter is recognised by its noise, and undone.

Many systems show y_k = (1−λ) x_k + λ y_{k−1} in place of the image x_k. A ring that moves then lags, and where it was a
ghost is left. With λ known (`temporal_filter`), x_k = (y_k − λ y_{k−1}) / (1−λ).

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

from lasso_motion_ros.geometry.frames import PLANES, Frame, FramePair, Plane
from lasso_motion_ros.ring.temporal_filter import (
    Difference,
    DisplayChainTuning,
    Pixels,
    Sample,
    difference,
    filter_of,
    grey_change,
    group_sums,
    sampled,
)

Array = npt.NDArray[np.float64]


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
