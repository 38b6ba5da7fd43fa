"""What a ring must show to be believed, each by itself, and what makes another its rival."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
import pytest

from lasso_motion_ros.geometry.frames import PLANES
from lasso_motion_ros.initialisation.distinctness import Distinctness
from lasso_motion_ros.initialisation.judgement import (
    MOST_DISTINCT,
    Glance,
    Judgement,
    Known,
    at_best,
    at_most,
    hope,
    hope_of_lines,
    judge,
)
from lasso_motion_ros.ring.electrodes import RingEvidence, likeliest_comb

GOOD = Judgement(
    covered=1.0,
    spread=0.98,
    agreement=0.7,
    comb=40.0,
    roundness=0.95,
    support=2.3,
    diameter_mm=20.0,
    worth=1.3,
    rareness=40.0,
    line_beyond=0.0,
    distinct=Distinctness(15.0, 18.0, 1.0),
)
HARDLY = Distinctness(9.0, 11.0, 0.2)
ORDINARY = dataclasses.replace(GOOD, comb=15.0, distinct=Distinctness(11.0, 13.0, 0.5))
ANGLE = np.linspace(0.0, 2.0 * np.pi, 120)
RING = 0.01 * np.column_stack([np.cos(ANGLE), np.sin(ANGLE), 0.0 * ANGLE])


def shown(poles: int, phase: float, noise: int) -> np.ndarray:
    random = np.random.default_rng(noise)
    return np.maximum(np.cos(poles * ANGLE + phase), 0.0) * 2.0 + 0.1 * random.standard_normal(120)


def test_a_plain_ring_is_believed() -> None:
    assert GOOD.doubt == ""
    assert GOOD.is_ring


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"diameter_mm": 9.0}, "9 mm across"),
        ({"roundness": 0.6}, "not round"),
        ({"covered": 0.4}, "40 % of its arc"),
        ({"spread": 0.7}, "one side"),
        ({"agreement": 0.1}, "different electrodes"),
        ({"comb": 5.0}, "equally far apart"),
        ({"spread": 0.84, "agreement": 0.3, "comb": 9.0, "worth": 0.85, "distinct": HARDLY}, "all in all"),
        ({"support": 1.0}, "faint"),
        ({"line_beyond": 0.9}, "long line"),
    ],
)
def test_whatever_is_missing_is_said(change: dict[str, Any], words: str) -> None:
    assert words in dataclasses.replace(GOOD, **change).doubt  # type: ignore[arg-type]


def test_much_of_one_thing_makes_up_for_little_of_another() -> None:
    assert ORDINARY.is_ring
    little = dataclasses.replace(ORDINARY, spread=0.85, roundness=0.85, worth=0.8)
    assert not little.is_ring
    assert dataclasses.replace(little, distinct=GOOD.distinct).is_ring


@pytest.mark.parametrize("less", [{"curve": 5.0}, {"poles": 8.0}, {"lead": -0.3}])
def test_what_does_not_stand_out_from_what_lies_about_it_is_hardly_one(less: dict[str, float]) -> None:
    faint = dataclasses.replace(ORDINARY, worth=1.0)
    assert faint.is_ring
    hidden = dataclasses.replace(faint, distinct=dataclasses.replace(faint.distinct, **less))
    assert not hidden.is_ring
    assert hidden.evidence < faint.evidence - 1.5


def test_electrodes_no_rarer_than_chance_makes_them_speak_against_a_ring() -> None:
    """A bent row of another catheter's electrodes, which leaves half of the ring out; all else of it looks like one."""
    row = dataclasses.replace(
        GOOD,
        covered=0.75,
        spread=0.84,
        agreement=0.76,
        comb=15.8,
        roundness=0.92,
        support=2.06,
        worth=1.1,
        rareness=0.0,
        distinct=Distinctness(11.5, 13.5, 0.6),
    )
    assert not row.missing
    assert not row.is_ring
    assert dataclasses.replace(row, rareness=4.0).is_ring


def test_a_chain_of_poles_on_a_line_that_goes_on_is_none() -> None:
    # Edge-on in one plane, and in the other a curve beside it that happens to have as many spots: a little further
    # along the line it shows as much.
    line = Judgement(
        covered=0.92,
        spread=0.966,
        agreement=0.223,
        comb=26.9,
        roundness=0.85,
        support=2.13,
        diameter_mm=21.3,
        worth=0.925,
        rareness=11.1,
        line_beyond=0.477,
        distinct=Distinctness(9.0, 11.0, 0.0),
    )
    assert not line.missing
    assert not line.is_ring
    assert dataclasses.replace(line, distinct=Distinctness(12.0, 15.0, 0.7)).is_ring


def test_one_that_shows_nearly_as_much_is_a_rival() -> None:
    nearly = dataclasses.replace(ORDINARY, spread=0.88, roundness=0.88, worth=0.8)
    assert not nearly.is_ring
    assert nearly.is_rival
    assert not dataclasses.replace(nearly, spread=0.81, comb=9.0, distinct=HARDLY).is_rival
    assert not dataclasses.replace(GOOD, covered=0.4).is_rival


@pytest.mark.parametrize(
    ("change", "may_be"),
    [({}, True), ({"distinct": HARDLY, "comb": 8.5}, False), ({"line_beyond": 0.9}, False)],
)
def test_whether_a_ring_may_be_one_is_known_before_it_is_followed(change: dict[str, Any], may_be: bool) -> None:
    known: dict[str, Any] = {
        "roundness": GOOD.roundness,
        "diameter_mm": GOOD.diameter_mm,
        "worth": 0.9,
        "rareness": GOOD.rareness,
        "line_beyond": GOOD.line_beyond,
        "comb": GOOD.comb,
        "distinct": GOOD.distinct,
    }
    best = at_best(**known | change)
    assert (hope(best, Known.POLES) >= 0.0) is may_be
    assert best.evidence >= dataclasses.replace(GOOD, **change, worth=0.9).evidence


def test_what_leaves_no_hope_is_known_step_by_step() -> None:
    line = {"worth": 1.1, "rareness": 10.0, "line_beyond": 0.0}
    assert hope(at_most(**line), Known.CIRCLE) >= 0.0
    assert hope(at_most(**line | {"line_beyond": 0.9}), Known.CIRCLE) < 0.0
    assert hope(at_most(**line | {"worth": 0.4}), Known.CIRCLE) < 0.0
    assert hope_of_lines(at_most(**line), 12.0) > hope_of_lines(at_most(**line), 10.5) > 0.0
    assert hope_of_lines(at_most(**line), 7.0) < 0.0
    assert hope_of_lines(at_most(**line, before=2.5), 7.0) > 0.0
    assert hope_of_lines(at_most(**line | {"worth": 0.4}), 99.0) == -np.inf
    curve: dict[str, Any] = {"worth": 1.1, "rareness": 10.0, "line_beyond": 0.0, "roundness": 0.95, "diameter_mm": 20.0}
    there, hardly_there = (dataclasses.replace(MOST_DISTINCT, curve=one) for one in (11.0, 4.0))
    assert hope(at_best(**curve, distinct=there), Known.CURVE) >= 0.0
    assert hope(at_best(**curve, distinct=hardly_there), Known.CURVE) < 0.0
    assert hope(at_best(**curve | {"roundness": 0.72, "diameter_mm": 14.0}, distinct=there), Known.CURVE) < 0.0
    # All that is believed was hopeful.
    for one in (GOOD, ORDINARY, dataclasses.replace(ORDINARY, rareness=2.0, roundness=0.9)):
        assert one.is_ring
        found = {"worth": one.worth, "rareness": one.rareness, "line_beyond": one.line_beyond}
        assert hope(at_most(**found), Known.CIRCLE) >= 0.0
        found |= {"roundness": one.roundness, "diameter_mm": one.diameter_mm}
        seen = dataclasses.replace(MOST_DISTINCT, curve=one.distinct.curve)
        assert hope(at_best(**found, distinct=seen), Known.CURVE) >= 0.0
        assert hope(at_best(**found, comb=one.comb, distinct=one.distinct), Known.POLES) >= 0.0


def test_what_earlier_looks_saw_of_a_ring_gives_hope() -> None:
    doubtful: dict[str, Any] = {
        "roundness": 0.9,
        "diameter_mm": 20.0,
        "worth": 1.1,
        "rareness": 9.0,
        "line_beyond": 0.0,
    }
    doubtful |= {"comb": 12.0, "distinct": HARDLY}
    assert hope(at_best(**doubtful), Known.POLES) < 0.0
    assert hope(at_best(**doubtful, before=2.5), Known.POLES) >= 0.0


def test_a_ring_squeezed_by_its_vein_is_one_where_all_else_is_plain() -> None:
    assert dataclasses.replace(GOOD, roundness=0.75).is_ring


def test_before_there_is_a_model_it_may_be_as_round_as_can_be_and_of_any_size() -> None:
    known = {"worth": 1.0, "rareness": 3.0, "line_beyond": 0.0}
    assert at_most(**known).evidence >= at_best(roundness=0.99, diameter_mm=20.0, **known).evidence


def test_the_same_poles_in_both_planes_agree_and_others_do_not() -> None:
    same = {"a": shown(10, 0.0, 1), "b": shown(10, 0.0, 2)}
    other = {"a": shown(10, 0.0, 1), "b": shown(10, np.pi, 2)}
    weights = np.full(120, 1.0 / 120.0)
    places = dict.fromkeys(PLANES, 1e3 * RING[:, :2])
    good, bad = (
        judge(
            RingEvidence(RING, evidence, 20.0),
            places,
            weights,
            roundness=0.95,
            support=2.3,
            worth=1.3,
            rareness=40.0,
            line_beyond=0.0,
            comb=likeliest_comb(RING, evidence).score,
            distinct=GOOD.distinct,
        )
        for evidence in (same, other)
    )
    assert good.agreement > 0.9
    assert good.is_ring
    assert bad.agreement < 0.0
    assert not bad.is_ring


def test_a_plane_that_sees_the_ring_edge_on_shows_either_half_in_the_other_ones_place() -> None:
    both = shown(7, 0.8, 1)
    edge_on = np.maximum(both, both[::-1])  # the near half and the far one, in one place
    open_view, flat = 1e3 * RING[:, :2], 1e3 * RING[:, :2] * np.array([1.0, 0.01])
    evidence = {"a": both, "b": edge_on}
    blind, told = (Glance.at(evidence, {"a": open_view, "b": places}).agreement for places in (open_view, flat))
    assert told > blind + 0.1
