import dataclasses

import numpy as np
import pytest
from support.method_inputs import plane

from lasso_motion_ros.geometry.frames import PLANES, Frame, FramePair, Seed


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
