import numpy as np
import pytest

from lasso_motion_ros.ring.ring_lay import FOUND_AGAIN_TURN_DEG, PAIRS_KEPT, RingLay


def about_x(degrees):
    return np.radians([degrees, 0.0, 0.0])


def test_the_angle_is_counted_from_how_it_belongs():
    lay = RingLay()
    lay.accept(about_x(3.0))
    assert lay.turned_deg(np.radians([3.0, 4.0, 0.0])) == pytest.approx(5.0)
    lay.settle()
    assert lay.turned_deg(np.radians([3.0, 4.0, 0.0])) == pytest.approx(4.0)


def test_found_again_it_may_lie_as_in_any_pair_before():
    lay = RingLay()
    lay.accept(about_x(-3.0))
    lay.accept(about_x(3.0))
    assert lay.return_refusal(about_x(3.0 + FOUND_AGAIN_TURN_DEG - 0.1)) == ""
    assert lay.return_refusal(about_x(-3.0 - FOUND_AGAIN_TURN_DEG + 0.1)) == ""
    assert lay.return_refusal(about_x(8.0)) == "found again, but turned by 5 degrees: moved?"


def test_once_turned_away_it_has_to_come_nearer():
    lay = RingLay()
    assert lay.return_refusal(about_x(3.9)) == ""
    assert lay.return_refusal(about_x(4.1)) != ""
    assert lay.return_refusal(about_x(3.9)) != ""
    assert lay.return_refusal(about_x(2.3)) == ""
    lay.accept(about_x(0.0))
    assert lay.return_refusal(about_x(3.9)) == ""


def test_what_was_long_ago_is_forgotten():
    lay = RingLay()
    lay.accept(about_x(10.0))
    for _ in range(PAIRS_KEPT):
        lay.accept(about_x(0.0))
    assert lay.return_refusal(about_x(10.0)) != ""


def test_settled_elsewhere_nothing_of_before_counts():
    lay = RingLay()
    lay.last = about_x(12.0)
    lay.settle()
    assert lay.return_refusal(about_x(12.0)) == ""
    assert lay.return_refusal(about_x(0.0)) != ""
