"""Traps: each holds its one difficulty and nothing else; what it does not ask is no fault, what it asks besides is."""

import dataclasses
import json

import numpy as np
import pytest
from support.suite_inputs import SMALL, result, score

from lasso_motion_ros.bench.suite.moderate import altered, moderate, moderate_scenarios
from lasso_motion_ros.bench.suite.random_scenarios import edge_on_deg, suite_scenario
from lasso_motion_ros.bench.suite.trap_measures import format_traps, trap_measures
from lasso_motion_ros.bench.suite.traps import TRAPS, TUNING, trap_scenarios
from lasso_motion_ros.geometry.frames import PLANES
from lasso_motion_ros.phantom import Simulator
from lasso_motion_ros.phantom.gantry import published_projection, true_projection
from lasso_motion_ros.phantom.scenario import scenario_from_values
from lasso_motion_ros.phantom.settings import CalibrationSettings, Event, Scenario


def scenarios(name: str, sequences: int | None = None) -> tuple[Scenario, ...]:
    return trap_scenarios(TRAPS[name], 5, sequences)


def gantry_turn(first: int) -> Event:
    return Event("gantry_turn", first, calibrated=False)


@pytest.mark.parametrize("name", TRAPS)
def test_every_trap_is_a_scenario_that_a_file_could_hold(name: str) -> None:
    # Also beyond a trap's own number of sequences.
    for scenario in scenarios(name, 5):
        values = json.loads(json.dumps(dataclasses.asdict(scenario)))
        assert scenario_from_values(values) == scenario
        assert scenario.geometry.size_px == 512
        assert all(event.end < scenario.pairs - 1 or event.kind == "remove" for event in scenario.events)


def test_a_trap_depends_on_seed_and_number_only() -> None:
    every = [one for trap in TRAPS.values() for one in trap_scenarios(trap, 5)]
    assert scenarios("tilt", 2) == scenarios("tilt")[:2]
    assert trap_scenarios(TRAPS["tilt"], 6)[0].seed != scenarios("tilt")[0].seed
    # No two share a body and a lasso, or a name.
    assert len({one.seed for one in every}) == len({one.name for one in every}) == len(every)


def test_moderate_sequences_keep_lasso_and_body() -> None:
    drawn = suite_scenario(5, 3)
    scenario = moderate(drawn)
    assert (scenario.lasso, scenario.distractors, scenario.seed) == (drawn.lasso, drawn.distractors, drawn.seed)
    assert (scenario.imaging.quanta, scenario.breathing.amplitude_mm, scenario.events) == (30.0, 15.0, ())
    assert scenario.calibration_error == CalibrationSettings()
    assert scenario.imaging.lag == drawn.imaging.lag
    many = moderate_scenarios(5)
    assert all(min(edge_on_deg(next(many), plane) for plane in range(2)) > 20.0 for _ in range(20))


def test_altered_changes_single_settings_of_a_group() -> None:
    changed = altered(SMALL, pairs=5, imaging={"lag": 0.3})
    assert (changed.pairs, changed.imaging.lag, changed.imaging.quanta) == (5, 0.3, SMALL.imaging.quanta)
    with pytest.raises(TypeError):
        altered(SMALL, imaging={"nonsense": 1.0})


def test_the_difficulties() -> None:
    assert [one.events[0].kind for one in scenarios("ghost")] == ["remove", "hide", "move"]
    assert all(one.imaging.lag >= 0.2 for one in scenarios("ghost"))
    assert all(3.5 <= one.lasso.tilt_deg <= 6.0 for one in scenarios("tilt"))
    assert all(one.events[0].end - one.events[0].first >= 3 for one in scenarios("slow_move"))
    for one in scenarios("slow_move"):
        assert one.events[0].first / one.rate_hz > 2.0 * one.breathing.period_s
    for one in scenarios("hidden"):
        # Half a breath: it does not return where it was seen last.
        away = (one.events[0].end + 1 - (one.events[0].first - 1)) / one.rate_hz
        assert away == pytest.approx(0.5 * one.breathing.period_s)
    for one in scenarios("moved_unseen"):
        hide, move = one.events
        assert hide.first < move.first <= move.end < hide.end
    for one in scenarios("edge_on"):
        assert max(edge_on_deg(one, plane) for plane in range(2)) < 6.0
    for number, one in enumerate(scenarios("alike")):
        assert edge_on_deg(one, number % 2) < 6.0
    for one in scenarios("slip"):
        (move,) = one.events
        assert move.first / one.rate_hz > 2.0 * one.breathing.period_s
        assert 4.99 < np.linalg.norm(move.shift_mm) < 8.01
        assert np.dot(move.shift_mm, one.breathing.direction) == pytest.approx(0.0, abs=1e-6)
    for one in scenarios("jump"):
        assert np.linalg.norm(one.events[0].shift_mm) >= 18.0
        assert one.events[0].end < one.breathing.period_s * one.rate_hz


@pytest.mark.parametrize("name", ["gantry", "table", "zoom"])
def test_what_moves_unsaid_is_not_in_the_published_geometry(name: str) -> None:
    for one in scenarios(name):
        (event,) = one.events
        assert event.first >= TUNING.event
        moved = set()
        for plane in PLANES:
            before = true_projection(one, plane, 0)
            if not np.allclose(before.matrix, true_projection(one, plane, event.end).matrix):
                moved.add(plane)
            np.testing.assert_array_equal(published_projection(one, plane, event.end).matrix, before.matrix)
        assert moved == (set(PLANES) if event.plane == "both" else {event.plane})


def test_the_collimator_leaves_the_loop_free() -> None:
    for one in scenarios("edges"):
        left, top, right, bottom = one.imaging.collimator
        assert min(left, top, right, bottom) > 0.05
        sequence = Scenario(name="loop", pairs=1, geometry=one.geometry, lasso=one.lasso)
        breath = 1e-3 * one.breathing.amplitude_mm * np.array(one.breathing.direction)
        breath /= np.linalg.norm(one.breathing.direction)
        # It begins at any phase: a breath further in or out.
        loop = np.concatenate([Simulator(sequence).reference_loop + way * breath for way in (-1.0, 0.0, 1.0)])
        for plane in PLANES:
            shares = true_projection(sequence, plane, 0).project(loop) / one.geometry.size_px
            assert shares.min(axis=0)[0] > left
            assert shares.min(axis=0)[1] > top
            assert shares.max(axis=0)[0] < 1.0 - right
            assert shares.max(axis=0)[1] < 1.0 - bottom


def test_what_is_not_asked_is_no_fault_and_what_is_asked_besides_is() -> None:
    lost = result(score(0), score(1, "LOST"), score(2, "LOST"), score(3, "DEGRADED"), score(4), event=gantry_turn(2))
    asked = trap_measures(TRAPS["tilt"], [lost])
    assert (asked.measures.missing, asked.measures.expected, asked.unsaid) == (2, 4, 0)
    assert asked.states == {"LOST": 2, "DEGRADED": 1, "TRACKING": 1}
    # Before the event a pose is due; from it on none is, and TRACKING is wrong.
    excused = trap_measures(TRAPS["gantry"], [lost])
    assert (excused.measures.missing, excused.measures.expected, excused.unsaid) == (1, 1, 1)
    # Edge-on from the first pair: poses are due, and doubt everywhere but in the reference.
    doubted = trap_measures(TRAPS["edge_on"], [result(score(0), score(1), score(2, "DEGRADED"), score(3, "LOST"))])
    assert (doubted.measures.missing, doubted.unsaid) == (1, 1)


def test_a_pose_that_is_wrong_counts_where_none_is_due() -> None:
    off = score(2, "DEGRADED", centre_error_m=np.array([3e-3, 0.0, 0.0]))
    displaced = score(3, "TRACKING", displaced=True, expected=False)
    wrong = trap_measures(TRAPS["table"], [result(score(0), score(1), off, displaced, event=gantry_turn(2))])
    assert (wrong.measures.silent, wrong.false_poses, wrong.absent) == (2, 1, 1)


def test_the_table() -> None:
    one = trap_measures(TRAPS["gantry"], [result(score(0), score(1), score(2, "LOST"), event=gantry_turn(2))])
    other = trap_measures(TRAPS["tilt"], [result(score(0), score(1, "LOST")), result(refused="no ellipse")])
    lines = format_traps({"gantry": {"tracker": one}, "tilt": {"tracker": other}}).splitlines()
    assert lines[0].split()[:6] == ["trap", "config", "pairs", "silent", "missing", "unsaid"]
    assert lines[1].split()[:7] == ["gantry", "tracker", "2", "0", "–", "0", "–"]
    assert lines[1].endswith(TRAPS["gantry"].label)
    assert lines[2].split()[:7] == ["tilt", "tracker", "1", "0", "1", "–", "–"]
    assert lines[2].endswith("; 1 seeds refused")
