"""The suite's random scenarios: reproducible, and of all kinds."""

import dataclasses
from collections import Counter

import numpy as np
import pytest
from support.suite_inputs import SMALL

from lasso_motion_ros.bench.suite.random_scenarios import edge_on_deg, suite_scenario, suite_scenarios
from lasso_motion_ros.phantom.settings import LassoSettings


def test_a_sequence_depends_on_seed_and_number_only() -> None:
    assert suite_scenarios(5, 4)[3] == suite_scenario(5, 3)
    assert suite_scenario(5, 3) != suite_scenario(5, 2)
    assert suite_scenario(5, 3) != suite_scenario(6, 3)


def test_the_suite_covers_what_it_promises() -> None:
    scenarios = suite_scenarios(sequences=200)
    kinds = Counter(event.kind for scenario in scenarios for event in scenario.events)
    assert min(kinds[kind] for kind in ("hide", "remove", "move", "drop")) >= 8
    assert {s.geometry.size_px for s in scenarios} == {512, 1024}
    assert {s.imaging.bits for s in scenarios} == {8, 12}
    assert {s.imaging.polarity for s in scenarios} == {"dark", "bright"}
    assert {s.geometry.mirrored for s in scenarios} == {True, False}
    assert {s.lasso.electrodes for s in scenarios} == {10, 20}
    assert all(8 <= s.pairs <= 24 and 10.0 <= s.imaging.quanta <= 60.0 for s in scenarios)
    assert all(event.end < s.pairs for s in scenarios for event in s.events if event.kind != "move")
    tilts = np.array([[edge_on_deg(s, plane) for plane in range(2)] for s in scenarios])
    assert (tilts < 8.0).any(axis=1).mean() > 0.15
    assert tilts.max() > 60.0


def test_edge_on_is_zero_where_the_line_of_sight_lies_in_the_loops_plane() -> None:
    # With both planes' sources in the axial plane, a loop with its axis along z is edge-on in both.
    flat = dataclasses.replace(SMALL, lasso=LassoSettings(centre_mm=(0.0, 0.0, 0.0), normal=(0.0, 0.0, 1.0)))
    assert edge_on_deg(flat, 0) == pytest.approx(0.0, abs=1e-6)
    assert edge_on_deg(flat, 1) == pytest.approx(0.0, abs=1e-6)
