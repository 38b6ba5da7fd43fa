"""Moderate sequences: the starting point of sweeps and traps, which add one difficulty."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator
from itertools import count
from typing import Any

from lasso_motion_ros.bench.suite.random_scenarios import edge_on_deg, suite_scenario
from lasso_motion_ros.phantom.settings import CalibrationSettings, ClickSettings, Scenario

PAIRS = 12
NOT_EDGE_ON_DEG = 20.0


def moderate_scenarios(seed: int, first: int = 0) -> Iterator[Scenario]:
    """Sequences of a suite made moderate, without end; those near edge-on are left out.

    Args:
        seed: of the suite that orientations, lassos and distractors are taken from.
        first: number of the sequence to begin with.
    """
    for index in count(first):
        scenario = moderate(suite_scenario(seed, index))
        if min(edge_on_deg(scenario, plane) for plane in range(2)) > NOT_EDGE_ON_DEG:
            yield scenario


def moderate(drawn: Scenario) -> Scenario:
    """The same lasso and body: 512², 3 pairs/s, 30 quanta, 15 mm, both planes at once, no error, no event."""
    return altered(
        drawn,
        pairs=PAIRS,
        rate_hz=3.0,
        plane_b_offset=0.0,
        geometry={"size_px": 512},
        breathing={"amplitude_mm": 15.0},
        imaging={"quanta": 30.0},
        calibration_error=CalibrationSettings(),
        clicks=ClickSettings(noise_px=1.0, fewest=8, most=14),
        events=(),
    )


def altered(scenario: Scenario, **changes: Any) -> Scenario:
    """The scenario with other values; a dict changes single settings of a group."""
    values = {
        name: dataclasses.replace(getattr(scenario, name), **value) if isinstance(value, dict) else value
        for name, value in changes.items()
    }
    return dataclasses.replace(scenario, **values)
