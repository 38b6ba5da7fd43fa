import dataclasses

import numpy as np
import pytest
from support.method_inputs import plane

from lasso_motion_ros.geometry.frames import PLANES, Frame, FramePair, Pair, Seed


def test_pair_hands_out_its_planes():
    a = Frame(5, np.zeros((4, 4), np.uint8), plane(0.0))
    pair = FramePair(5, a, None)
    assert PLANES == ("a", "b")
    assert pair.frame("a") is a
    assert pair.frame("b") is None


def test_seed_hands_out_its_planes():
    seed = Seed(np.zeros((6, 2)), np.ones((7, 2)))
    assert seed.points("a") is seed.points_a
    assert seed.points("b") is seed.points_b


def test_pair_cannot_be_changed():
    with pytest.raises(dataclasses.FrozenInstanceError):
        FramePair(5, None, None).stamp_ns = 6


def test_pair_tells_which_planes_are_there():
    assert Pair(5, 1, 2).frames == {"a": 1, "b": 2}
    assert Pair(5, 0, None).frames == {"a": 0}  # there, though falsy
    assert Pair(5, None, 2).frames == {"b": 2}
    assert [Pair(5, *both).missing for both in ((1, 2), (1, None), (None, 2))] == [(), ("b",), ("a",)]
    assert [Pair(5, *both).is_whole for both in ((1, 0), (1, None), (None, 2))] == [True, False, False]
