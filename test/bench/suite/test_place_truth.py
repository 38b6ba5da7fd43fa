"""When a pose is due, and how plainly the ring is shown, by the simulator's truth."""

import dataclasses
from pathlib import Path

import pytest
from support.clinic_inputs import SHORT, STILL

from lasso_motion_ros.bench.suite.cache import SequenceCache
from lasso_motion_ros.bench.suite.clinic_runs import is_plain
from lasso_motion_ros.bench.suite.place_truth import seed_gap_mm, with_place
from lasso_motion_ros.bench.suite.sequence import render_sequence
from lasso_motion_ros.evaluation.measures import PairTruth, score_pairs
from lasso_motion_ros.phantom import Simulator
from lasso_motion_ros.phantom.lab_settings import Incident
from lasso_motion_ros.phantom.settings import (
    CalibrationSettings,
    Event,
    Scenario,
)


def judged(scenario: Scenario) -> list[PairTruth]:
    return list(render_sequence(scenario).truth.pairs)


@pytest.mark.slow
def test_no_pose_is_due_from_2_mm_of_a_slide_and_none_is_right_from_3_mm() -> None:
    # 1.25 mm/s from 0 s on, a pair a second: 0, 1.25, 2.5, 3.75, 5 mm.
    sliding = dataclasses.replace(STILL, incidents=(Incident("slide", 0.0, 0.0, amount=1.25),))
    truth = render_sequence(sliding).truth
    assert [pair.due for pair in truth.pairs] == [True, True, False, False, False]
    assert [pair.displaced for pair in truth.pairs] == [False, False, False, True, True]
    scores = score_pairs(truth, [])
    assert [score.expected for score in scores] == [False, True, False, False, False]
    assert [score.displaced for score in scores] == [False, False, False, True, True]


def test_no_pose_is_due_after_a_patients_shift_but_one_that_follows_is_right() -> None:
    shift = Incident("shift", 1.2, 0.5, amount=10.0, direction=(1.0, 0.0, 0.0))
    pairs = judged(dataclasses.replace(STILL, incidents=(shift,)))
    assert [pair.due for pair in pairs] == [True, True, False, False, False]
    assert not any(pair.displaced for pair in pairs)
    assert pairs[4].motion is not None
    assert pairs[4].motion[:3, 3] == pytest.approx([0.01, 0.0, 0.0])


@pytest.mark.slow
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
    swapped = dataclasses.replace(STILL, pairs=2, calibration_error=CalibrationSettings(swapped=True))
    assert not any(pair.due for pair in judged(swapped))


def test_planes_that_disagree_by_much_at_the_seed_ask_for_no_pose() -> None:
    assert seed_gap_mm(STILL) == pytest.approx(0.0, abs=1e-6)
    # 20 px at 128 px a field are 20 mm at the ring and more; a degree at 0.8 m is none, it turns about the iso-centre.
    gross = dataclasses.replace(STILL, pairs=2, calibration_error=CalibrationSettings(shift_px=20.0), seed=3)
    assert seed_gap_mm(gross) > 8.0
    assert not any(pair.due for pair in judged(gross))
    usual = dataclasses.replace(STILL, calibration_error=CalibrationSettings(0.25, 0.7, 0.2))
    assert seed_gap_mm(usual) < 2.0


@pytest.mark.slow
def test_evidence_is_of_the_planes_that_show_the_ring() -> None:
    hidden = dataclasses.replace(STILL, events=(Event("hide", 2, 2), Event("drop", 3, plane="b")))
    pairs = judged(hidden)
    assert [sorted(pair.evidence) for pair in pairs] == [["a", "b"], ["a", "b"], [], ["a"], ["a", "b"]]
    assert [is_plain(pair) for pair in (pairs[2], pairs[3])] == [False, False]
    assert is_plain(PairTruth(0, evidence={"a": 1.3, "b": 1.2}))
    assert not is_plain(PairTruth(0, evidence={"a": 2.0, "b": 1.1}))


def test_a_ring_in_plain_view_is_plain() -> None:
    simulator = Simulator(SHORT)
    pair = next(simulator.pairs())
    true = with_place(PairTruth(0), simulator, pair)
    assert min(true.evidence.values()) > 1.5
    # Nothing is there where the ring is not.
    elsewhere = dataclasses.replace(pair, poles={plane: line + 25.0 for plane, line in pair.poles.items()})
    assert min(with_place(PairTruth(0), simulator, elsewhere).evidence.values()) < 0.8


@pytest.mark.slow
def test_what_the_truth_says_is_read_back(tmp_path: Path) -> None:
    sliding = dataclasses.replace(STILL, pairs=3, incidents=(Incident("slide", 0.0, 0.0, amount=2.5),))
    first, second = (SequenceCache(tmp_path).sequence(sliding).truth.pairs for _ in range(2))
    for here, there, fresh in zip(first, second, judged(sliding), strict=True):
        assert (here.due, here.displaced, here.evidence) == (there.due, there.displaced, there.evidence)
        assert (here.due, here.displaced, here.evidence) == (fresh.due, fresh.displaced, fresh.evidence)
