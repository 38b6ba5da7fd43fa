"""All that a scenario has of the lab: bystanders, the working catheter, incidents, as functions of time."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable

import numpy as np
import numpy.typing as npt

from lasso_motion_ros.geometry.curves import resample
from lasso_motion_ros.geometry.frames import PLANES, Plane
from lasso_motion_ros.geometry.projection import Projection
from lasso_motion_ros.geometry.transforms import apply, inverse
from lasso_motion_ros.phantom.bodies import Body
from lasso_motion_ros.phantom.body_renderer import BodyState
from lasso_motion_ros.phantom.catheters import (
    SEPTUM,
    Loop,
    ablation,
    along_curve,
    body_segments,
    build_loop,
    curve_length,
    electrode_places,
    electrode_segments,
    lasso_shaft,
    wire_segments,
)
from lasso_motion_ros.phantom.contrast import Tree, contrast_depth, coronary_tree, vein_tree
from lasso_motion_ros.phantom.gantry import true_projection
from lasso_motion_ros.phantom.imaging import Exposure
from lasso_motion_ros.phantom.lab_devices import TwinLasso, echo_probe, pacing_catheter, skin_discs, star_catheter
from lasso_motion_ros.phantom.lab_settings import Incident
from lasso_motion_ros.phantom.motion_incidents import (
    patient_pose,
    ring_growth,
    ring_slide,
    seat_motion,
    withdrawn_share,
)
from lasso_motion_ros.phantom.settings import Scenario
from lasso_motion_ros.phantom.tubes import Segments, joined
from lasso_motion_ros.phantom.working_ablation import WorkingTip

Array = npt.NDArray[np.float64]
Random = Callable[[int], np.random.Generator]

LOOP_POINTS = 90
SHAFT_RADIUS = 0.75e-3

# Purposes of the random streams.
_TIP, _TWIN, _VESSELS, _SKIN = range(4)


class Lab:
    """The lab of one scenario. Places and motions are those of the patient; the patient's own shift is apart.

    Args:
        scenario: what is rendered.
        loop: the ring in the first pair, before any motion.
        start: (4, 4) the heart's motion from end-expiration to the first pair.
        trunk: the patient's skin.
        random: gives a random stream for each purpose.
    """

    def __init__(self, scenario: Scenario, loop: Loop, start: Array, trunk: Body, random: Random) -> None:
        self._scenario, self._loop, self._start = scenario, loop, start
        self._length_m = curve_length(loop.points)
        self.incidents = scenario.incidents
        bystanders = scenario.bystanders
        duration = (scenario.pairs + 1) / scenario.rate_hz
        self._tip: WorkingTip | None = None
        if scenario.ablation_work.works:
            self._tip = WorkingTip(scenario.ablation_work, loop, random(_TIP), duration)
        self._twin = TwinLasso(scenario.lasso, bystanders, random(_TWIN)) if bystanders.twin else None
        self._trees: dict[str, Tree] = {}
        if self._of("contrast"):
            self._trees = {"vein": vein_tree(loop, random(_VESSELS)), "coronary": coronary_tree(start)}
        self._discs = joined([])
        if bystanders.ecg_discs:
            projections = [true_projection(scenario, plane, 0) for plane in PLANES]
            self._discs = skin_discs(projections, trunk, loop.centre, bystanders.ecg_discs, random(_SKIN))

    def patient_pose(self, time_s: float) -> Array:
        """(4, 4) where the patient lies, relative to the first pair."""
        return patient_pose(self.incidents, time_s)

    def seen_by(self, projection: Projection, time_s: float) -> Projection:
        """A projection from the patient's own axes: who moves on the table is seen as if the C-arm had moved."""
        if not self._of("shift"):
            return projection
        return Projection(projection.matrix @ self.patient_pose(time_s), projection.width, projection.height)

    def shape(self, time_s: float) -> Loop:
        """The loop's own shape, without any motion: a variable loop winds up or opens, its length the same."""
        growth = self.growth(time_s)
        if growth == 1.0:
            return self._loop
        lasso = self._scenario.lasso
        resized = dataclasses.replace(lasso, diameter_mm=lasso.diameter_mm * growth, turns=lasso.turns / growth)
        return build_loop(resized, SEPTUM)

    def growth(self, time_s: float) -> float:
        """Diameter of the loop by that in the first pair."""
        return ring_growth(self.incidents, time_s)

    def off_place(self, time_s: float) -> Array:
        """(3,) how far the ring lies from its place: slid, or to and fro on its seat; metres."""
        return ring_slide(self.incidents, self._loop.normal, time_s) + seat_motion(self._scenario.lasso, time_s)

    def withdrawn(self, time_s: float) -> float:
        """How much of the loop is in its sheath, 0 to 1."""
        return withdrawn_share(self.incidents, time_s)

    def seen_loop(self, loop: Array, time_s: float) -> Array:
        """(90, 3) the part of a loop (90, 3) that is not in the sheath."""
        share = self.withdrawn(time_s)
        if share == 0.0:
            return loop
        at = np.linspace(min(share, 0.98), 1.0, LOOP_POINTS) * curve_length(loop)
        return along_curve(loop, at)

    def poles(self, loop: Array, time_s: float) -> Array:
        """(E, 3) the electrodes' middles on a loop (90, 3), where they are still on it; metres."""
        length = curve_length(loop)
        places = self._electrode_places(length, time_s)
        return along_curve(loop, places[places <= length])

    def _electrode_places(self, length_m: float, time_s: float) -> Array:
        """(E,) the electrodes' middles along a loop of a length and on along its shaft, metres from the loop's tip.

        They sit on the wire: a loop that the heart widens draws wire out of its shaft.
        """
        return electrode_places(self._length_m, self._scenario.lasso) + self.withdrawn(time_s) * length_m

    def lasso(self, loop: Array, motion: Array, time_s: float) -> Segments:
        """The lasso with its shaft; what is withdrawn lies in the shaft."""
        shaft = lasso_shaft(loop, self._loop.normal, motion)
        share, length, lasso = self.withdrawn(time_s), curve_length(loop), self._scenario.lasso
        wire, whole = loop, np.concatenate([loop, shaft[1:]])
        if share > 0.0:
            # Drawn along itself: the tip goes the way that the loop lies.
            wire = resample(along_curve(whole, np.linspace(share * length, (1.0 + share) * length, 181)), LOOP_POINTS)
        return joined(
            [
                body_segments(shaft, SHAFT_RADIUS),
                wire_segments(resample(wire, 2 * LOOP_POINTS), lasso),
                electrode_segments(whole, self._electrode_places(length, time_s), lasso),
            ]
        )

    def segments(self, time_s: float, state: BodyState) -> Segments:
        """All that the lab adds to the patient's own catheters, at one instant."""
        bystanders = self._scenario.bystanders
        motion, since_first = state.heart, state.heart @ inverse(self._start)
        parts: list[Segments] = []
        if self._tip is not None:
            parts.append(self._working(self._tip, time_s, state, since_first))
        if bystanders.tee_probe:
            # The examiner turns and shifts it a little all the time.
            hand = 1e-3 * np.array([1.5 * np.sin(0.6 * time_s), 0.0, 3.0 * (np.sin(0.35 * time_s + 1.0) - 0.84)])
            parts.append(echo_probe(1e-3 * bystanders.tee_diameter_mm, motion, hand))
        if bystanders.star:
            parts.append(self._star(time_s, motion, since_first))
        if self._twin is not None:
            parts.append(self._twin.segments(since_first, motion))
        if bystanders.pacing:
            parts.append(pacing_catheter(motion, state.contraction))
        if bystanders.ecg_discs:
            # The chest wall rises by a tenth of what the heart descends.
            lift = np.broadcast_to(np.array([0.0, 0.12, -0.10]) * state.breath[2], self._discs.start.shape)
            parts.append(self._discs.moved_by(lift, lift))
        return joined(parts)

    def contrast(self, projection: Projection, time_s: float, state: BodyState) -> npt.NDArray[np.float32]:
        """Optical depth (H, W) of contrast agent; zeros where there is none."""
        if not self._trees:
            return np.zeros((projection.height, projection.width), np.float32)
        since_first = state.heart @ inverse(self._start)
        depth = contrast_depth(projection, self._trees, self.incidents, time_s, since_first, state.contraction)
        return depth.astype(np.float32)

    def exposure(self, plane: Plane, time_s: float) -> Exposure:
        """How a plane's picture at a time is taken and shown."""
        dose = window = 1.0
        covered = np.asarray(self._scenario.imaging.collimator, dtype=np.float64)
        for incident in self.incidents:
            if not incident.concerns(plane):
                continue
            if incident.kind == "dose" and incident.lasts(time_s):
                dose *= incident.amount
            elif incident.kind == "window" and incident.lasts(time_s):
                window *= incident.amount
            elif incident.kind == "shutter":
                covered = np.maximum(covered, incident.progress(time_s) * np.asarray(incident.covered))
        return Exposure(dose, window, tuple(float(share) for share in covered))

    def off(self, plane: Plane, time_s: float) -> bool:
        """Whether a plane is switched off."""
        return any(incident.concerns(plane) and incident.lasts(time_s) for incident in self._of("off"))

    def _working(self, working: WorkingTip, time_s: float, state: BodyState, since_first: Array) -> Segments:
        work = self._scenario.ablation_work
        tip, tangent = working.at(time_s, state.contraction)
        from_septum = (tip - SEPTUM) / np.linalg.norm(tip - SEPTUM)
        heading = from_septum + 0.7 * np.sign(from_septum @ tangent) * tangent
        heading = heading / np.linalg.norm(heading)
        return ablation(
            apply(since_first, tip),
            since_first[:3, :3] @ heading,
            state.heart,
            1e-3 * work.tip_length_mm,
            0.5e-3 * work.tip_diameter_mm,
        )

    def _star(self, time_s: float, motion: Array, since_first: Array) -> Segments:
        bystanders = self._scenario.bystanders
        # Led to and fro through the atrium, across the way from the septum.
        swing = 9.0e-3 * np.sin(bystanders.star_drift_mm_s * time_s / 9.0) * np.array([0.3, -0.5, 0.8])
        hub = apply(since_first, self._loop.centre + 1e-3 * np.asarray(bystanders.star_offset_mm) + swing)
        towards = hub - apply(motion, SEPTUM)
        return star_catheter(hub, towards / np.linalg.norm(towards), motion)

    def _of(self, kind: str) -> list[Incident]:
        return [incident for incident in self.incidents if incident.kind == kind]
