"""What the ring looks like: one profile of attenuation along its arc, which both planes share.

An electrode lies at one arc length, whichever plane looks at it. What only one plane shows along the clicked curve (an
ablation tip, a rib, an ECG electrode) is something else. So the profile is the lesser of what the two planes show, arc
length by arc length; later pairs refine it, since the electrodes stay on the ring and all else moves on. After that it
is fixed: a template that goes on learning drifts with what it is aligned to.
"""

from __future__ import annotations

import copy
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import cv2
import numpy as np
import numpy.typing as npt

from lasso_motion_ros.geometry.curves import slope
from lasso_motion_ros.geometry.frames import PLANES, Plane
from lasso_motion_ros.ring.strip import HALF_WIDTH
from lasso_motion_ros.ring.working_image import Image, softened

Array = npt.NDArray[np.float64]


@dataclass(frozen=True)
class TemplateTuning:
    """How the template is made and learned."""

    shared: bool = True  # the lesser of what the planes show; else the mean
    smoothing_points: float = 0.8  # along the arc, of 120 points on some 60 mm: less than an electrode's length
    ceiling: float = 2.5  # no stretch of the arc may outweigh all others
    pairs: int = 24  # learned from; then the profile is fixed
    smallest_usual: float = 0.3  # correlation; with less no ring is told from noise
    usual_softened: float = 0.9  # where noise is blurred away
    memory: int = 8  # pairs over which what is usual follows the dose
    between: float = 0.4  # evidence: less is shown by the wire between electrodes, and by noise
    # Of wires: the evidence between their electrodes, its standard deviation from ring to ring, and one pair's; with
    # care (docs/constants.md).
    usual_wire: float = 0.25
    wire_spread: float = 0.15
    wire_noise: float = 0.14


class RingTemplate:
    """The ring's profile along its arc and its cross-section, as both planes show it.

    Args:
        strips: per plane, (L, 2·HALF_WIDTH + 1) samples of the working image along the ring.
        shown: per plane, (L,) the evidence along it.
        tuning: how it is made and learned.
        count: pairs whose means these are.

    Attributes:
        profile: (L,) float32, not negative: by how much each point of the arc stands out in both planes.
        weights: (L,) of sum 1: where the electrodes are, by the evidence of both planes; what it is weighted by.
        between: (L,) bool: where there is no electrode, or the lesser half of the arc.
        wire: per plane, the evidence there, as the pairs so far and what wires usually show have it.
        values: (L, 2·HALF_WIDTH + 1) float32, the profile times the cross-section.
        slopes: of `values`, along the arc and across it.
        usual: per plane, correlation with it where the ring is seen.
    """

    def __init__(
        self, strips: Mapping[Plane, Image], shown: Mapping[Plane, Image], tuning: TemplateTuning, count: int = 1
    ) -> None:
        self._tuning, self._count = tuning, count
        self._means = {plane: strips[plane].astype(np.float32) for plane in PLANES}
        self._shown = {plane: shown[plane].astype(np.float32) for plane in PLANES}
        self._renew()
        self.usual = {
            plane: max(correlation(self.values, strips[plane]), self._tuning.smallest_usual) for plane in PLANES
        }

    @staticmethod
    def of_many(
        looks: Sequence[tuple[Mapping[Plane, Image], Mapping[Plane, Image]]], tuning: TemplateTuning
    ) -> RingTemplate:
        """What several pairs make: strips and evidence of each; first the seed pair's, to which a model was fitted."""
        strips, shown = (
            {plane: np.mean([one[part][plane] for one in looks], axis=0) for plane in PLANES} for part in range(2)
        )
        template = RingTemplate(strips, shown, tuning, len(looks))
        for plane in PLANES if len(looks) > 1 else ():
            likeness = [correlation(template.values, one[plane]) for one, _ in looks[1:][-tuning.memory :]]
            template.usual[plane] = max(float(np.mean(likeness)), tuning.smallest_usual)
        return template

    def learn(
        self, strips: Mapping[Plane, Image], shown: Mapping[Plane, Image], correlations: Mapping[Plane, float]
    ) -> bool:
        """Take in one pair that surely shows the ring: its strips and evidence, and how well they correlated.

        Returns:
            Whether the profile has changed: it is fixed after some pairs, and one plane alone changes nothing.
        """
        for plane, correlation in correlations.items():
            step = (correlation - self.usual[plane]) / self._tuning.memory
            self.usual[plane] = max(self.usual[plane] + step, self._tuning.smallest_usual)
        if self.is_fixed or len(strips) < len(PLANES):
            return False
        self._count += 1
        share = np.float32(1.0 / self._count)
        for plane, strip in strips.items():
            self._means[plane] = self._means[plane] + (strip - self._means[plane]) * share
            self._shown[plane] = self._shown[plane] + (shown[plane] - self._shown[plane]) * share
        self._renew()
        return True

    @property
    def tuning(self) -> TemplateTuning:
        """How it is made and learned."""
        return self._tuning

    @property
    def is_fixed(self) -> bool:
        """Whether it has learned from as many pairs as it will."""
        return self._count >= self._tuning.pairs

    @property
    def count(self) -> int:
        """Pairs that it was learned from."""
        return self._count

    @property
    def shown(self) -> dict[Plane, Image]:
        """Per plane, (L,) the mean evidence along the arc; never changed in place."""
        return dict(self._shown)

    def softened(self) -> RingTemplate:
        """What it looks like in a softened `WorkingImage`."""
        soft = copy.copy(self)
        soft._show(softened(self.values))
        soft.usual = dict.fromkeys(PLANES, self._tuning.usual_softened)
        return soft

    def _renew(self) -> None:
        profiles = {plane: self._along(mean) for plane, mean in self._means.items()}
        join = np.minimum if self._tuning.shared else _mean
        self.profile: Image = join(profiles["a"], profiles["b"])
        if not self.profile.any():  # the planes have nothing in common: all of the arc counts alike
            self.profile = np.full_like(self.profile, 1e-3)
        # What little the wire shows is left out: noise would outweigh it.
        shown = join(self._shown["a"], self._shown["b"])
        electrodes: Image = np.maximum(shown - np.float32(self._tuning.between), np.float32(0.0))
        if not electrodes.any():
            electrodes = self.profile
        self.weights: Image = electrodes / np.float32(electrodes.sum())
        self.between = self.weights <= np.median(self.weights)
        self.wire = {plane: self._likeliest_wire(float(self._shown[plane][self.between].mean())) for plane in PLANES}
        cross: Image = self.profile @ self._means["a"] + self.profile @ self._means["b"]
        cross = 0.5 * (cross + cross[::-1])
        self._show(self.profile[:, None] * (cross / max(float(cross[HALF_WIDTH]), 1e-6)).astype(np.float32))

    def _likeliest_wire(self, seen: float) -> float:
        """What a wire shows, of which so many pairs have shown something in the mean: one pair's noise tells little."""
        tuning = self._tuning
        wires, noise = tuning.wire_spread**-2.0, self._count * tuning.wire_noise**-2.0
        return float((wires * tuning.usual_wire + noise * seen) / (wires + noise))

    def _along(self, strip: Image) -> Image:
        """(L,) what a strip shows on the curve itself, as far as it may count for the ring."""
        before, on, after = strip[:, HALF_WIDTH - 1 : HALF_WIDTH + 2].T
        centre = (before + on + after) / np.float32(3.0)
        smooth = cv2.GaussianBlur(centre[:, None], (1, 5), sigmaX=0.01, sigmaY=self._tuning.smoothing_points)
        return np.asarray(np.clip(smooth.reshape(-1), 0.0, np.float32(self._tuning.ceiling)))

    def _show(self, values: Image) -> None:
        self.values = values
        self.slopes = slope(values, axis=0), slope(values, axis=1)


def _mean(one: Image, other: Image) -> Image:
    return np.asarray(np.float32(0.5) * (one + other))


def correlation(one: Image, other: Image) -> float:
    """Of two strips alike in size: 1 where one is a multiple of the other."""
    return float(np.vdot(one, other) / max(np.sqrt(float(np.vdot(one, one)) * float(np.vdot(other, other))), 1e-9))
