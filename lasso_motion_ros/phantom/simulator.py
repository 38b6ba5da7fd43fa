"""The simulator: a scenario in, biplane pairs with exact truth out."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import lru_cache
from typing import Protocol

import numpy as np
import numpy.typing as npt

from lasso_motion_ros.geometry.frames import PLANES, Frame, FramePair, Plane
from lasso_motion_ros.geometry.projection import Projection
from lasso_motion_ros.geometry.transforms import apply, inverse, rigid
from lasso_motion_ros.phantom.anatomy import Thorax, build_thorax
from lasso_motion_ros.phantom.body_renderer import BodyRenderer, BodyState, heart_surface_points
from lasso_motion_ros.phantom.catheters import (
    SEPTUM,
    Loop,
    ablation,
    build_loop,
    coronary_sinus,
    deformed_loop,
    loop_segments,
)
from lasso_motion_ros.phantom.distractors import distractor_segments
from lasso_motion_ros.phantom.gantry import concerns, progress, published_projection, true_projection
from lasso_motion_ros.phantom.imaging import ImagingChain, Pixels
from lasso_motion_ros.phantom.lab import Lab
from lasso_motion_ros.phantom.motion import Heartbeat, Motion
from lasso_motion_ros.phantom.motion_incidents import DisturbedBreathing
from lasso_motion_ros.phantom.seeds import clicks_along_loop
from lasso_motion_ros.phantom.settings import Event, Scenario
from lasso_motion_ros.phantom.tubes import Segments, joined, optical_depth

Array = npt.NDArray[np.float64]

EPOCH_NS = 1_760_000_000 * 1_000_000_000
TARGETS = 200

# Purposes of the random streams; a pair's noise does not depend on how many pairs are rendered.
_ANATOMY, _BREATHING, _HEART, _TARGETS, _SEEDS, _DOSE, _QUANTA, _LAB = range(8)


class BodySource(Protocol):
    """What renders the patient without catheters: the procedural thorax, or a CT volume."""

    def optical_depth(self, projection: Projection, state: BodyState) -> npt.NDArray[np.float32]:
        """Line integrals (H, W) through every pixel."""


@dataclass(frozen=True, eq=False)
class SimulatedPair:
    """One pair with its truth.

    Attributes:
        index: number of the pair.
        images: what the tracker gets, with the published projections; a dropped plane is missing.
        rendered: plane → the projection with which the image was rendered.
        motion: (4, 4) of the atrium since pair 0 at A's exposure: breathing, heartbeat, and where the patient lies.
        respiratory: (4, 4) of breathing alone.
        centrelines: plane → (90, 2) the loop's centreline in pixels at A's exposure; missing where it is not in view.
        loop: (90, 3) the loop at A's exposure, world metres; None while it is hidden or removed.
        poles: plane → (E, 2) the electrodes in pixels at the plane's own exposure; none while the loop is hidden.
        from_place_m: how far the loop's middle is from where the atrium's motion has carried its place.
        withdrawn: how much of the loop is in its sheath, 0 to 1.
        shifted_m: how far the patient has moved on the table since pair 0.
    """

    index: int
    images: FramePair
    rendered: dict[Plane, Projection]
    motion: Array
    respiratory: Array
    centrelines: dict[Plane, Array]
    loop: Array | None
    poles: dict[Plane, Array]
    from_place_m: float
    withdrawn: float
    shifted_m: float


class Simulator:
    """Renders one scenario.

    Args:
        scenario: what to render.
        body: the patient; a procedural thorax drawn from the scenario's seed if not given.
    """

    def __init__(self, scenario: Scenario, body: Mapping[Plane, BodySource] | None = None) -> None:
        self.scenario = scenario
        self.motion = scenario_motion(scenario)
        self.thorax: Thorax = _thorax(scenario.seed)
        self._bodies: Mapping[Plane, BodySource] = body or {plane: BodyRenderer(self.thorax) for plane in PLANES}
        self.loop: Loop = build_loop(scenario.lasso, SEPTUM)
        # The loop is placed at the first pair's phase.
        self._start = self.motion.body_state(0.0).heart
        self.lab = Lab(scenario, self.loop, self._start, self.thorax.trunk, lambda purpose: self._random(_LAB, purpose))
        geometry = scenario.geometry
        magnified = scenario.imaging.focal_spot_mm * (geometry.source_detector_mm / geometry.source_object_mm - 1.0)
        spot_px = magnified * geometry.size_px / geometry.field_mm
        self._chains: dict[Plane, ImagingChain] = {plane: ImagingChain(scenario.imaging, spot_px) for plane in PLANES}

    @property
    def reference_loop(self) -> Array:
        """(90, 3) the loop at the first pair, world metres."""
        return self._loop_at(0.0, 0)

    @property
    def targets(self) -> Array:
        """(200, 3) points on the atrium at the first pair, world metres."""
        points = heart_surface_points(self.thorax, TARGETS, self._random(_TARGETS))
        return apply(self._start, points)

    def time_s(self, pair: int, plane: Plane) -> float:
        """Time of a plane's exposure since the first pair."""
        offset = self.scenario.plane_b_offset if plane == "b" else 0.0
        return (pair + offset) / self.scenario.rate_hz

    def stamp_ns(self, pair: int, plane: Plane) -> int:
        """The same as a stamp."""
        return EPOCH_NS + round(self.time_s(pair, plane) * 1e9)

    def r_peaks_ns(self) -> list[int]:
        """Stamps of the R peaks during the sequence."""
        end = self.time_s(self.scenario.pairs - 1, "a")
        return [EPOCH_NS + round(peak * 1e9) for peak in self.motion.heartbeat.r_peaks(end)]

    def seeds(self) -> dict[Plane, Array]:
        """A user's clicks (N, 2) in each plane's first picture."""
        clicks: dict[Plane, Array] = {}
        for plane in PLANES:
            curve = true_projection(self.scenario, plane, 0).project(self._loop_at(self.time_s(0, plane), 0))
            random = self._random(_SEEDS, PLANES.index(plane))
            clicks[plane] = clicks_along_loop(curve, self.scenario.lasso.turns, random, self.scenario.clicks)
        return clicks

    def pairs(self) -> Iterator[SimulatedPair]:
        """All pairs in order, rendered one at a time."""
        for index in range(self.scenario.pairs):
            yield self._pair(index)

    def _pair(self, index: int) -> SimulatedPair:
        frames: dict[Plane, Frame] = {}
        rendered: dict[Plane, Projection] = {}
        centrelines: dict[Plane, Array] = {}
        poles: dict[Plane, Array] = {}
        at_a = self.time_s(index, "a")
        absent = self._absent(index) or self.lab.withdrawn(at_a) >= 1.0
        loop = None if absent else self.lab.seen_loop(self._loop_at(at_a, index), at_a)
        for plane in PLANES:
            projection = true_projection(self.scenario, plane, index)
            time_s = self.time_s(index, plane)
            if not self.lab.off(plane, time_s):
                pixels = self._expose(plane, index, projection)
                if not self._dropped(plane, index):
                    published = published_projection(self.scenario, plane, index)
                    frames[plane] = Frame(self.stamp_ns(index, plane), pixels, published)
                    rendered[plane] = projection
            if loop is not None:
                line = projection.project(loop)
                inside = np.all((line >= 0.0) & (line <= self.scenario.geometry.size_px - 1.0), axis=1)
                if inside.mean() > 0.5:
                    centrelines[plane] = line
                poles[plane] = projection.project(self.lab.poles(self._loop_at(time_s, index), time_s))
        pose = self.lab.patient_pose(at_a)
        return SimulatedPair(
            index=index,
            images=FramePair(self.stamp_ns(index, "a"), frames.get("a"), frames.get("b")),
            rendered=rendered,
            motion=pose @ self.motion.atrium(at_a),
            respiratory=self.motion.respiratory(at_a),
            centrelines=centrelines,
            loop=loop,
            poles=poles,
            from_place_m=float(np.linalg.norm(self._displacement(at_a, index))),
            withdrawn=self.lab.withdrawn(at_a),
            shifted_m=float(np.linalg.norm(pose[:3, 3])),
        )

    def _expose(self, plane: Plane, index: int, projection: Projection) -> Pixels:
        time_s = self.time_s(index, plane)
        state = self.motion.body_state(time_s)
        seen = self.lab.seen_by(projection, time_s)
        depth = self._bodies[plane].optical_depth(seen, state)
        depth = depth + optical_depth(seen, self.catheters(time_s, index)).astype(np.float32)
        depth = depth + self.lab.contrast(seen, time_s, state)
        dose, random = self._dose(plane, index), self._random(_QUANTA, PLANES.index(plane), index)
        return self._chains[plane].expose(depth, dose, random, self.lab.exposure(plane, time_s))

    def catheters(self, time_s: float, index: int) -> Segments:
        """All that is not the body at one instant, as cylinders."""
        scenario = self.scenario
        state = self.motion.body_state(time_s)
        motion, contraction = state.heart, state.contraction
        parts: list[Segments] = []
        if not self._removed(index):
            loop = self._loop_in_patient(time_s, index)
            if self._hidden(index):
                # Withdrawn into its sheath and down the cava, out of the field.
                parts.append(loop_segments(loop + np.array([0.0, 0.0, -0.22]), scenario.lasso))
            else:
                parts.append(self.lab.lasso(loop, motion, time_s))
        if scenario.distractors.coronary_sinus:
            parts.append(coronary_sinus(motion, contraction))
        if scenario.distractors.ablation and not scenario.ablation_work.works:
            tip = self.loop.centre + 1e-3 * np.asarray(scenario.distractors.ablation_offset_mm)
            heading = tip - SEPTUM
            heading = heading / np.linalg.norm(heading)
            parts.append(ablation(apply(motion @ inverse(self._start), tip), heading, motion))
        parts.append(distractor_segments(scenario.distractors, motion, state.breath))
        parts.append(self.lab.segments(time_s, state))
        return joined(parts)

    def _loop_at(self, time_s: float, index: int) -> Array:
        """(90, 3) the loop in the world."""
        return apply(self.lab.patient_pose(time_s), self._loop_in_patient(time_s, index))

    def _loop_in_patient(self, time_s: float, index: int) -> Array:
        """(90, 3) the loop in the patient: its own deformation, then where events put it, then the atrium's motion."""
        points = self._deformed(time_s)
        for event in self._events("move"):
            done = progress(event, index)
            if done > 0.0:
                turn = np.radians(event.turn_deg) * done
                points = apply(rigid(turn, done * 1e-3 * np.asarray(event.shift_mm), points.mean(axis=0)), points)
        return apply(self.motion.atrium(time_s), points + self.lab.off_place(time_s))

    def _deformed(self, time_s: float) -> Array:
        """(90, 3) the loop in its place, as the heartbeat tilts and stretches it."""
        lasso = self.scenario.lasso
        swing_tilt, swing_stretch = self.motion.heartbeat.swing(time_s)
        tilt_rad = np.radians(lasso.tilt_deg) * swing_tilt
        return deformed_loop(self.lab.shape(time_s), tilt_rad, lasso.stretch * swing_stretch)

    def _displacement(self, time_s: float, index: int) -> Array:
        """(3,) of the loop's middle from where the atrium's motion has carried its place, metres."""
        place = apply(self.motion.atrium(time_s), self._deformed(time_s))
        return np.asarray(self._loop_in_patient(time_s, index).mean(axis=0) - place.mean(axis=0))

    def _dose(self, plane: Plane, index: int) -> float:
        """The exposure control hunts slowly: two incommensurate oscillations with phases of their own."""
        phase = self._random(_DOSE, PLANES.index(plane)).uniform(0.0, 2.0 * np.pi, 2)
        time_s = self.time_s(index, plane)
        hunting = (
            np.sin(0.7 * time_s + phase[0])
            - np.sin(phase[0])
            + 0.5 * (np.sin(1.9 * time_s + phase[1]) - np.sin(phase[1]))
        )
        return float(max(0.2, 1.0 + self.scenario.imaging.brightness_drift * hunting))

    def _events(self, kind: str) -> list[Event]:
        return [event for event in self.scenario.events if event.kind == kind]

    def _hidden(self, index: int) -> bool:
        return any(event.first <= index <= event.end for event in self._events("hide"))

    def _removed(self, index: int) -> bool:
        return any(index >= event.first for event in self._events("remove"))

    def _absent(self, index: int) -> bool:
        return self._hidden(index) or self._removed(index)

    def _dropped(self, plane: Plane, index: int) -> bool:
        return any(event.first <= index <= event.end and concerns(event, plane) for event in self._events("drop"))

    def _random(self, *purpose: int) -> np.random.Generator:
        return _random(self.scenario, *purpose)


def scenario_motion(scenario: Scenario) -> Motion:
    """How a scenario's patient moves; to draw the anatomy as well would take a hundred times as long."""
    duration = (scenario.pairs + 1) / scenario.rate_hz
    return Motion(
        DisturbedBreathing(scenario.breathing, _random(scenario, _BREATHING), duration, scenario.incidents),
        Heartbeat(scenario.heart, _random(scenario, _HEART), duration),
    )


@lru_cache(maxsize=4)
def _thorax(seed: int) -> Thorax:
    """The patient of a seed; a sweep renders the same one many times, and to build it takes a quarter of a second."""
    return build_thorax(np.random.default_rng([seed, _ANATOMY]))


def _random(scenario: Scenario, *purpose: int) -> np.random.Generator:
    return np.random.default_rng([scenario.seed, *purpose])
