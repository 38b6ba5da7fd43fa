"""Changes that traps, lab traps and the clinic suite's classes make to a scenario, and what they may cover of it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from lasso_motion_ros.bench.suite.moderate import altered
from lasso_motion_ros.bench.suite.vectors import as_vector, unit
from lasso_motion_ros.geometry.frames import PLANES
from lasso_motion_ros.phantom.gantry import true_projection
from lasso_motion_ros.phantom.lab_settings import Incident
from lasso_motion_ros.phantom.settings import Event, Scenario


@dataclass(frozen=True)
class _Tuning:
    """How far a change goes.

    Attributes:
        shutter_margin: share of the field, between the loop's whole path and the shutters.
        shutter_most: share of the field that a shutter covers at most.
        most_pairs: of a sequence that is made longer.
    """

    shutter_margin: float = 0.05
    shutter_most: float = 0.38
    most_pairs: int = 60


TUNING = _Tuning()


def lasting(scenario: Scenario, seconds: float) -> Scenario:
    """The scenario made long enough to go on for a time; slower rather than of very many pairs."""
    rate_hz = min(scenario.rate_hz, TUNING.most_pairs / seconds)
    return altered(scenario, rate_hz=rate_hz, pairs=max(scenario.pairs, int(np.ceil(seconds * rate_hz))))


def edge_on_normal(scenario: Scenario, plane: int, off_deg: float) -> tuple[float, ...]:
    """An axis near the scenario's own with which the loop is seen `off_deg` from edge-on in a plane."""
    viewing = true_projection(scenario, PLANES[plane], 0).viewing_direction
    normal = np.asarray(scenario.lasso.normal)
    normal = normal - (normal @ viewing) * viewing
    return as_vector(normal / np.linalg.norm(normal) + np.sin(np.radians(off_deg)) * viewing)


def path_shutters(
    scenario: Scenario, margin: float = TUNING.shutter_margin, most: float = TUNING.shutter_most
) -> tuple[float, ...]:
    """What shutters may cover at left, top, right and bottom without covering the loop at any phase of a breath.

    Args:
        scenario: where the loop lies and how it breathes.
        margin: left open about it, of the field.
        most: covered on one side, of the field.
    """
    centre = 1e-3 * np.asarray(scenario.lasso.centre_mm)
    radius = 0.5e-3 * scenario.lasso.diameter_mm
    breath = 1e-3 * scenario.breathing.amplitude_mm * unit(scenario.breathing.direction)
    sides = (*np.eye(3), *-np.eye(3))
    points = np.array([centre + part * breath + radius * side for part in (-1, 0, 1) for side in sides])
    size = scenario.geometry.size_px
    shares = np.vstack([true_projection(scenario, plane, 0).project(points) / size for plane in PLANES])
    covered = np.concatenate([shares.min(axis=0), 1.0 - shares.max(axis=0)]) - margin
    return as_vector(np.clip(covered, 0.0, most))


def with_incidents(scenario: Scenario, *incidents: Incident) -> Scenario:
    """The scenario with more incidents."""
    return altered(scenario, incidents=(*scenario.incidents, *incidents))


def with_events(scenario: Scenario, *events: Event) -> Scenario:
    """The scenario with more events."""
    return altered(scenario, events=(*scenario.events, *events))
