"""The clinic suite: the same for the same seed, of every class, what is due by the simulator's truth, and its table."""

import dataclasses
import json
from collections import Counter
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from lasso_motion_ros.bench.suite.clinic_classes import CLASSES, path_shutters
from lasso_motion_ros.bench.suite.clinic_runs import ClinicResult, is_plain, run_clinic
from lasso_motion_ros.bench.suite.clinic_scenarios import ClinicScenario, clinic_scenario, clinic_scenarios
from lasso_motion_ros.bench.suite.clinic_tables import ALL, class_measures, format_clinic
from lasso_motion_ros.bench.suite.place_truth import seed_gap_mm, with_place
from lasso_motion_ros.bench.suite.random_scenarios import edge_on_deg
from lasso_motion_ros.bench.suite.sequence import RenderedSequence, SequenceResult, render_sequence
from lasso_motion_ros.cli.main import main
from lasso_motion_ros.config.stream import StreamConfig
from lasso_motion_ros.evaluation.measures import PairScore, PairTruth, score_pairs
from lasso_motion_ros.phantom import Simulator
from lasso_motion_ros.phantom.lab_settings import Incident
from lasso_motion_ros.phantom.scenario import scenario_from_values
from lasso_motion_ros.phantom.settings import (
    BreathingSettings,
    CalibrationSettings,
    Event,
    GeometrySettings,
    HeartSettings,
    LassoSettings,
    Scenario,
)

STILL = Scenario(
    name="still",
    pairs=5,
    rate_hz=1.0,
    geometry=GeometrySettings(size_px=128),
    lasso=LassoSettings(normal=(0.27, -0.73, 0.62), turns=0.98),
    breathing=BreathingSettings(amplitude_mm=0.0),
    heart=HeartSettings(amplitude_mm=0.0),
    exact_place=True,
)
DRAWN = ClinicScenario(STILL, {"slide": 2})


@cache
def suite() -> tuple[ClinicScenario, ...]:
    return clinic_scenarios(5)


@cache
def short() -> RenderedSequence:
    larger = dataclasses.replace(STILL, pairs=3, geometry=GeometrySettings(size_px=512))
    return render_sequence(larger)


def of_class(name: str) -> list[ClinicScenario]:
    found = [one for one in suite() if next(iter(one.since)) == name]
    assert found
    return found


def judged(scenario: Scenario) -> list[PairTruth]:
    return list(render_sequence(scenario).truth.pairs)


def test_a_sequence_depends_on_seed_and_number_only() -> None:
    assert clinic_scenario(5, 3) == suite()[3]
    assert clinic_scenarios(5, 4) == suite()[:4]
    assert clinic_scenario(6, 3).scenario.seed != suite()[3].scenario.seed
    assert len({one.scenario.seed for one in suite()}) == len(suite()) == 120


def test_it_is_large_and_of_every_class() -> None:
    assert sum(one.scenario.pairs for one in suite()) >= 2500
    counts = Counter(name for one in suite() for name in one.since)
    assert set(counts) == set(CLASSES)
    assert min(counts.values()) >= 4
    assert 30 < sum(len(one.since) == 2 for one in suite()) < 90
    sizes = Counter(one.scenario.geometry.size_px for one in suite())
    assert sizes[512] > 3 * sizes[1024] > 0
    for one in suite():
        groups = [CLASSES[name].group for name in one.since if CLASSES[name].group]
        assert len(set(groups)) == len(groups)
        assert all(0 <= first < one.scenario.pairs - 1 for first in one.since.values())


def test_every_sequence_is_a_scenario_that_a_file_could_hold() -> None:
    for one in suite():
        assert scenario_from_values(json.loads(json.dumps(dataclasses.asdict(one.scenario)))) == one.scenario
        assert one.scenario.exact_place


def test_lassos_are_as_wide_as_catalogues() -> None:
    lassos = [one.scenario.lasso for one in suite()]
    for name, low, high in (("electrodes", 8, 20), ("diameter_mm", 16.0, 30.0), ("turns", 0.86, 1.24)):
        values = [getattr(lasso, name) for lasso in lassos]
        assert min(values) <= low
        assert max(values) >= high
    assert {lasso.pair_spacing for lasso in lassos} == {0.25, 0.35, 0.5}
    assert len({lasso.electrodes for lasso in lassos}) > 5


def test_what_the_classes_put_in() -> None:
    assert all(one.scenario.ablation_work.works for one in of_class("ablation"))
    assert all(min(edge_on_deg(one.scenario, plane) for plane in range(2)) < 7.0 for one in of_class("edge_on"))
    assert all(2.0 <= one.scenario.heart.amplitude_mm <= 5.0 for one in of_class("heart"))
    assert all(one.scenario.plane_b_offset == 0.5 for one in of_class("b_late"))
    assert all(1.0 <= one.scenario.breathing.amplitude_mm <= 3.0 for one in of_class("jet"))
    assert all(28.0 <= one.scenario.breathing.amplitude_mm <= 40.0 for one in of_class("deep"))
    assert all(0.25 <= one.scenario.imaging.lag <= 0.5 for one in of_class("ghost"))
    for name, kinds in (("cough", {"cough"}), ("shift", {"shift"}), ("slide", {"slide"}), ("plane_off", {"off"})):
        for one in of_class(name):
            assert kinds <= {incident.kind for incident in one.scenario.incidents}
    for one in of_class("sigh"):
        motion = Simulator(one.scenario).motion.breathing
        depths = [
            np.linalg.norm(motion.displacement(pair / one.scenario.rate_hz)) for pair in range(one.scenario.pairs)
        ]
        assert 1e3 * max(depths) > 20.0


def test_a_class_counts_from_its_beginning() -> None:
    drawn = ClinicScenario(STILL, {"cough": 4, "star": 0, "shift": 2})
    assert drawn.classes(1) == {"star"}
    assert drawn.classes(2) == {"star", "shift"}
    assert drawn.classes(9) == {"star", "shift", "cough"}
    assert DRAWN.classes(1) == {"core"}


def test_a_cough_begins_at_the_pair_that_it_is_counted_from() -> None:
    for one in of_class("cough"):
        start = next(incident.start_s for incident in one.scenario.incidents if incident.kind == "cough")
        first = one.since["cough"]
        assert (first - 1) / one.scenario.rate_hz < start <= first / one.scenario.rate_hz


def test_shutters_leave_the_rings_way_open() -> None:
    left, top, right, bottom = path_shutters(STILL)
    line = Simulator(STILL).pairs().__next__().centrelines["a"] / 128.0
    assert line[:, 0].min() > left
    assert line[:, 1].min() > top
    assert line[:, 0].max() < 1.0 - right
    assert line[:, 1].max() < 1.0 - bottom


def test_no_pose_is_due_from_2_mm_of_a_slide_and_none_is_right_from_3_mm() -> None:
    # 1.25 mm/s from 0 s on, a pair a second: 0, 1.25, 2.5, 3.75, 5 mm.
    sliding = dataclasses.replace(STILL, incidents=(Incident("slide", 0.0, 0.0, amount=1.25),))
    pairs = judged(sliding)
    assert [pair.due for pair in pairs] == [True, True, False, False, False]
    assert [pair.displaced for pair in pairs] == [False, False, False, True, True]
    scores = score_pairs(render_sequence(sliding).truth, [])
    assert [score.expected for score in scores] == [False, True, False, False, False]
    assert [score.displaced for score in scores] == [False, False, False, True, True]


def test_no_pose_is_due_after_a_patients_shift_but_one_that_follows_is_right() -> None:
    shift = Incident("shift", 1.2, 0.5, amount=10.0, direction=(1.0, 0.0, 0.0))
    pairs = judged(dataclasses.replace(STILL, incidents=(shift,)))
    assert [pair.due for pair in pairs] == [True, True, False, False, False]
    assert not any(pair.displaced for pair in pairs)
    assert pairs[4].motion is not None
    assert pairs[4].motion[:3, 3] == pytest.approx([0.01, 0.0, 0.0])


def test_what_else_asks_for_no_pose() -> None:
    withdrawn = judged(dataclasses.replace(STILL, incidents=(Incident("withdraw", 0.5, 3.0),)))
    assert [pair.due for pair in withdrawn] == [True, False, False, False, False]
    assert [pair.displaced for pair in withdrawn] == [False, False, True, True, True]
    moved = judged(dataclasses.replace(STILL, events=(Event("move", 2, shift_mm=(0.0, 20.0, 0.0)),)))
    assert [pair.displaced for pair in moved] == [False, False, True, True, True]
    unsaid = judged(dataclasses.replace(STILL, events=(Event("gantry_turn", 3, lao_deg=5.0, calibrated=False),)))
    assert [pair.due for pair in unsaid] == [True, True, True, False, False]
    wound = judged(dataclasses.replace(STILL, incidents=(Incident("resize", 1.0, 2.0, amount=0.8),)))
    assert [pair.due for pair in wound] == [True, True, False, False, False]
    assert not any(pair.displaced for pair in wound)
    # The images of a gantry that moved unsaid show the ring elsewhere; its place it has not left.
    assert not any(pair.displaced for pair in unsaid)
    swapped = dataclasses.replace(STILL, calibration_error=CalibrationSettings(swapped=True))
    assert not any(pair.due for pair in judged(swapped))


def test_planes_that_disagree_by_much_at_the_seed_ask_for_no_pose() -> None:
    assert seed_gap_mm(STILL) == pytest.approx(0.0, abs=1e-6)
    # 20 px at 128 px a field are 20 mm at the ring and more; a degree at 0.8 m is none, it turns about the iso-centre.
    gross = dataclasses.replace(STILL, calibration_error=CalibrationSettings(shift_px=20.0), seed=3)
    assert seed_gap_mm(gross) > 8.0
    assert not any(pair.due for pair in judged(gross))
    usual = dataclasses.replace(STILL, calibration_error=CalibrationSettings(0.25, 0.7, 0.2))
    assert seed_gap_mm(usual) < 2.0


def test_evidence_is_of_the_planes_that_show_the_ring() -> None:
    hidden = dataclasses.replace(STILL, events=(Event("hide", 2, 2), Event("drop", 3, plane="b")))
    pairs = judged(hidden)
    assert [sorted(pair.evidence) for pair in pairs] == [["a", "b"], ["a", "b"], [], ["a"], ["a", "b"]]
    assert [is_plain(pair) for pair in (pairs[2], pairs[3])] == [False, False]
    assert is_plain(PairTruth(0, evidence={"a": 1.3, "b": 1.2}))
    assert not is_plain(PairTruth(0, evidence={"a": 2.0, "b": 1.1}))


def test_a_ring_in_plain_view_is_plain() -> None:
    pair = next(Simulator(short().scenario).pairs())
    true = with_place(PairTruth(0), Simulator(short().scenario), pair)
    assert min(true.evidence.values()) > 1.5
    # Nothing is there where the ring is not.
    elsewhere = dataclasses.replace(pair, poles={plane: line + 25.0 for plane, line in pair.poles.items()})
    assert min(with_place(PairTruth(0), Simulator(short().scenario), elsewhere).evidence.values()) < 0.8


def score(index: int, *, pose: bool = True, error_mm: float = 0.1, **given: object) -> PairScore:
    plain = {"is_reference": index == 0, "expected": index > 0, "hidden": False, "displaced": False}
    state = "TRACKING" if pose else "LOST"
    centre = {"centre_error_m": np.array([1e-3 * error_mm, 0.0, 0.0]), "nees": error_mm} if pose else {}
    return PairScore(index, index, has_pose=pose, state=state, **(plain | centre | given))  # type: ignore[arg-type]


def result(since: dict[str, int], *scores: PairScore, plain: tuple[bool, ...], refused: str = "") -> ClinicResult:
    tracked = SequenceResult(STILL, scores, frozenset(), ("",) * len(scores), refused)
    return ClinicResult(ClinicScenario(STILL, since), tracked, plain)


def test_measures_by_class_by_hand() -> None:
    one = result(
        {"slide": 2},
        score(0),
        score(1, error_mm=0.2),
        score(2, pose=False),
        score(3, error_mm=5.0, expected=False),
        score(4, pose=False),
        plain=(True, True, True, True, False),
    )
    found = class_measures([one])
    assert set(found) == {"core", "slide", ALL}
    slide = found["slide"]
    assert (slide.sequences, slide.pairs, slide.plain, slide.poses) == (1, 3, 1, 1)
    # The second pair is plain and without a pose; the fourth is neither plain nor, for this, missing.
    assert (slide.wrong, slide.missing) == (1, 1)
    assert slide.centre_mm == pytest.approx(5.0)
    assert slide.nees == pytest.approx(5.0)
    assert (found["core"].pairs, found["core"].wrong, found["core"].inside_68) == (1, 0, 1.0)
    assert found[ALL].nees == pytest.approx(2.6)
    assert found[ALL].pairs == 4


def test_the_table() -> None:
    refused = result({"core": 0}, score(0, pose=False), score(1, pose=False), plain=(True, True), refused="no")
    lines = format_clinic({"tracker": class_measures([refused])}).splitlines()
    assert lines[0].split()[:8] == ["class", "config", "seq.", "pairs", "plain", "poses", "wrong", "missing"]
    assert lines[1].split()[:8] == ["core", "tracker", "1", "1", "1", "0", "0", "1"]
    assert lines[1].endswith("; 1 seeds refused")
    assert lines[2].startswith(ALL)


def test_runs_keep_the_order_of_the_sequences(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("lasso_motion_ros.bench.suite.cache.render_sequence", lambda scenario: short())
    drawn = [ClinicScenario(dataclasses.replace(STILL, name=name), {"core": 0}) for name in ("x", "y")]
    found = run_clinic(drawn, {"here": StreamConfig()}, workers=1)
    assert [one.drawn.scenario.name for one in found["here"]] == ["x", "y"]
    assert found["here"][0].plain == (True, True, True)
    assert class_measures(found["here"])["core"].pairs == 4


def test_the_command(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    monkeypatch.setattr("lasso_motion_ros.bench.suite.cache.render_sequence", lambda scenario: short())
    monkeypatch.setattr("os.cpu_count", lambda: 1)
    arguments = ["suite", "--quiet", "--clinic", "--sequences", "2", "--report", str(tmp_path)]
    assert main([*arguments, "--json", str(tmp_path / "c.json")]) == 0
    assert "all pairs" in capsys.readouterr().out
    found = json.loads((tmp_path / "c.json").read_text())["tracker"]
    assert set(found["classes"]) >= {"core", "ablation", ALL}
    assert [one["since"] for one in found["sequences"]] == [dict(clinic_scenario(2009, k).since) for k in range(2)]
    assert found["sequences"][0]["pairs"][1]["classes"] == ["core"]
    assert (tmp_path / "clinic.txt").is_file()
    assert main(["suite", "--clinic", "--traps", "tilt"]) == 2
    assert "--clinic: not together with" in capsys.readouterr().err
    assert main(["suite", "--clinic", "--sequences", "2", "--only", "2"]) == 2


def test_what_the_truth_says_is_read_back(tmp_path: Path) -> None:
    from lasso_motion_ros.bench.suite.cache import SequenceCache

    sliding = dataclasses.replace(STILL, pairs=3, incidents=(Incident("slide", 0.0, 0.0, amount=2.5),))
    first, second = (SequenceCache(tmp_path).sequence(sliding).truth.pairs for _ in range(2))
    for here, there, fresh in zip(first, second, judged(sliding), strict=True):
        assert (here.due, here.displaced, here.evidence) == (there.due, there.displaced, there.evidence)
        assert (here.due, here.displaced, here.evidence) == (fresh.due, fresh.displaced, fresh.evidence)
