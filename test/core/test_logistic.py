"""Log odds to probabilities."""

import math

import pytest

from lasso_motion_ros.core.logistic import logistic


@pytest.mark.parametrize(("odds", "probability"), [(1.0, 0.5), (3.0, 0.75), (0.25, 0.2), (19.0, 0.95)])
def test_odds_of_so_many_to_one(odds, probability):
    assert logistic(math.log(odds)) == pytest.approx(probability, abs=1e-15)


@pytest.mark.parametrize("log_odds", [0.3, 2.0, 12.0, 40.0])
def test_for_and_against_are_certain_together(log_odds):
    assert logistic(log_odds) + logistic(-log_odds) == pytest.approx(1.0, abs=1e-15)


@pytest.mark.parametrize("log_odds", [1e3, 1e300, math.inf])
def test_the_largest_odds_are_borne(log_odds):
    assert logistic(log_odds) == 1.0
    assert logistic(-log_odds) == 0.0
