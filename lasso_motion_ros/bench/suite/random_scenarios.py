"""The phantom suite: short random sequences that cover what a lasso tracker meets, the same for the same seed.

Every sequence draws its own geometry, lasso, motion, dose, errors of calibration and clicks, and events. Sequence k
of a seed does not depend on how many are drawn.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable

import numpy as np

from lasso_motion_ros.bench.suite.vectors import as_vector, direction
from lasso_motion_ros.geometry.frames import PLANES
from lasso_motion_ros.phantom.gantry import true_projection
from lasso_motion_ros.phantom.settings import (
    BreathingSettings,
    CalibrationSettings,
    ClickSettings,
    DistractorSettings,
    Event,
    GeometrySettings,
    HeartSettings,
    ImagingSettings,
    LassoSettings,
    PlaneSettings,
    Scenario,
)

DEFAULT_SEED = 2009
DEFAULT_SEQUENCES = 60
LONGEST_DROP_S = 2.9  # one plane alone is asked to carry a pose for up to 3 s
MOVE_MM = 25.0
LARGEST_MOVE_TURN_DEG = 15.0
EVENT_SHARES = {"none": 0.5, "hide": 0.14, "remove": 0.08, "move": 0.12, "drop": 0.16}


def suite_scenarios(
    seed: int = DEFAULT_SEED, sequences: int = DEFAULT_SEQUENCES, only: Iterable[int] | None = None
) -> tuple[Scenario, ...]:
    """The scenarios of a suite, in order; with `only`, those of these numbers."""
    return tuple(suite_scenario(seed, index) for index in (only or range(sequences)))


def suite_scenario(seed: int, index: int) -> Scenario:
    """One scenario of a suite.

    Args:
        seed: the suite's.
        index: number of the sequence, from 0.
    """
    random = np.random.default_rng([seed, index])
    rate_hz = float(random.choice([1.0, 2.0, 3.0, 3.75, 7.5], p=[0.1, 0.2, 0.3, 0.25, 0.15]))
    size_px = int(random.choice([512, 1024], p=[0.8, 0.2]))
    pairs = int(random.integers(8, 13) if size_px == 1024 else random.integers(12, 25))
    breathing = _breathing(random)
    scenario = Scenario(
        name=f"{seed}/{index:02d}",
        pairs=pairs,
        rate_hz=rate_hz,
        plane_b_offset=float(random.choice([0.0, random.uniform(0.05, 0.45), 0.5])),
        seed=int(random.integers(2**31)),
        geometry=_geometry(random, size_px),
        breathing=breathing,
        heart=HeartSettings(
            rate_bpm=float(random.uniform(50, 110)),
            variability=float(random.uniform(0.01, 0.1)),
            amplitude_mm=float(random.uniform(0.3, 1.5)),
        ),
        imaging=_imaging(random),
        calibration_error=_calibration_error(random),
        distractors=_distractors(random),
        clicks=ClickSettings(noise_px=float(random.uniform(1.0, 2.0)), fewest=6, most=14),
    )
    scenario = dataclasses.replace(scenario, lasso=_lasso(random, scenario))
    events = _events(random, scenario)
    scenario = dataclasses.replace(scenario, events=events)
    return dataclasses.replace(scenario, description=_description(scenario))


def _geometry(random: np.random.Generator, size_px: int) -> GeometrySettings:
    """Biplane working positions: planes 55 to 95° apart."""
    first = float(random.uniform(-45.0, 10.0))
    return GeometrySettings(
        plane_a=PlaneSettings(first, float(random.uniform(-15, 15))),
        plane_b=PlaneSettings(first + float(random.uniform(60, 95)), float(random.uniform(-15, 15))),
        size_px=size_px,
        field_mm=float(random.uniform(180.0, 220.0)),
        mirrored=bool(random.integers(2)),
    )


def _breathing(random: np.random.Generator) -> BreathingSettings:
    direction = np.array([0.08, -0.25, -1.0]) + random.normal(0.0, [0.1, 0.15, 0.0])
    return BreathingSettings(
        amplitude_mm=float(random.uniform(5.0, 32.0)),
        direction=as_vector(direction),
        period_s=float(random.uniform(3.0, 6.0)),
        start=float(random.uniform()),
        hysteresis_mm=float(random.uniform(0.0, 2.0)),
        irregularity=float(random.uniform(0.0, 0.15)),
        drift_mm_per_min=float(random.uniform(-6.0, 6.0)),
        rotation_deg=float(random.choice([0.0, random.uniform(0.0, 2.0)])),
    )


def _imaging(random: np.random.Generator) -> ImagingSettings:
    return ImagingSettings(
        quanta=float(np.exp(random.uniform(np.log(10.0), np.log(60.0)))),
        scatter=float(random.uniform(0.2, 0.6)),
        lag=float(random.uniform(0.0, 0.06)),
        brightness_drift=float(random.uniform(0.0, 0.05)),
        edge_enhancement=float(random.choice([0.0, 1.0])),
        polarity=str(random.choice(["dark", "bright"], p=[0.75, 0.25])),
        bits=int(random.choice([8, 12])),
    )


def _calibration_error(random: np.random.Generator) -> CalibrationSettings:
    if random.uniform() < 0.4:
        return CalibrationSettings()
    angle_deg, shift_mm, shift_px = (float(random.uniform(0.0, most)) for most in (0.25, 0.7, 1.5))
    return CalibrationSettings(angle_deg, shift_mm, shift_px)


def _distractors(random: np.random.Generator) -> DistractorSettings:
    # The ablation catheter lies beside the ring, seldom within it.
    offset = random.uniform(16.0, 30.0) * direction(random)
    return DistractorSettings(
        sternal_wires=int(random.choice([0, 5])),
        ecg_leads=int(random.integers(0, 4)),
        oesophageal_probe=bool(random.integers(2)),
        second_ring=bool(random.integers(2)),
        coronary_sinus=bool(random.uniform() < 0.8),
        ablation=bool(random.uniform() < 0.8),
        ablation_offset_mm=as_vector(offset),
    )


def _lasso(random: np.random.Generator, scenario: Scenario) -> LassoSettings:
    """Any orientation; in a quarter of the sequences within a few degrees of edge-on in one plane."""
    normal = direction(random)
    if random.uniform() < 0.25:
        viewing = true_projection(scenario, PLANES[int(random.integers(2))], 0).viewing_direction
        normal = normal - (normal @ viewing) * viewing
        normal = normal / np.linalg.norm(normal) + np.sin(np.radians(random.uniform(-6.0, 6.0))) * viewing
    return LassoSettings(
        centre_mm=as_vector(random.uniform([-8.0, -12.0, -8.0], [18.0, 12.0, 18.0])),
        normal=as_vector(normal),
        spin_deg=float(random.uniform(0.0, 360.0)),
        diameter_mm=float(random.uniform(17.0, 25.0)),
        aspect=float(random.uniform(0.9, 1.0)),
        turns=float(random.uniform(0.85, 1.25)),
        helix_mm=float(random.uniform(0.5, 2.5)),
        electrodes=int(random.choice([10, 20])),
        tilt_deg=float(random.uniform(0.0, 3.0)),
        stretch=float(random.uniform(0.0, 0.03)),
    )


def _events(random: np.random.Generator, scenario: Scenario) -> tuple[Event, ...]:
    """One event or none, in the second third of the sequence."""
    kind = str(random.choice(list(EVENT_SHARES), p=list(EVENT_SHARES.values())))
    first = int(random.integers(scenario.pairs // 3, 2 * scenario.pairs // 3))
    plane = str(random.choice(PLANES))
    dropped = int(random.integers(1, 1 + min(4, max(1, int(LONGEST_DROP_S * scenario.rate_hz)))))
    moved_over = int(random.integers(1, 5))
    # Put into another vein the ring lies differently, but is still seen as a ring.
    shift, turn = MOVE_MM * direction(random), random.uniform(0.0, LARGEST_MOVE_TURN_DEG) * direction(random)
    if kind == "hide":
        return (Event(kind, first, min(first + 4, scenario.pairs - 2)),)
    if kind == "remove":
        return (Event(kind, first),)
    if kind == "move":
        return (Event(kind, first, first + moved_over - 1, shift_mm=as_vector(shift), turn_deg=as_vector(turn)),)
    if kind == "drop":
        return (Event(kind, first, first + dropped - 1, plane=plane),)
    return ()


def _description(scenario: Scenario) -> str:
    """What is particular about it, for the table."""
    imaging, breathing = scenario.imaging, scenario.breathing
    parts = [
        f"{scenario.geometry.size_px}²",
        f"{imaging.quanta:.0f} quanta",
        f"{scenario.rate_hz:g}/s",
        f"{breathing.amplitude_mm:.0f} mm",
    ]
    tilts = [edge_on_deg(scenario, index) for index in range(2)]
    parts += [f"edge-on {plane.upper()}" for plane, tilt in zip(PLANES, tilts, strict=True) if tilt < 10.0]
    if scenario.plane_b_offset:
        parts.append(f"B +{scenario.plane_b_offset:.2f}")
    if scenario.calibration_error.shift_px or scenario.calibration_error.angle_deg:
        parts.append(f"off {scenario.calibration_error.angle_deg:.2f}°")
    return ", ".join(parts + [event.kind for event in scenario.events])


def edge_on_deg(scenario: Scenario, plane: int) -> float:
    """Angle between the loop's plane and a plane's line of sight to it: 0 where it is seen edge-on, degrees."""
    projection = true_projection(scenario, PLANES[plane], 0)
    ray = 1e-3 * np.asarray(scenario.lasso.centre_mm) - projection.source
    normal = np.asarray(scenario.lasso.normal)
    sine = abs(float(ray @ normal)) / float(np.linalg.norm(ray) * np.linalg.norm(normal))
    return float(np.degrees(np.arcsin(min(1.0, sine))))
