import numpy as np
import pytest

from lasso_motion_ros.foresight import FEWEST_PAIRS, LARGEST_SHARE, LARGEST_SURPRISE, Foresight, surprise_of
from lasso_motion_ros.respiration import Estimate

UNFORESEEN = np.array([0.003, 0.0, 0.004])


def after(*surprises):
    foresight = Foresight()
    for surprise in surprises:
        foresight.accept(surprise)
    return foresight


def test_the_surprise_is_in_units_of_the_predicted_covariance():
    predicted = Estimate(np.zeros(3), np.diag([0.001, 0.002, 0.004]) ** 2)
    assert surprise_of(np.array([0.002, 0.002, 0.004]), predicted) == pytest.approx(4.0 + 1.0 + 1.0)


def test_what_nothing_foretold_is_refused_with_how_far_it_is():
    foresight = after(*[2.0] * FEWEST_PAIRS)
    assert foresight.refusal(LARGEST_SURPRISE, UNFORESEEN) == ""
    assert foresight.refusal(LARGEST_SURPRISE + 1.0, UNFORESEEN) == (
        "5.0 mm from where its motion so far leads: being moved?"
    )


def test_before_a_few_pairs_nothing_is_refused():
    assert after(*[2.0] * (FEWEST_PAIRS - 1)).refusal(1e6, UNFORESEEN) == ""


def test_a_motion_that_surprises_often_may_do_so_again():
    restless = after(*[12.0] * 200)
    assert restless.refusal(0.99 * LARGEST_SHARE * 12.0, UNFORESEEN) == ""
    assert restless.refusal(1.01 * LARGEST_SHARE * 12.0, UNFORESEEN) != ""
    calmed = after(*[12.0] * 200, *[1.0] * 200)
    assert calmed.refusal(LARGEST_SURPRISE + 1.0, UNFORESEEN) != ""


def test_what_goes_on_being_refused_is_sure():
    foresight = after(*[2.0] * FEWEST_PAIRS)
    foresight.refusal(1e3, UNFORESEEN)
    assert not foresight.is_sure
    foresight.refusal(1e3, UNFORESEEN)
    assert foresight.is_sure
    foresight.accept(2.0)
    assert not foresight.is_sure
