"""What a ring must show to be believed, each by itself, and what makes another its rival."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from lasso_motion_ros.geometry.frames import PLANES
from lasso_motion_ros.initialisation.judgement import Glance, Judgement, at_best, at_most, is_hopeful, judge
from lasso_motion_ros.ring.electrodes import RingEvidence

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
)
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
        ({"covered": 0.7, "spread": 0.84, "agreement": 0.3, "comb": 9.0, "support": 1.9, "worth": 0.85}, "all in all"),
        ({"support": 1.0}, "faint"),
        ({"line_beyond": 0.9}, "long line"),
    ],
)
def test_whatever_is_missing_is_said(change: dict[str, float], words: str) -> None:
    assert words in dataclasses.replace(GOOD, **change).doubt  # type: ignore[arg-type]


def test_much_of_one_thing_makes_up_for_little_of_another() -> None:
    few_poles = dataclasses.replace(GOOD, comb=10.0)
    assert few_poles.is_ring
    assert not dataclasses.replace(few_poles, spread=0.85, roundness=0.85, worth=0.8).is_ring


def test_electrodes_of_all_pairs_that_chance_would_seldom_put_there_speak_for_a_ring() -> None:
    faint = dataclasses.replace(GOOD, spread=0.86, comb=12.0, worth=0.85, rareness=2.0)
    assert not faint.is_ring
    assert dataclasses.replace(faint, rareness=25.0).is_ring
    assert dataclasses.replace(faint, rareness=25.0).evidence - faint.evidence == pytest.approx(0.12 * 23.0 + 1.0)


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
    )
    assert not row.missing
    assert not row.is_ring
    assert dataclasses.replace(row, rareness=4.0).is_ring


def test_a_chain_of_poles_on_a_line_that_goes_on_is_none() -> None:
    # Edge-on in one plane, and in the other a curve beside it that happens to have as many spots.
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
    )
    assert not line.missing
    assert not line.is_ring
    assert dataclasses.replace(line, line_beyond=0.0).is_ring


def test_one_that_shows_nearly_as_much_is_a_rival() -> None:
    assert dataclasses.replace(GOOD, comb=12.0, spread=0.86, worth=0.85).is_rival
    assert not dataclasses.replace(GOOD, comb=9.0, spread=0.81, support=1.8, worth=0.8, rareness=8.0).is_rival
    assert not dataclasses.replace(GOOD, covered=0.4).is_rival


@pytest.mark.parametrize(
    ("change", "may_be"),
    [({}, True), ({"worth": 0.4, "rareness": 2.0, "roundness": 0.82}, False), ({"line_beyond": 0.9}, False)],
)
def test_whether_a_ring_may_be_one_is_known_before_it_is_followed(change: dict[str, float], may_be: bool) -> None:
    known = {
        "roundness": GOOD.roundness,
        "diameter_mm": GOOD.diameter_mm,
        "worth": GOOD.worth,
        "rareness": GOOD.rareness,
        "line_beyond": GOOD.line_beyond,
    }
    best = at_best(**known | change)
    assert best.is_rival is may_be
    assert best.evidence >= dataclasses.replace(GOOD, **change).evidence


def test_what_leaves_no_hope_is_known_before_there_is_a_model_and_before_it_is_followed() -> None:
    line = {"worth": 1.1, "rareness": 10.0, "line_beyond": 0.0}
    assert is_hopeful(at_most(**line), has_model=False)
    assert not is_hopeful(at_most(**line | {"line_beyond": 0.9}), has_model=False)
    assert not is_hopeful(at_most(**line | {"worth": 0.6}), has_model=False)
    assert is_hopeful(at_best(roundness=0.95, diameter_mm=20.0, **line), has_model=True)
    assert not is_hopeful(at_best(roundness=0.72, diameter_mm=14.0, **line), has_model=True)
    # All that is believed was hopeful: a plain ring, too, of whose electrodes few are points in all pairs.
    plain = dataclasses.replace(GOOD, spread=0.98, comb=50.0, worth=1.28, roundness=0.913, support=2.39, rareness=0.0)
    assert plain.is_ring
    found = {"worth": plain.worth, "rareness": 0.0, "line_beyond": 0.0}
    assert is_hopeful(at_most(**found), has_model=False)
    assert is_hopeful(at_best(roundness=plain.roundness, diameter_mm=plain.diameter_mm, **found), has_model=True)
    faint = dataclasses.replace(GOOD, spread=0.92, comb=14.0, worth=0.95, rareness=4.0)
    assert faint.is_ring
    known = {"worth": faint.worth, "rareness": faint.rareness, "line_beyond": faint.line_beyond}
    assert is_hopeful(at_best(roundness=faint.roundness, diameter_mm=faint.diameter_mm, **known), has_model=True)


def test_a_ring_squeezed_by_its_vein_is_one_where_all_else_is_plain() -> None:
    assert dataclasses.replace(GOOD, roundness=0.75).is_ring


@pytest.mark.parametrize(("worth", "line_beyond", "may_be"), [(1.3, 0.0, True), (0.2, 0.0, False), (1.3, 0.9, False)])
def test_what_can_be_no_ring_is_known_without_a_model(worth: float, line_beyond: float, may_be: bool) -> None:
    most = at_most(worth=worth, rareness=3.0, line_beyond=line_beyond)
    assert most.is_rival is may_be
    model = at_best(roundness=0.99, diameter_mm=20.0, worth=worth, rareness=3.0, line_beyond=line_beyond)
    assert most.evidence >= model.evidence


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
