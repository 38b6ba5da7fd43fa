"""Whether a simulated ring is in its place and a pose is due, and how plainly the images show it, from the truth.

A ring that has slid by more than 2 mm, that a patient's shift has taken with it, or that has been wound up asks for no
pose: silence is right. What is published all the same is judged. A displaced ring (3 mm and more, moved, or a third of
it withdrawn) has no right pose at all. After a patient's shift the atrium lies elsewhere on the table, and `motion`
says where: a pose that has followed it is right for the overlay, since the volume is registered to the table; one that
has not is wrong.
"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from lasso_motion_ros.evaluation.measures import DISPLACED_MM, SILENT_LOSS_MM, PairTruth
from lasso_motion_ros.geometry.frames import PLANES
from lasso_motion_ros.phantom import Scenario, SimulatedPair, Simulator
from lasso_motion_ros.phantom.gantry import published_projection, true_projection
from lasso_motion_ros.phantom.shown_poles import pole_evidence

Array = npt.NDArray[np.float64]


@dataclass(frozen=True)
class PlaceLimits:
    """Limits of a ring in its place; those of a slide are the evaluation's own.

    Attributes:
        withdrawing: share of the loop in its sheath from which on no pose is due.
        withdrawn: from which on it is no ring any more.
        resized: change of its diameter, as a share, from which on it is another ring than the seed's.
        refused_gap_mm: planes that disagree by this at the seed are to be refused.
    """

    withdrawing: float = 0.05
    withdrawn: float = 0.35
    resized: float = 0.05
    refused_gap_mm: float = 8.0


LIMITS = PlaceLimits()
MOVES_UNSAID = ("table_pan", "gantry_turn", "zoom")


def with_place(true: PairTruth, simulator: Simulator, pair: SimulatedPair) -> PairTruth:
    """A pair's truth with whether the ring is displaced, whether a pose is due, and each plane's evidence."""
    from_place_mm = 1e3 * pair.from_place_m
    scenario = simulator.scenario
    unsaid = any(
        event.kind in MOVES_UNSAID and not event.calibrated and pair.index >= event.first for event in scenario.events
    )
    due = (
        from_place_mm <= SILENT_LOSS_MM
        and pair.withdrawn <= LIMITS.withdrawing
        and abs(simulator.lab.growth(simulator.time_s(pair.index, "a")) - 1.0) <= LIMITS.resized
        and 1e3 * pair.shifted_m <= SILENT_LOSS_MM
        and not unsaid
        and not scenario.calibration_error.swapped
        and seed_gap_mm(scenario) < LIMITS.refused_gap_mm
    )
    evidence = {}
    for plane, frame in pair.images.frames.items():
        if pair.loop is not None:
            pixel_mm = pair.rendered[plane].millimetres_per_pixel(pair.loop.mean(axis=0))
            dark = scenario.imaging.polarity == "dark"
            evidence[plane] = pole_evidence(frame.pixels, pair.poles[plane], pixel_mm, dark=dark)
    displaced = from_place_mm > DISPLACED_MM or pair.withdrawn > LIMITS.withdrawn
    return dataclasses.replace(true, displaced=displaced, due=due, evidence=evidence)


def seed_gap_mm(scenario: Scenario) -> float:
    """How far the published rays to the ring's true centre pass each other by in the first pair, millimetres."""
    centre = 1e-3 * np.asarray(scenario.lasso.centre_mm)
    published = [published_projection(scenario, plane, 0) for plane in PLANES]
    rays = [
        projection.rays(true_projection(scenario, plane, 0).project(centre)[None])[0]
        for plane, projection in zip(PLANES, published, strict=True)
    ]
    across = np.cross(*rays)
    return 1e3 * abs(float((published[1].source - published[0].source) @ across)) / float(np.linalg.norm(across))
