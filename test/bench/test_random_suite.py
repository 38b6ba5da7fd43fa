"""The phantom suite: reproducible, of all kinds, scored as evaluation scores."""

import dataclasses
import json
from collections import Counter
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from lasso_motion_ros.bench.suite.cache import SequenceCache
from lasso_motion_ros.bench.suite.event_timings import EventTiming, event_timings, timing_distribution
from lasso_motion_ros.bench.suite.random_scenarios import edge_on_deg, suite_scenario, suite_scenarios
from lasso_motion_ros.bench.suite.sequence import RenderedSequence, SequenceResult, render_sequence, run_sequence
from lasso_motion_ros.bench.suite.suite_measures import Measures, confusion, measures, sequence_counts
from lasso_motion_ros.bench.suite.suite_tables import format_suite
from lasso_motion_ros.bench.suite.sweeps import START_PAUSE_S, START_TRIALS, SWEEPS, capture_range, sweep_scenarios
from lasso_motion_ros.cli.main import main
from lasso_motion_ros.config.tracker import TrackerConfig
from lasso_motion_ros.core.errors import RecordingError
from lasso_motion_ros.evaluation.measures import PairScore
from lasso_motion_ros.phantom import Simulator
from lasso_motion_ros.phantom.settings import Event, GeometrySettings, LassoSettings, Scenario
from lasso_motion_ros.stream.tracker_factory import create_tracker

SMALL = Scenario(
    name="small",
    pairs=4,
    geometry=GeometrySettings(size_px=512),
    events=(Event("drop", 2, plane="b"), Event("hide", 3)),
)


@cache
def small() -> RenderedSequence:
    return render_sequence(SMALL)


def score(index: int, **given: object) -> PairScore:
    plain = {"is_reference": index == 0, "expected": index > 0, "hidden": False, "displaced": False, "has_pose": True}
    return PairScore(index, index, state="TRACKING", **(plain | given))  # type: ignore[arg-type]


def result(*scores: PairScore, event: Event | None = None, refused: str = "") -> SequenceResult:
    scenario = dataclasses.replace(SMALL, events=() if event is None else (event,))
    return SequenceResult(scenario, scores, frozenset({1}), ("",) * len(scores), refused)


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


def test_a_rendered_sequence_is_tracked_and_scored() -> None:
    sequence = small()
    assert sequence.pairs[2].b is None
    assert sequence.pairs[2].a is not None
    found = run_sequence(sequence, create_tracker(TrackerConfig()))
    assert found.refused == ""
    assert found.halves == {2}
    assert [one.hidden for one in found.scores] == [False, False, False, True]
    assert found.scores[1].centre_error_mm is not None
    assert found.scores[1].centre_error_mm < 0.5
    assert not found.scores[3].has_pose


def test_a_refused_seed_is_told_and_every_pair_is_missing() -> None:
    sequence = small()
    seed = dataclasses.replace(sequence.seed, points_a=sequence.seed.points_a[:3])
    found = run_sequence(dataclasses.replace(sequence, seed=seed), create_tracker(TrackerConfig()))
    assert "clicks" in found.refused
    assert measures(found.scores).missing == 2
    assert sequence_counts([found])["refused"] == 1


def test_measures_by_hand() -> None:
    off = np.array([0.003, 0.0, 0.0])
    scores = [
        score(0, error_2d_mm={"a": 0.1, "b": 0.3}),
        score(1, centre_error_m=off / 3.0, nees=1.0, centre_sigma_mm=2.0),
        score(2, centre_error_m=off, nees=5.0, centre_sigma_mm=4.0),
        score(3, has_pose=False),
    ]
    found = measures(scores)
    assert (found.pairs, found.poses, found.silent, found.missing) == (3, 2, 1, 1)
    assert found.centre_mean_mm == pytest.approx(2.0)
    assert found.centre_max_mm == pytest.approx(3.0)
    assert found.model_mm == pytest.approx(0.2)
    assert (found.inside_68, found.inside_95, found.sigma_mm) == (0.5, 1.0, 3.0)


def test_states_are_counted_against_the_truth() -> None:
    found = confusion([result(score(0), score(1), score(2), score(3, hidden=True, expected=False, has_pose=False))])
    assert found["one plane"] == {"TRACKING": 1}
    assert found["both planes"] == {"TRACKING": 1}
    assert found["hidden or gone"] == {"TRACKING": 1}


def test_events_are_timed() -> None:
    hidden = {"hidden": True, "expected": False}
    one = result(
        score(0),
        score(1, **hidden),
        score(2, has_pose=False, **hidden),
        score(3, has_pose=False),
        score(4),
        event=Event("hide", 1, 2),
    )
    (timing,) = event_timings([one])
    assert (timing.pairs_to_silence, timing.pairs_to_recovery, timing.returned) == (1, 1, True)
    text = format_suite([one])
    assert "poses before silence" in text
    assert text.splitlines()[-3:] == [
        "pairs waited                       1",
        "to no pose, hidden or taken out    1",
        "from the return to a pose, hidden  1",
    ]


def test_pairs_waited_are_counted() -> None:
    moved = [EventTiming("s", "move", silence, None, displaced, False) for silence, displaced in ((0, 0), (2, None))]
    hidden = [EventTiming("s", "hide", 0, recovery, None, back) for recovery, back in ((3, True), (None, False))]
    taken = [EventTiming("s", "remove", None, None, None, False)]
    assert timing_distribution([*moved, *hidden, *taken]) == {
        "to no pose, hidden or taken out": {"0": 2, "never": 1},
        "to no pose, moved": {"0": 1, "2": 1},
        "to DISPLACED, moved": {"0": 1, "never": 1},
        "from the return to a pose, hidden": {"3": 1},
    }


def test_the_command_writes_tables_json_and_a_plot(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("lasso_motion_ros.bench.suite.cache.render_sequence", lambda scenario: small())
    arguments = ["suite", "--quiet", "--sequences", "3", "--only", "1"]
    assert main([*arguments, "--json", str(tmp_path / "r.json"), "--report", str(tmp_path / "d")]) == 0
    report = json.loads((tmp_path / "r.json").read_text())["tracker.yaml"]
    assert report["sequences_with"]["sequences"] == 1
    assert len(report["sequences"][0]["pairs"]) == 4
    assert {path.name for path in (tmp_path / "d").iterdir()} == {"suite_tracker.txt", "suite.png"}


def test_a_sweep_varies_one_property_of_the_same_sequences() -> None:
    for sweep in SWEEPS.values():
        scenarios = sweep_scenarios(sweep, 5, 2)
        assert tuple(scenarios) == sweep.values
        first, last = scenarios[sweep.values[0]], scenarios[sweep.values[-1]]
        assert len(first) == len(last) == 2 * sweep.trials
        still = [[dataclasses.replace(one.lasso, tilt_deg=0.0) for one in some] for some in (first, last)]
        assert still[0] == still[1]
        assert [one.seed for one in first] == [one.seed for one in last]
        assert first != last
    assert [one.imaging.quanta for one in sweep_scenarios(SWEEPS["quanta"], 5, 2)[5.0]] == [5.0, 5.0]
    assert [one.lasso.tilt_deg for one in sweep_scenarios(SWEEPS["tilt"], 5, 2)[8.0]] == [8.0, 8.0]
    wide = sweep_scenarios(SWEEPS["separation"], 5, 1)[40.0][0].geometry
    assert wide.plane_b.lao_deg - wide.plane_a.lao_deg == pytest.approx(40.0)
    assert sweep_scenarios(SWEEPS["rate"], 5, 1)[15.0][0].pairs == 60


def test_an_offset_start_is_a_breath_in_a_pause() -> None:
    scenarios = sweep_scenarios(SWEEPS["start"], 5, 1)
    assert len(scenarios[25.0]) == START_TRIALS
    directions = []
    for value in (0.0, 10.0, 25.0):
        simulator = Simulator(scenarios[value][2])
        assert simulator.time_s(1, "a") == START_PAUSE_S
        offset = simulator.motion.atrium(START_PAUSE_S)[:3, 3]
        assert 1e3 * np.linalg.norm(offset) == pytest.approx(value, abs=1e-6)
        directions.append(offset)
    np.testing.assert_allclose(directions[2], 2.5 * directions[1], atol=1e-9)


def test_the_capture_range_ends_before_the_first_failure() -> None:
    def trials(captured: int) -> Measures:
        off = np.array([0.005, 0.0, 0.0])
        return measures(
            [score(0), *(score(n + 1) for n in range(captured))]
            + [score(n + 1, centre_error_m=off) for n in range(captured, 20)]
        )

    assert capture_range({0.0: trials(20), 5.0: trials(19), 10.0: trials(18), 20.0: trials(20)}) == 5.0
    assert capture_range({0.0: trials(10), 5.0: trials(20)}) is None


def test_what_was_rendered_is_read_back_to_the_last_bit(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    rendered = []

    def render(scenario: Scenario) -> RenderedSequence:
        rendered.append(scenario)
        return small()

    monkeypatch.setattr("lasso_motion_ros.bench.suite.cache.render_sequence", render)
    first = SequenceCache(tmp_path).sequence(SMALL)
    second = SequenceCache(tmp_path).sequence(SMALL)
    assert len(rendered) == 1
    fresh = small()
    for one in (first, second):
        assert one.pairs[2].b is None
        np.testing.assert_array_equal(one.seed.points_b, fresh.seed.points_b)
        for index, (here, there) in enumerate(zip(one.pairs, fresh.pairs, strict=True)):
            assert here.stamp_ns == there.stamp_ns
            assert one.truth.pairs[index].centrelines.keys() == fresh.truth.pairs[index].centrelines.keys()
            np.testing.assert_array_equal(one.truth.pairs[index].motion, fresh.truth.pairs[index].motion)
            if there.a is not None:
                np.testing.assert_array_equal(here.a.pixels, there.a.pixels)
                np.testing.assert_allclose(here.a.projection.matrix, there.a.projection.matrix, rtol=1e-15)
    scores = [run_sequence(one, create_tracker(TrackerConfig())).scores for one in (first, second)]
    assert [one.centre_error_mm for one in scores[0]] == [one.centre_error_mm for one in scores[1]]
    other = dataclasses.replace(SMALL, seed=2)
    SequenceCache(tmp_path).sequence(other)
    assert len(rendered) == 2
    for path in tmp_path.iterdir():
        path.write_bytes(b"cut")
    with pytest.raises(RecordingError, match="not a rendered sequence"):
        SequenceCache(tmp_path).sequence(SMALL)


def test_the_command_sweeps(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr("lasso_motion_ros.bench.suite.cache.render_sequence", lambda scenario: small())
    arguments = ["suite", "--quiet", "--sweep", "offset", "--sequences", "1", "--report", str(tmp_path)]
    assert main([*arguments, "--json", str(tmp_path / "s.json")]) == 0
    assert "0.37" in capsys.readouterr().out
    assert set(json.loads((tmp_path / "s.json").read_text())["offset"]["tracker"]) >= {"0.0", "0.5"}
    assert {path.name for path in tmp_path.iterdir()} == {"s.json", "sweeps.txt", "sweeps.png"}
    assert main(["suite", "--quiet", "--sweep", "start", "--sequences", "1"]) == 0
    assert "in 95 % of the trials" in capsys.readouterr().out


def test_a_number_beyond_the_suite_is_refused(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["suite", "--sequences", "2", "--only", "2"]) == 2
    assert "expected 0 to 1, found 2" in capsys.readouterr().err
