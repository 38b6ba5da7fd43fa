import numpy as np
import pytest

from lasso_motion_ros.motion.respiration import Estimate
from lasso_motion_ros.ring.finding import Finding
from lasso_motion_ros.ring.foresight import FEWEST_PAIRS, LARGEST_SHARE, LARGEST_SURPRISE, Foresight, Trial, surprise_of

UNFORESEEN = np.array([0.003, 0.0, 0.004])


def trial(surprise, departure="", gap_mm=0.0):
    finding = Finding(None, ("a", "b"), gap_mm=gap_mm, degraded_gap_mm=0.8)
    return Trial(finding, None, departure, UNFORESEEN, surprise)


def after(*surprises):
    foresight = Foresight()
    for surprise in surprises:
        foresight.accept(trial(surprise))
    return foresight


def test_the_surprise_is_in_units_of_the_predicted_covariance():
    predicted = Estimate(np.zeros(3), np.diag([0.001, 0.002, 0.004]) ** 2)
    assert surprise_of(np.array([0.002, 0.002, 0.004]), predicted) == pytest.approx(4.0 + 1.0 + 1.0)


def test_what_nothing_foretold_is_refused_with_how_far_it_is():
    foresight = after(*[2.0] * FEWEST_PAIRS)
    assert foresight.refusal(trial(LARGEST_SURPRISE)) == ""
    assert foresight.refusal(trial(LARGEST_SURPRISE + 1.0)) == (
        "5.0 mm from where its motion so far leads: being moved?"
    )


def test_before_a_few_pairs_nothing_is_refused():
    assert after(*[2.0] * (FEWEST_PAIRS - 1)).refusal(trial(1e6)) == ""


def test_a_motion_that_surprises_often_may_do_so_again():
    restless = after(*[12.0] * 200)
    assert restless.refusal(trial(0.99 * LARGEST_SHARE * 12.0)) == ""
    assert restless.refusal(trial(1.01 * LARGEST_SHARE * 12.0)) != ""
    calmed = after(*[12.0] * 200, *[1.0] * 200)
    assert calmed.refusal(trial(LARGEST_SURPRISE + 1.0)) != ""


def test_what_goes_on_being_refused_is_sure():
    foresight = after(*[2.0] * FEWEST_PAIRS)
    foresight.refusal(trial(1e3))
    assert not foresight.is_sure
    foresight.refusal(trial(1e3))
    assert foresight.is_sure
    foresight.accept(trial(2.0))
    assert not foresight.is_sure


def test_breathing_that_surprises_less_on_planes_that_agree_is_preferred():
    best = trial(2.0)
    for worse in (trial(2.5), trial(2.0, gap_mm=0.4), trial(0.1, departure="jumped")):
        assert best.implausibility < worse.implausibility
    # A disagreement at the limit weighs as two and a half standard deviations.
    assert trial(2.0, gap_mm=0.8).implausibility == pytest.approx((False, 2.0 + 2.5**2))
