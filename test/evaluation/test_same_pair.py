from __future__ import annotations

from dataclasses import dataclass

import pytest

from lasso_motion_ros.evaluation.same_pair import NEAR_NS, is_same_pair, of_pair


@dataclass(frozen=True)
class Thing:
    stamp_ns: int


@pytest.mark.parametrize("sign", [-1, 1])
def test_stamps_that_are_near_are_one_pairs(sign: int) -> None:
    assert is_same_pair(10_000_000_000, 10_000_000_000 + sign * NEAR_NS)
    assert not is_same_pair(10_000_000_000, 10_000_000_000 + sign * (NEAR_NS + 1))


def test_of_several_things_the_first_that_is_near_belongs_to_the_pair() -> None:
    things = [Thing(0), Thing(266_000_000), Thing(266_000_001)]
    assert of_pair(things, 267_000_000) is things[1]
    assert of_pair(things, 130_000_000) is None
    assert of_pair([], 0) is None
