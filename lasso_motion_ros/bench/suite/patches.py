"""Patches into the ring tracker, for those of its ideas that have no seam yet.

The tracker's insides are to be redesigned, and will bring options for what an ablation switches. Till then a function,
method or constant that carries an idea is replaced for a while, by its dotted name. This is the one file of the package
that does so, and the one that knows such a name; the tracker itself knows nothing of it.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import ExitStack, contextmanager
from typing import Any
from unittest import mock

import numpy as np
import numpy.typing as npt

from lasso_motion_ros.geometry.frames import PLANES, FramePair, Plane
from lasso_motion_ros.geometry.projection import Projection
from lasso_motion_ros.motion.respiration import FIRST_SPREAD_M, Estimate, RespiratoryMotion
from lasso_motion_ros.ring import appearance
from lasso_motion_ros.ring.finding import Finding
from lasso_motion_ros.ring.loop_finder import LoopFinder
from lasso_motion_ros.ring.working_image import Image

Array = npt.NDArray[np.float64]

PACKAGE = "lasso_motion_ros."
OFF = 1e6  # a limit that nothing reaches


@contextmanager
def patched(idea: str) -> Iterator[None]:
    """Replace what carries an idea, for the duration of the block; nothing, where it needs no patch.

    Raises:
        AttributeError: the package has nothing of that name.
    """
    with ExitStack() as stack:
        for name, value in PATCHES.get(idea, {}).items():
            stack.enter_context(mock.patch(PACKAGE + name, value))
        yield


_find, _search = LoopFinder.find, LoopFinder._search
_without_noise = appearance._without_noise


def _everywhere(self: LoopFinder, pair: FramePair, respiration: RespiratoryMotion, **how: Any) -> Finding | None:
    return _find(self, pair, respiration, **how | {"near_first": False})


def _near_only(self: LoopFinder, *what: Any, near: bool) -> Any:
    del near
    return _search(self, *what, near=True)


class _Standing(RespiratoryMotion):
    """A motion that is asked for its prediction and gives its last place."""

    def __init__(self, motion: RespiratoryMotion) -> None:
        self._motion = motion

    def predict(self, time_s: float) -> Estimate:
        del time_s
        return Estimate(self._motion.at_a.displacement, FIRST_SPREAD_M**2 * np.eye(3))

    def expected_between(self, time_s: float) -> Estimate:
        del time_s
        between = self._motion.at_a.displacement - self._motion.origin_b.displacement
        return Estimate(between, FIRST_SPREAD_M**2 * np.eye(3))

    def copy(self) -> RespiratoryMotion:
        return self._motion.copy()


def _unpredicted(self: LoopFinder, pair: FramePair, respiration: RespiratoryMotion, **how: Any) -> Finding | None:
    return _find(self, pair, _Standing(respiration), **how)


def _exposed_together(self: LoopFinder, pair: FramePair) -> dict[Plane, float]:
    return {plane: self.seconds(pair.stamp_ns) for plane in pair.frames}


def _started_together(time_a_s: float, time_b_s: float, *, shape: Array, between: object) -> RespiratoryMotion:
    del time_b_s, between
    return RespiratoryMotion(time_a_s, time_a_s, shape=shape)


_TOGETHER: Mapping[str, Any] = {
    "ring.loop_finder.LoopFinder.exposures": _exposed_together,
    "ring.tracker.RespiratoryMotion": _started_together,
}


def _no_shift(
    projections: dict[Plane, Projection], outlines: dict[Plane, Array], share_of_a: float
) -> dict[Plane, Array]:
    del projections, outlines, share_of_a
    return {plane: np.zeros(2) for plane in PLANES}


def _unsnapped(curve: Array, frame: object, projection: Projection, bright: bool, sigma_mm: float) -> Array:
    del frame, bright, sigma_mm
    return projection.project(curve)


def _mean(points: Array) -> Array:
    return np.asarray(points.mean(axis=0))


def _as_sampled(mean: Image) -> tuple[Image, Image]:
    return mean, mean


def _not_distinctive(mean: Image) -> tuple[Image, Image]:
    values, _ = _without_noise(mean)
    return values, values


def _wire_only(mean: Image) -> tuple[Image, Image]:
    profile = np.median(mean, axis=0, keepdims=True).astype(np.float32)
    even = np.broadcast_to(profile, mean.shape).copy()
    return even, even


def _even(cells: Image) -> Image:
    return np.full_like(cells, np.mean(cells))


class _AnyDose(appearance.Appearance):
    """Expects the same correlation of every loop: with the smallest likeness, 0.65, at least 0.4."""

    def __init__(self, first: Image, contrast: float) -> None:
        super().__init__(first, contrast)
        self.usual = 0.4 / 0.65

    def update(self, strip: Image, correlation: float) -> None:
        """Learn all but what correlation is usual."""
        super().update(strip, correlation)
        self.usual = 0.4 / 0.65


def _nothing(*_: object, **__: object) -> None:
    return None


def _no_departure(*_: object) -> str:
    return ""


def _no(*_: object) -> bool:
    return False


def _certain(*_: object) -> float:
    return 1.0


PATCHES: Mapping[str, Mapping[str, Any]] = {
    "rivals": {"ring.loop_finder.RIVAL_SCORE": OFF},
    "judged_rivals": {"ring.loop_finder.RIVAL_CORRELATION": 1.0},
    "near": {"ring.loop_finder.LoopFinder.find": _everywhere},
    "anywhere": {"ring.loop_finder.LoopFinder._search": _near_only},
    "afar": {"ring.loop_finder.AFAR_CANDIDATES": 0},
    "prediction": {"ring.loop_finder.LoopFinder.find": _unpredicted},
    "joint": {"ring.search.RAY_TOLERANCE_M": OFF},
    "ceiling": {"ring.search.SCORE_CEILING": OFF},
    "disagreeing": {"ring.search.LARGEST_DISAGREEMENT_M": 1e-9},
    "electrodes": {"ring.appearance._without_noise": _wire_only},
    "distinctive": {"ring.appearance._without_noise": _not_distinctive},
    "denoised": {"ring.appearance._without_noise": _as_sampled},
    "learning": {"ring.appearance.Appearance.update": _nothing},
    "local": {"ring.working_image._local_mean": _even},
    "clip": {"ring.working_image.CLIP": OFF},
    "robust": {"ring.loop_views.OUTLIER_SIGMAS": OFF},
    "hopeless": {"ring.alignment.HOPELESS_LIKENESS": ()},
    "unawaited": {"ring.loop_views.NOTHING_LIKENESS": -OFF},
    "rotation": {"motion.breathing_rotation.BreathingRotation.learn": _nothing},
    "calibration": {"ring.loop_model.epipolar_shift": _no_shift},
    "images": {"ring.loop_model._snap": _unsnapped},
    "curve": {"ring.loop_model.BULGE_SIGMA_MM": 1e-3},
    "centre": {"ring.loop_model._circle_centre": _mean},
    "polarity": {"ring.loop_model.DOUBTFUL_CONTRAST": -OFF},
    "together": _TOGETHER,
    "filter": {**_TOGETHER, "motion.respiration.TIME_SCALE_S": 0.03},
    "between": {"ring.loop_model._between": _nothing},
    "direction": {"motion.respiration.RespiratoryMotion.learn": _nothing},
    "rebuild": {"motion.respiration.REBUILD_AT": frozenset()},
    "heartbeat": {"motion.respiration.HEARTBEAT_SPREAD_M": 1e-6},
    "doubt": {"motion.respiration.RespiratoryMotion.doubt": _certain},
    "dose": {"ring.tracker.Appearance": _AnyDose},
    "ghost": {"ring.tracker.GHOST_CONTRAST": 0.0},
    "faint": {"ring.finding.is_faintly_seen": _no},
    "found_share": {"ring.tracker.FOUND_AGAIN_SHARE": 0.0},
    "found_turn": {"ring.ring_lay.FOUND_AGAIN_TURN_DEG": OFF},
    "edge_on": {"ring.finding.EDGE_ON_RATIO": 0.0},
    "envelope": {"ring.judgement.BreathingEnvelope.departure": _no_departure},
    "foresight": {"ring.foresight.LARGEST_SURPRISE": OFF},
    "acceleration": {"ring.judgement.LARGEST_ACCELERATION_MM_S2": 1e9},
}
"""By the idea's name: what takes the place of functions, methods and constants, by dotted name below the package."""
