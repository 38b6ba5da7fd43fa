"""What a ring must show to be believed, each by itself, and what makes another its rival."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from lasso_motion_ros.initialisation.judgement import Judgement, judge
from lasso_motion_ros.ring.electrodes import RingEvidence

GOOD = Judgement(
    covered=1.0,
    spread=0.98,
    agreement=0.7,
    comb=40.0,
    roundness=0.95,
    support=2.3,
    diameter_mm=20.0,
    followed=True,
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
        ({"followed": False}, "later pairs"),
        ({"diameter_mm": 9.0}, "9 mm across"),
        ({"roundness": 0.6}, "not round"),
        ({"covered": 0.5}, "50 % of its arc"),
        ({"spread": 0.7}, "one side"),
        ({"agreement": 0.1}, "different electrodes"),
        ({"comb": 9.0}, "equally far apart"),
        ({"support": 1.0}, "faint"),
    ],
)
def test_whatever_is_missing_is_said(change: dict[str, float], words: str) -> None:
    assert words in dataclasses.replace(GOOD, **change).doubt  # type: ignore[arg-type]


def test_one_that_shows_nearly_as_much_is_a_rival() -> None:
    assert dataclasses.replace(GOOD, comb=21.0, spread=0.8).is_rival_of(GOOD)
    assert not dataclasses.replace(GOOD, comb=12.0).is_rival_of(GOOD)


def test_the_same_poles_in_both_planes_agree_and_others_do_not() -> None:
    same = {"a": shown(10, 0.0, 1), "b": shown(10, 0.0, 2)}
    other = {"a": shown(10, 0.0, 1), "b": shown(10, np.pi, 2)}
    weights = np.full(120, 1.0 / 120.0)
    good, bad = (
        judge(RingEvidence(RING, evidence, 20.0), weights, roundness=0.95, support=2.3, followed=True)
        for evidence in (same, other)
    )
    assert good.agreement > 0.9
    assert good.is_ring
    assert bad.agreement < 0.0
    assert not bad.is_ring
