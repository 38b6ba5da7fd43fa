"""Which rings may be proposed beside each other."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from support.breathing_lasso import pair
from support.lasso_inputs import CURVE
from support.proposed_ring import JUDGEMENT
from support.tracking_inputs import VIEWS

from lasso_motion_ros.geometry.frames import Seed
from lasso_motion_ros.geometry.transforms import rotation_from_vector
from lasso_motion_ros.initialisation.proposal import Proposal


def test_an_outline_of_each_of_two_rings_makes_no_third() -> None:
    other = CURVE + np.array([0.02, 0.01, 0.0])
    places = np.linspace(0, len(CURVE) - 1, 21).astype(int)[:-1]
    a, b = ({plane: view.project(curve[places]) for plane, view in VIEWS.items()} for curve in (CURVE, other))

    def proposal(curve: np.ndarray, seen_a: np.ndarray, seen_b: np.ndarray) -> Proposal:
        return Proposal(pair(0), Seed(seen_a, seen_b), curve, JUDGEMENT, 0, "")

    one, two = proposal(CURVE, a["a"], a["b"]), proposal(other, b["a"], b["b"])
    assert one.can_be_beside(two)
    assert not one.can_be_beside(replace(two, points=CURVE + 1e-3))
    third = proposal(CURVE + np.array([-0.02, 0.02, 0.0]), a["a"] + 1.0, b["b"])
    assert not third.can_be_beside(one)
    assert not third.can_be_beside(two)


def test_an_arc_of_a_ring_and_what_lies_beside_it_make_no_other() -> None:
    middle = CURVE.mean(axis=0)
    away = np.arange(20) * 40.0

    def proposal(curve: np.ndarray, shift_px: float) -> Proposal:
        clicks = np.stack([away + shift_px, away * 0.5], axis=1)
        return Proposal(pair(0), Seed(clicks, clicks), curve, JUDGEMENT, 0, "")

    arc = CURVE[: len(CURVE) // 3]
    beside = np.concatenate([arc, arc[-1] + np.linspace(0.0, 1.0, 300)[:, None] * 3.0 * (arc[-1] - middle)])
    one, part = proposal(CURVE, 0.0), proposal(beside, 300.0)
    assert np.linalg.norm(part.centre - one.centre) > 8e-3
    assert not part.can_be_beside(one)
    assert proposal(CURVE + np.array([0.0, 0.0, 0.03]), 300.0).can_be_beside(one)


def test_another_curve_of_a_ring_lies_along_it_and_one_across_it_does_not() -> None:
    clicks = np.zeros((20, 2))
    middle = CURVE.mean(axis=0)
    axis = np.linalg.svd(CURVE - middle, full_matrices=False)[2][0]
    across = middle + (CURVE - middle) @ rotation_from_vector(0.9 * axis).T
    one, along, other = (
        Proposal(pair(0), Seed(clicks, clicks), curve, JUDGEMENT, 0, "") for curve in (CURVE, CURVE + 0.5e-3, across)
    )
    assert one.is_of(along)
    assert np.linalg.norm(one.centre - other.centre) < 1e-6
    assert not one.is_of(other)
