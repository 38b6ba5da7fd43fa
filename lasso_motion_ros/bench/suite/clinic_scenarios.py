"""The clinic suite: random sequences as wide as a lab, each with one event class or two, the same for the same seed.

Sequence k of a seed does not depend on how many are drawn: its first class goes round the table of classes, the
second, in half of the sequences, is drawn.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from lasso_motion_ros.bench.suite.clinic_classes import CLASSES
from lasso_motion_ros.bench.suite.judged_scores import begun_classes
from lasso_motion_ros.bench.suite.moderate import altered
from lasso_motion_ros.bench.suite.random_scenarios import edge_on_deg
from lasso_motion_ros.bench.suite.vectors import as_vector, direction
from lasso_motion_ros.phantom.settings import (
    BreathingSettings,
    CalibrationSettings,
    ClickSettings,
    DistractorSettings,
    GeometrySettings,
    HeartSettings,
    ImagingSettings,
    LassoSettings,
    PlaneSettings,
    Scenario,
)

Random = np.random.Generator

CLINIC_SEQUENCES = 120
SECOND_CLASS = 0.5  # share of the sequences with two classes
LARGE = 0.15  # share at 1024², of those that are short enough
LONGEST_LARGE = 26  # pairs
UNQUIET = 0.4  # share of the rings that go to and fro on their seat
LEAST_EDGE_ON_DEG = 15.0  # of what is not meant to be edge-on


@dataclass(frozen=True)
class ClinicScenario:
    """One sequence of the clinic suite.

    Attributes:
        scenario: what is rendered.
        since: first pair from which on each of its event classes holds, by name.
    """

    scenario: Scenario
    since: Mapping[str, int]

    def classes(self, pair: int) -> frozenset[str]:
        """The event classes that a pair counts for: those that have begun; before the first one, the plain core."""
        return begun_classes(self.since, pair)


@dataclass(frozen=True)
class _Kind:
    """A kind of lasso as catalogues have it.

    Attributes:
        electrodes: how many; a range is drawn from.
        pair_spacing: see `LassoSettings`.
        diameters_mm: of the loop.
        electrode_mm: length and outer diameter of an electrode.
    """

    electrodes: tuple[int, int]
    pair_spacing: float
    diameters_mm: tuple[float, float]
    electrode_mm: tuple[float, float]


_KINDS = (
    _Kind((10, 10), 0.5, (15.0, 25.0), (1.0, 1.3)),  # circular mapping, evenly spaced (4-4-4, 8 mm)
    _Kind((20, 20), 0.25, (20.0, 25.0), (1.0, 1.25)),  # 2-6-2 mm
    _Kind((20, 20), 0.5, (20.0, 32.0), (1.0, 1.25)),
    _Kind((8, 8), 0.5, (15.0, 20.0), (1.0, 1.1)),  # inner-lumen, small
    _Kind((9, 10), 0.5, (25.0, 32.0), (3.0, 1.9)),  # circular pulsed-field, large electrodes
    _Kind((8, 20), 0.35, (15.0, 30.0), (1.2, 1.3)),  # any other
)


def clinic_scenarios(seed: int, sequences: int = CLINIC_SEQUENCES) -> tuple[ClinicScenario, ...]:
    """The sequences of a clinic suite, in order."""
    return tuple(clinic_scenario(seed, index) for index in range(sequences))


def clinic_scenario(seed: int, index: int) -> ClinicScenario:
    """One sequence of a clinic suite.

    Args:
        seed: the suite's.
        index: number of the sequence, from 0.
    """
    random = np.random.default_rng([seed, 11, index])
    names = [list(CLASSES)[index % len(CLASSES)]]
    group = CLASSES[names[0]].group
    if group != "core" and random.uniform() < SECOND_CLASS:
        others = [
            one.name
            for one in CLASSES.values()
            if one.name not in (*names, "core") and (not group or one.group != group)
        ]
        names.append(str(random.choice(others)))
    # Which way a heart moves the ring differs between patients: where plane B is late, its depth hangs on that.
    way = as_vector(direction(np.random.default_rng([seed, 12, index])))
    scenario = altered(
        _ordinary(random), heart={"direction": way}, lasso=_seat(np.random.default_rng([seed, 13, index]))
    )
    since = {}
    # An orientation first: shutters and others look where the loop lies.
    for name in sorted(names, key=lambda name: name != "edge_on"):
        scenario, from_s = CLASSES[name].apply(random, scenario)
        since[name] = from_s
    large = random.uniform() < LARGE and scenario.pairs <= LONGEST_LARGE
    described = ", ".join(CLASSES[name].label for name in names)
    rate = scenario.rate_hz
    return ClinicScenario(
        altered(
            scenario,
            name=f"{seed}/{index:03d}",
            description=f"{described}; {rate:g}/s, {scenario.imaging.quanta:.0f} quanta",
            geometry={"size_px": 1024 if large else 512},
        ),
        {name: int(np.ceil(from_s * rate - 1e-9)) for name, from_s in since.items()},
    )


def _ordinary(random: Random) -> Scenario:
    """A sequence without any event: everyday breathing, heart, dose, calibration, and some bystanders."""
    first = float(random.uniform(-45.0, 10.0))
    scenario = Scenario(
        pairs=int(random.integers(14, 23)),
        rate_hz=float(random.choice([2.0, 3.0, 3.75, 7.5, 15.0], p=[0.2, 0.3, 0.3, 0.15, 0.05])),
        plane_b_offset=float(random.choice([0.0, random.uniform(0.05, 0.4)])),
        seed=int(random.integers(2**31)),
        geometry=GeometrySettings(
            plane_a=PlaneSettings(first, float(random.uniform(-15, 15))),
            plane_b=PlaneSettings(first + float(random.uniform(60, 95)), float(random.uniform(-15, 15))),
            size_px=512,
            field_mm=float(random.uniform(170.0, 220.0)),
            mirrored=bool(random.integers(2)),
        ),
        breathing=_breathing(random),
        heart=HeartSettings(
            rate_bpm=float(random.uniform(50, 110)),
            variability=float(random.uniform(0.01, 0.1)),
            amplitude_mm=float(random.uniform(0.0, 1.5)),
        ),
        imaging=_imaging(random),
        calibration_error=_calibration_error(random),
        distractors=_distractors(random),
        clicks=ClickSettings(noise_px=float(random.uniform(1.0, 2.0)), fewest=6, most=14),
        exact_place=True,
    )
    scenario = altered(scenario, bystanders={"pacing": bool(random.integers(2)), "ecg_discs": int(random.integers(3))})
    lasso = _lasso(random)
    scenario = altered(scenario, lasso=lasso)
    while min(edge_on_deg(scenario, plane) for plane in range(2)) < LEAST_EDGE_ON_DEG:
        scenario = altered(scenario, lasso={"normal": as_vector(direction(random))})
    return scenario


def _seat(random: Random) -> dict[str, object]:
    """How the ring goes to and fro on its seat, which no picture tells from what the atrium does."""
    if random.uniform() >= UNQUIET:
        return {}
    return {
        "seat_mm": float(random.uniform(0.2, 0.8)),
        "seat_period_s": float(random.uniform(4.0, 15.0)),
        "seat_direction": as_vector(direction(random)),
    }


def _breathing(random: Random) -> BreathingSettings:
    way = np.array([0.08, -0.25, -1.0]) + random.normal(0.0, [0.1, 0.15, 0.0])
    return BreathingSettings(
        amplitude_mm=float(random.uniform(4.0, 20.0)),
        direction=as_vector(way),
        period_s=float(random.uniform(3.0, 6.0)),
        start=float(random.uniform()),
        hysteresis_mm=float(random.uniform(0.0, 2.0)),
        irregularity=float(random.uniform(0.0, 0.15)),
        drift_mm_per_min=float(random.uniform(-6.0, 6.0)),
        rotation_deg=float(random.choice([0.0, random.uniform(0.0, 3.0)])),
    )


def _imaging(random: Random) -> ImagingSettings:
    return ImagingSettings(
        quanta=float(np.exp(random.uniform(np.log(12.0), np.log(60.0)))),
        scatter=float(random.uniform(0.2, 1.0)),
        lag=float(random.choice([0.0, random.uniform(0.0, 0.15)])),
        brightness_drift=float(random.uniform(0.0, 0.05)),
        edge_enhancement=float(random.choice([0.0, random.uniform(0.5, 2.5)])),
        gamma=float(random.uniform(0.5, 0.8)),
        polarity=str(random.choice(["dark", "bright"], p=[0.85, 0.15])),
        bits=int(random.choice([8, 12])),
    )


def _calibration_error(random: Random) -> CalibrationSettings:
    if random.uniform() < 0.3:
        return CalibrationSettings()
    angle_deg, shift_mm, shift_px = (float(random.uniform(0.0, most)) for most in (0.25, 0.7, 1.5))
    return CalibrationSettings(angle_deg, shift_mm, shift_px)


def _distractors(random: Random) -> DistractorSettings:
    return DistractorSettings(
        sternal_wires=int(random.choice([0, 5], p=[0.75, 0.25])),
        ecg_leads=int(random.integers(0, 3)),
        oesophageal_probe=bool(random.uniform() < 0.3),
        second_ring=bool(random.uniform() < 0.2),
        coronary_sinus=bool(random.uniform() < 0.85),
        ablation=bool(random.uniform() < 0.6),
        ablation_offset_mm=as_vector(float(random.uniform(16.0, 32.0)) * direction(random)),
    )


def _lasso(random: Random) -> LassoSettings:
    kind = _KINDS[int(random.integers(len(_KINDS)))]
    fewest, most = kind.electrodes
    return LassoSettings(
        centre_mm=as_vector(random.uniform([-10.0, -12.0, -10.0], [24.0, 14.0, 20.0])),
        normal=as_vector(direction(random)),
        spin_deg=float(random.uniform(0.0, 360.0)),
        diameter_mm=float(random.uniform(*kind.diameters_mm)),
        aspect=float(random.uniform(0.88, 1.0)),
        turns=float(random.uniform(0.85, 1.25)),
        helix_mm=float(random.uniform(0.3, 3.0)),
        electrodes=int(random.integers(fewest, most + 1)),
        pair_spacing=kind.pair_spacing,
        electrode_length_mm=kind.electrode_mm[0],
        electrode_diameter_mm=kind.electrode_mm[1],
        contrast=float(random.uniform(0.35, 1.1)),
        bulge=float(random.uniform(0.0, 0.03)),
        saddle_mm=float(random.uniform(0.0, 0.7)),
        tilt_deg=float(random.uniform(0.0, 3.0)),
        stretch=float(random.uniform(0.0, 0.03)),
    )
