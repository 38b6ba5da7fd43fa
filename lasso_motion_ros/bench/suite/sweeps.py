"""Sweeps: one property of the phantom sequences is varied, the others stay, to see where tracking breaks."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from itertools import islice

import numpy as np

from lasso_motion_ros.bench.suite.moderate import PAIRS, altered, moderate_scenarios
from lasso_motion_ros.bench.suite.suite_measures import Measures
from lasso_motion_ros.phantom.settings import (
    BreathingSettings,
    CalibrationSettings,
    ClickSettings,
    HeartSettings,
    PlaneSettings,
    Scenario,
)


@dataclass(frozen=True)
class _Tuning:
    """How long and how many the sequences are.

    Attributes:
        shortest_s: a breath has to be in a sequence.
        start_pause_s: longer than what the tracker takes for continuous film, so that its limit of speed is not asked.
        start_trials: a sequence of two pairs is cheap, and a share of 95 % needs many.
        captured_share: of the sequences, in which the loop has to be found for a start to count as captured.
    """

    shortest_s: float = 4.0
    start_pause_s: float = 2.0
    start_trials: int = 7
    captured_share: float = 0.95


TUNING = _Tuning()


@dataclass(frozen=True)
class Sweep:
    """One property and how it is varied.

    Attributes:
        name: as typed.
        label: with its unit, for the plot.
        values: from easy to hard.
        apply: puts a value into a scenario.
        trials: how many times as many sequences as for other sweeps.
        is_capture: whether the question is how often the loop is found at all.
    """

    name: str
    label: str
    values: tuple[float, ...]
    apply: Callable[[Scenario, float], Scenario]
    trials: int = 1
    is_capture: bool = False


def _quanta(scenario: Scenario, value: float) -> Scenario:
    return altered(scenario, imaging={"quanta": value})


def _calibration(scenario: Scenario, value: float) -> Scenario:
    # The other errors go with the angle: 2.8 mm and 6 px a degree, as in the suite.
    return altered(scenario, calibration_error=CalibrationSettings(value, 2.8 * value, 6.0 * value))


def _separation(scenario: Scenario, value: float) -> Scenario:
    geometry = scenario.geometry
    plane_b = PlaneSettings(geometry.plane_a.lao_deg + value, geometry.plane_a.cranial_deg)
    return altered(scenario, geometry={"plane_b": plane_b})


def _amplitude(scenario: Scenario, value: float) -> Scenario:
    return altered(scenario, breathing={"amplitude_mm": value})


def _rate(scenario: Scenario, value: float) -> Scenario:
    return altered(scenario, rate_hz=value, pairs=max(PAIRS, round(TUNING.shortest_s * value)))


def _offset(scenario: Scenario, value: float) -> Scenario:
    return altered(scenario, plane_b_offset=value)


def _tilt(scenario: Scenario, value: float) -> Scenario:
    return altered(scenario, lasso={"tilt_deg": value})


def _clicks(scenario: Scenario, value: float) -> Scenario:
    return altered(scenario, clicks=ClickSettings(noise_px=value, fewest=6, most=14))


def _tip(scenario: Scenario, value: float) -> Scenario:
    # It works there: it dwells, drags and hops with the heart, always about as far from the ring.
    work = {"works": True, "nearest_mm": value, "farthest_mm": value}
    return altered(scenario, ablation_work=work, distractors={"ablation": True})


def _heart(scenario: Scenario, value: float) -> Scenario:
    return altered(scenario, heart={"amplitude_mm": value, "variability": 0.3, "strength_spread": 0.35})


def _heart_late(scenario: Scenario, value: float) -> Scenario:
    # What it did between the exposures is in the depth: only its way tells, which differs between patients.
    way = np.random.default_rng(scenario.seed).normal(size=3)
    return altered(_offset(_heart(scenario, value), 0.5), heart={"direction": tuple(way.tolist())})


def _start(scenario: Scenario, value: float) -> Scenario:
    """Two pairs, and a pause of two seconds between them in which the patient breathed by `value`, in any direction."""
    direction = np.random.default_rng(scenario.seed).normal(size=3)
    # Half a breath of four seconds: from end-expiration to the deepest point.
    period_s = 2.0 * TUNING.start_pause_s
    breathing = BreathingSettings(amplitude_mm=value, direction=tuple(direction.tolist()), period_s=period_s)
    still = HeartSettings(amplitude_mm=0.0)
    return altered(scenario, pairs=2, rate_hz=1.0 / TUNING.start_pause_s, breathing=breathing, heart=still)


SWEEPS: Mapping[str, Sweep] = {
    sweep.name: sweep
    for sweep in (
        Sweep("quanta", "quanta a pixel", (60.0, 40.0, 20.0, 10.0, 5.0), _quanta),
        Sweep("calibration", "calibration error (deg)", (0.0, 0.1, 0.2, 0.3), _calibration),
        Sweep("separation", "angle between the planes (deg)", (90.0, 75.0, 60.0, 50.0, 40.0), _separation),
        Sweep("breathing", "amplitude of breathing (mm)", (5.0, 12.0, 20.0, 30.0, 40.0), _amplitude),
        Sweep("rate", "pairs a second", (15.0, 7.5, 3.0, 2.0, 1.0), _rate),
        Sweep("offset", "B's exposure after A's (frame periods)", (0.0, 0.12, 0.25, 0.37, 0.5), _offset),
        Sweep(
            "start",
            "offset from where it was last seen (mm)",
            (0.0, 2.0, 5.0, 10.0, 15.0, 20.0, 25.0),
            _start,
            trials=TUNING.start_trials,
            is_capture=True,
        ),
        Sweep("tilt", "tilt of the ring with the heartbeat (deg)", (0.0, 2.0, 4.0, 6.0, 8.0), _tilt),
        Sweep("clicks", "noise of the clicks (px)", (0.5, 1.0, 2.0, 3.0, 4.0), _clicks),
        Sweep("tip", "ablation tip from the ring (mm)", (20.0, 10.0, 5.0, 3.0, 1.0, 0.0), _tip),
        Sweep("heart", "motion by an irregular heart (mm)", (0.0, 1.0, 2.0, 3.5, 5.0), _heart),
        Sweep("heart_late", "the same, any way, B half a period later (mm)", (0.0, 1.0, 2.0, 3.5, 5.0), _heart_late),
    )
}


def sweep_scenarios(sweep: Sweep, seed: int, sequences: int) -> dict[float, tuple[Scenario, ...]]:
    """For each value the same sequences, all else moderate: 3 pairs/s, 30 quanta, 15 mm, no error, no event.

    Args:
        sweep: what is varied.
        seed: of the suite that orientations, lassos and distractors are taken from; those near edge-on are left
            out, since the suite itself asks that.
        sequences: how many for each value; times the sweep's `trials`.
    """
    moderate = tuple(islice(moderate_scenarios(seed), sequences * sweep.trials))
    return {value: tuple(sweep.apply(scenario, value) for scenario in moderate) for value in sweep.values}


def capture_range(by_value: Mapping[float, Measures]) -> float | None:
    """The largest offset up to which every one is captured in 95 % of the trials; None if none is.

    Captured: a pose was published and is within 2 mm.
    """
    reached = None
    for value, one in sorted(by_value.items()):
        if one.expected == 0 or (one.expected - one.missing - one.silent) / one.expected < TUNING.captured_share:
            break
        reached = value
    return reached
