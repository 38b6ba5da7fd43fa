"""The tracker's ideas, each with the way to switch it off.

Where there is a parameter for it, an idea is switched off by its value. Where there is none, the function, method or
constant that carries it is replaced for a while; the tracker itself knows nothing of this.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field, replace
from typing import Any
from unittest import mock

import numpy as np
import numpy.typing as npt

from lasso_motion_ros.config.parameters import Value, configuration_from_values, configuration_values
from lasso_motion_ros.config.stream import StreamConfig
from lasso_motion_ros.geometry.frames import PLANES, FramePair, Plane
from lasso_motion_ros.geometry.projection import Projection
from lasso_motion_ros.geometry.transforms import rigid
from lasso_motion_ros.motion.respiration import FIRST_SPREAD_M, Estimate, RespiratoryMotion
from lasso_motion_ros.ring import appearance
from lasso_motion_ros.ring.alignment import Alignment
from lasso_motion_ros.ring.finding import Finding
from lasso_motion_ros.ring.loop_finder import LoopFinder
from lasso_motion_ros.ring.tracker import AppearanceTracker
from lasso_motion_ros.ring.working_image import Image
from lasso_motion_ros.tracking.tracker import TrackResult

Array = npt.NDArray[np.float64]

PACKAGE = "lasso_motion_ros."
OFF = 1e6  # a limit that nothing reaches


@dataclass(frozen=True)
class Idea:
    """One idea, and how it is switched off.

    Attributes:
        name: as typed.
        without: what is then missing, in words.
        parameters: values of parameters, by dotted name.
        replaced: what takes the place of functions, methods and constants, by dotted name below the package.
    """

    name: str
    without: str
    parameters: Mapping[str, Value] = field(default_factory=dict)
    replaced: Mapping[str, Any] = field(default_factory=dict)

    def configuration(self, config: StreamConfig) -> StreamConfig:
        """The configuration without this idea."""
        return configuration_from_values(StreamConfig, configuration_values(config) | dict(self.parameters))

    @contextmanager
    def switched_off(self) -> Iterator[None]:
        """Replace what carries the idea, for the duration of the block.

        Raises:
            AttributeError: the package has nothing of that name.
        """
        with ExitStack() as stack:
            for name, value in self.replaced.items():
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


class _TurnsWithTheRing(AppearanceTracker):
    """Publishes the ring's own turn as if it were the atrium's."""

    _turned: Array = np.zeros(3)

    def _loop(self, alignment: Alignment, displacement: Array) -> Array:
        self._turned = alignment.turn
        return super()._loop(alignment, displacement)

    def track(self, pair: FramePair) -> TrackResult:
        """Find the loop in the next pair."""
        result = super().track(pair)
        if result.motion is None or result.loop is None:
            return result
        return replace(result, motion=rigid(self._turned, np.zeros(3), result.loop.mean(axis=0)) @ result.motion)


def _nothing(*_: object, **__: object) -> None:
    return None


def _no_departure(*_: object) -> str:
    return ""


def _no(*_: object) -> bool:
    return False


def _certain(*_: object) -> float:
    return 1.0


IDEAS: Mapping[str, Idea] = {
    idea.name: idea
    for idea in (
        # The search.
        Idea("candidates", "several candidates, carried to the end", {"search.candidates": 1}),
        Idea("rivals", "a look at rivals of the first that is found", {}, {"ring.loop_finder.RIVAL_SCORE": OFF}),
        Idea(
            "judged_rivals",
            "asking the motion which of two alike it is",
            {},
            {"ring.loop_finder.RIVAL_CORRELATION": 1.0},
        ),
        Idea("near", "looking near the prediction first", {}, {"ring.loop_finder.LoopFinder.find": _everywhere}),
        Idea(
            "anywhere", "looking everywhere where that fails", {}, {"ring.loop_finder.LoopFinder._search": _near_only}
        ),
        Idea("afar", "a second look, from afar", {}, {"ring.loop_finder.AFAR_CANDIDATES": 0}),
        Idea(
            "prediction",
            "the prediction: the last place instead",
            {},
            {"ring.loop_finder.LoopFinder.find": _unpredicted},
        ),
        Idea("joint", "one search in both planes: each its own best", {}, {"ring.search.RAY_TOLERANCE_M": OFF}),
        Idea("ceiling", "the ceiling by which neither plane drowns the other", {}, {"ring.search.SCORE_CEILING": OFF}),
        Idea("disagreeing", "candidates of planes that disagree", {}, {"ring.search.LARGEST_DISAGREEMENT_M": 1e-9}),
        # What the loop looks like.
        Idea(
            "electrodes",
            "the electrodes' pattern: one profile all along",
            {},
            {"ring.appearance._without_noise": _wire_only},
        ),
        Idea("distinctive", "strips of what is distinctive", {}, {"ring.appearance._without_noise": _not_distinctive}),
        Idea("denoised", "shrinking what is only noise", {}, {"ring.appearance._without_noise": _as_sampled}),
        Idea(
            "learning",
            "learning the appearance, and what correlation is usual, from later pairs",
            {},
            {"ring.appearance.Appearance.update": _nothing},
        ),
        Idea("local", "contrast in units of the local noise", {}, {"ring.working_image._local_mean": _even}),
        Idea("clip", "clipping of strong contrast", {}, {"ring.working_image.CLIP": OFF}),
        # Alignment.
        Idea("robust", "robust weights", {}, {"ring.loop_views.OUTLIER_SIGMAS": OFF}),
        Idea("ring", "the ring's own tilt, spin and size", {"ring.turn_deg": 0.1, "ring.stretch": 0.001}),
        Idea("priors", "the priors of tilt, spin and size", {"ring.turn_deg": 20.0, "ring.stretch": 0.2}),
        Idea("hopeless", "giving up early on hopeless candidates", {}, {"ring.alignment.HOPELESS_LIKENESS": ()}),
        Idea("unawaited", "not waiting for a plane that shows nothing", {}, {"ring.loop_views.NOTHING_LIKENESS": -OFF}),
        Idea(
            "translation",
            "publishing the translation alone: the ring's turn as well",
            {},
            {"stream.tracker_factory.AppearanceTracker": _TurnsWithTheRing},
        ),
        Idea(
            "rotation",
            "the rotation that repeats with the breath",
            {},
            {"motion.breathing_rotation.BreathingRotation.learn": _nothing},
        ),
        # The model.
        Idea(
            "calibration",
            "absorbing a calibration's shift at the seed",
            {},
            {"ring.loop_model.epipolar_shift": _no_shift},
        ),
        Idea(
            "images", "fitting the model to the images, not the clicks alone", {}, {"ring.loop_model._snap": _unsnapped}
        ),
        Idea("curve", "an open curve: the ellipse", {}, {"ring.loop_model.BULGE_SIGMA_MM": 1e-3}),
        Idea("centre", "the circle's centre: the points' mean", {}, {"ring.loop_model._circle_centre": _mean}),
        Idea("polarity", "trying the other polarity where in doubt", {}, {"ring.loop_model.DOUBTFUL_CONTRAST": -OFF}),
        # The motion in time.
        Idea("together", "plane B's own time of exposure", {}, _TOGETHER),
        Idea(
            "filter", "the filter in time, and B's own time", {}, {**_TOGETHER, "motion.respiration.TIME_SCALE_S": 0.03}
        ),
        Idea("foreseen", "where breathing is known to move the heart", {"posture": "unknown"}),
        Idea("between", "the motion between the first two exposures", {}, {"ring.loop_model._between": _nothing}),
        Idea(
            "direction",
            "learning the breathing's direction",
            {},
            {"motion.respiration.RespiratoryMotion.learn": _nothing},
        ),
        Idea("rebuild", "going through the past again", {}, {"motion.respiration.REBUILD_AT": frozenset()}),
        Idea("heartbeat", "the heartbeat beside the breathing", {}, {"motion.respiration.HEARTBEAT_SPREAD_M": 1e-6}),
        Idea(
            "doubt", "doubt of a depth that no plane sees", {}, {"motion.respiration.RespiratoryMotion.doubt": _certain}
        ),
        # Judgement.
        Idea(
            "thresholds",
            "asking for likeness and visible share",
            {
                "judgement.smallest_likeness": 0.0,
                "judgement.smallest_visible": 0.0,
            },
        ),
        Idea(
            "dose",
            "the likeness that the dose allows: 0.4 of correlation for all",
            {},
            {"ring.tracker.Appearance": _AnyDose},
        ),
        Idea("ghost", "asking that contrast does not fade", {}, {"ring.tracker.GHOST_CONTRAST": 0.0}),
        Idea("visible", "asking for the visible share", {"judgement.smallest_visible": 0.0}),
        Idea("faint", "less to be asked where it is foreseen", {}, {"ring.finding.is_faintly_seen": _no}),
        Idea("one_plane", "poses that rest on one plane", {"judgement.one_plane_s": 0.0}),
        Idea("gap", "the planes' disagreement", {"judgement.degraded_gap_mm": OFF, "judgement.lost_gap_mm": OFF}),
        Idea("turn", "limits of the ring's turn", {"judgement.degraded_turn_deg": OFF, "judgement.lost_turn_deg": OFF}),
        Idea("found_share", "asking for more after a loss", {}, {"ring.tracker.FOUND_AGAIN_SHARE": 0.0}),
        Idea("found_turn", "asking that it lies as it lay", {}, {"ring.ring_lay.FOUND_AGAIN_TURN_DEG": OFF}),
        Idea("edge_on", "care where it is edge-on in both planes", {}, {"ring.finding.EDGE_ON_RATIO": 0.0}),
        Idea(
            "envelope",
            "judging by the breathing so far",
            {},
            {"ring.judgement.BreathingEnvelope.departure": _no_departure},
        ),
        Idea("foresight", "doubt of a place that nothing foretold", {}, {"ring.foresight.LARGEST_SURPRISE": OFF}),
        Idea("speed", "the limit of speed", {"judgement.largest_speed_mm_s": OFF}),
        Idea("acceleration", "the limit of acceleration", {}, {"ring.judgement.LARGEST_ACCELERATION_MM_S2": 1e9}),
        Idea("repeatable", "a narrow curve once breaths repeat", {"judgement.repeatable_mm": OFF}),
        Idea("deeper", "deeper breaths than before", {"judgement.deeper_breath_mm": 0.0}),
    )
}
