"""How far the ring has slid from what moves with the heart beside it, by hand-computed numbers."""

import dataclasses

import numpy as np
import pytest

from lasso_motion_ros.motion.motion_model import Observation
from lasso_motion_ros.ring.companion_slide import CompanionSlide, CompanionSlideTuning

MM = 1e-3
TUNING = CompanionSlideTuning(first_m=1.0 * MM, wander_m=0.0, freedom=1e9)
XY, XZ = np.eye(3)[[0, 1]], np.eye(3)[[0, 2]]


def shown(across, along_mm, variance_mm2=1.0):
    return Observation(across, MM * np.array(along_mm), MM**2 * variance_mm2 * np.eye(2))


def test_one_plane_by_hand():
    # Half way from 0 ± 1 to 2 ± 1, in the plane's directions only.
    slide = CompanionSlide.first(TUNING).after(1.0, [shown(XY, [2.0, 0.0])])
    np.testing.assert_allclose(slide.offset, [1.0 * MM, 0.0, 0.0])
    np.testing.assert_allclose(slide.covariance, MM**2 * np.diag([0.5, 0.5, 1.0]))
    assert slide.size_m == pytest.approx(1.0 * MM)


def test_the_planes_share_a_direction():
    slide = CompanionSlide.first(TUNING).after(1.0, [shown(XY, [2.0, 0.0]), shown(XZ, [2.0, 2.0])])
    np.testing.assert_allclose(slide.offset, MM * np.array([4.0 / 3.0, 0.0, 1.0]), atol=1e-15)
    np.testing.assert_allclose(slide.covariance, MM**2 * np.diag([1.0 / 3.0, 0.5, 0.5]), atol=1e-15)


def test_it_wanders_where_it_is_seen_only():
    tuning = dataclasses.replace(TUNING, wander_m=2.0 * MM)
    slide = CompanionSlide.first(tuning).after(0.25, [shown(XY, [0.0, 0.0], 1e9)])
    np.testing.assert_allclose(np.diag(slide.covariance), MM**2 * np.array([2.0, 2.0, 1.0]), rtol=1e-6)
    unseen = slide.after(10.0, [])
    np.testing.assert_allclose(unseen.covariance, slide.covariance)


def test_what_is_far_off_once_counts_for_less():
    near = CompanionSlide.first(CompanionSlideTuning(first_m=1.0 * MM, wander_m=0.0))
    usual = near.after(1.0, [shown(XY, [1.0, 0.0])]).offset[0]
    far = near.after(1.0, [shown(XY, [20.0, 0.0])]).offset[0]
    assert usual == pytest.approx(0.5 * MM)
    assert far < 5.0 * MM


@pytest.mark.parametrize("away_mm", [8.0, 20.0])
def test_what_a_hand_has_put_elsewhere_is_there_by_the_second_pair_and_back_likewise(away_mm):
    slide, there, here = CompanionSlide.first(CompanionSlideTuning()), [away_mm, 0.0], [0.0, 0.0]

    def seen(slide, along):
        return slide.after(0.3, [shown(XY, along, 0.09), shown(XZ, along, 0.09)])

    for _ in range(6):
        slide = seen(slide, here)
    once = seen(slide, there)
    assert once.size_m < 0.5 * away_mm * MM
    twice = seen(once, there)
    assert twice.size_m == pytest.approx(away_mm * MM, rel=0.1)
    for _ in range(30):
        twice = seen(twice, there)
    back = seen(seen(twice, here), here)
    assert back.size_m < 0.5 * MM
    assert back.beyond(2.0 * MM) < 0.01


def test_the_probability_of_more_than_a_limit_by_hand():
    slide = CompanionSlide(TUNING, MM * np.array([0.0, 3.0, 0.0]), MM**2 * np.diag([9.0, 0.25, 9.0]))
    # Two standard deviations within the estimate: 97.7 %.
    assert slide.beyond(2.0 * MM) == pytest.approx(0.97725, abs=1e-5)
    assert slide.log_odds(2.0 * MM) == pytest.approx(np.log(0.97725 / 0.02275), abs=1e-3)
    assert CompanionSlide.first(TUNING).beyond(2.0 * MM) == 0.0


def test_it_is_known_while_both_planes_show_companions():
    first = CompanionSlide.first(TUNING)
    assert not first.is_known  # nothing was seen yet
    both = first.after(0.3, [shown(XY, [0.0, 0.0], 0.1), shown(XZ, [0.0, 0.0], 0.1)])
    assert both.is_known
    assert both.after(1.9, [shown(XY, [0.0, 0.0], 0.1)]).is_known
    assert not both.after(2.1, [shown(XY, [0.0, 0.0], 0.1)]).is_known
    assert not first.after(0.3, [shown(XY, [0.0, 0.0], 9.0), shown(XZ, [0.0, 0.0], 9.0)]).is_known
