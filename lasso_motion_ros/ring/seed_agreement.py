"""How well the planes agree on where the ring is at the seed: what the calibration is worth.

The planes of an exact calibration see the ring's centre on one epipolar plane. What they lie off it is absorbed, since
no calibration is exact, but it tells how far the calibration is to be believed: a pose rests on it.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from lasso_motion_ros.config.ring import JudgementConfig
from lasso_motion_ros.core.errors import ReconstructionError, SeedError
from lasso_motion_ros.geometry.frames import PLANES, FramePair, Plane
from lasso_motion_ros.geometry.projection import Projection
from lasso_motion_ros.ring.loop_model import LoopModel
from lasso_motion_ros.seeding.reconstruction import epipolar_shift

Array = npt.NDArray[np.float64]


@dataclass(frozen=True)
class _Tuning:
    """What else than the calibration sets the planes apart, and when a swap of the calibrations explains it."""

    usual_speed_m_s: float = 0.015  # of breathing: where plane B is exposed later the ring has moved in between
    fastest_m_s: float = 0.04
    swapped_share: float = 0.45  # of the disagreement, at most, if A's and B's calibrations are exchanged


TUNING = _Tuning()


@dataclass(frozen=True)
class SeedAgreement:
    """How the planes agree at the seed.

    Attributes:
        gap_mm: by which the planes' rays to the ring's centre pass each other, mm at the ring.
        doubt: why poses that rest on it are in doubt; empty if they are not.
    """

    gap_mm: float
    doubt: str

    def doubted(self, doubt: str) -> SeedAgreement:
        """The same with one more doubt; an empty one is none."""
        return replace(self, doubt="; ".join(one for one in (self.doubt, doubt) if one))


def seed_agreement(model: LoopModel, pair: FramePair, limits: JudgementConfig) -> SeedAgreement:
    """Judge the calibration by what the seed pair shows.

    Args:
        model: the ring, with the planes' offsets that were absorbed.
        pair: the seed pair, both planes.
        limits: what is borne.

    Raises:
        SeedError: the planes disagree by more than any usable calibration, or would not if A's and B's were exchanged.
            (A ring near the iso-centre does not show that: both calibrations see it alike.)
    """
    projections = {plane: frame.projection for plane, frame in pair.frames.items()}
    gap_mm = 1e3 * abs(_gap_m(model.normal, {p: model.shift(p, projections[p]) for p in PLANES}, projections, model))
    frames = pair.frames
    between_s = abs(frames["b"].stamp_ns - frames["a"].stamp_ns) * 1e-9
    if gap_mm <= limits.seed_degraded_gap_mm + 1e3 * TUNING.usual_speed_m_s * between_s:
        return SeedAgreement(gap_mm, "")
    text = f"the planes disagree by {gap_mm:.1f} mm at the seed"
    if (swapped_mm := _swapped_gap_mm(model, projections)) < TUNING.swapped_share * gap_mm:
        raise SeedError(
            f"{text}, and by {swapped_mm:.1f} mm only with the calibrations of A and B exchanged: are they swapped?"
        )
    text = f"{text}: wrong calibration, or clicks on different things?"
    if gap_mm > limits.seed_refused_gap_mm + 1e3 * TUNING.fastest_m_s * between_s:
        raise SeedError(f"{text} (at most {limits.seed_refused_gap_mm:g} mm are borne)")
    return SeedAgreement(gap_mm, text)


def _gap_m(
    normal: Array, shifts: Mapping[Plane, Array], projections: Mapping[Plane, Projection], model: LoopModel
) -> float:
    """By how much plane B sees the ring higher than plane A, along the epipolar planes' normal, metres."""
    heights = {}
    for plane in PLANES:
        px_per_m = projections[plane].jacobian(model.centre) @ normal
        heights[plane] = float(shifts[plane] @ px_per_m / (px_per_m @ px_per_m))
    return heights["b"] - heights["a"]


def _swapped_gap_mm(model: LoopModel, projections: Mapping[Plane, Projection]) -> float:
    """The same if each plane had the other's calibration, mm; infinite where that makes no sense."""
    seen = {p: projections[p].project(model.points) + model.shift(p, projections[p]) for p in PLANES}
    swapped: dict[Plane, Projection] = {"a": projections["b"], "b": projections["a"]}
    sizes = {(projection.width, projection.height) for projection in projections.values()}
    if len(sizes) > 1:
        return float("inf")
    try:
        shift = epipolar_shift(swapped, seen, share_of_a=0.0)["b"]
    except ReconstructionError:
        return float("inf")
    return float(np.linalg.norm(shift)) * swapped["b"].millimetres_per_pixel(model.centre)
