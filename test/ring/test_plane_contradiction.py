"""Planes that disagree: by a heart between their exposures, or as the breath goes."""

import dataclasses

import numpy as np
import pytest
from scipy import stats
from support.breathing_lasso import CONFIG, LOST, assert_no_pose, centre_error_mm, moved
from support.lasso_inputs import lasso_pair, lasso_seed

from lasso_motion_ros.geometry.frames import FramePair
from lasso_motion_ros.ring.plane_contradiction import ContradictionTuning, PlaneContradiction
from lasso_motion_ros.ring.tracker import RingTracker

TUNING = ContradictionTuning()
PAIR_S = 0.3
LATE_NS = 60_000_000


def told_by(gaps_mm, slack_mm, along_mm=None):
    """Gaps while the ring goes along the body as told, or breathes by 6 mm."""
    contradiction = PlaneContradiction.first(TUNING)
    along = breath(len(gaps_mm)) if along_mm is None else along_mm
    for index, (gap_mm, gone_mm) in enumerate(zip(gaps_mm, along, strict=True), start=1):
        contradiction = contradiction.after(index * PAIR_S, gap_mm, slack_mm, gone_mm)
    return contradiction


def breath(count, depth_mm=6.0, period_s=4.0):
    """(count,) mm, of pairs after the seed pair."""
    return depth_mm * np.sin(2.0 * np.pi * np.arange(1, count + 1) * PAIR_S / period_s)


def test_the_first_gap_is_weighed_by_what_each_share_of_the_way_makes_of_it():
    # By hand: about twice as far as the ring has gone, or about zero, with what moves between the exposures in both.
    told = told_by([5.0], 0.5, [3.0])
    at_first = 1.0 + 0.3 * TUNING.change_mm**2  # mm², where the ring was at first
    breathes = stats.t.logpdf(5.0 - 2.0 * 3.0, 4.0, scale=np.sqrt(at_first + 0.5**2 + 0.4**2))
    beats = stats.t.logpdf(5.0, 4.0, scale=np.hypot(0.5, 0.15))
    assert TUNING.shares[-1] == 2.0
    assert told.evidence[-1] == pytest.approx(min(breathes - beats, TUNING.most), abs=1e-9)
    assert told.offsets[-1] == pytest.approx((5.0 - 6.0) * at_first / (at_first + 0.25 + 0.16), rel=1e-9)
    expected = np.exp(-4.0) * np.exp(told.evidence).mean()
    assert told.probability == pytest.approx(expected / (1.0 + expected), rel=1e-9)
    assert told.size_mm == pytest.approx(5.0)
    assert told.text == "the planes disagree by 5.0 mm, as the breath goes: one of them shows something else?"


@pytest.mark.parametrize("heart_mm", [0.0, 0.5, 2.0])
def test_a_heart_is_no_contradiction(heart_mm):
    for seed in range(20):
        gaps_mm = np.random.default_rng(seed).normal(scale=np.hypot(heart_mm, 0.1), size=40)
        assert told_by(gaps_mm, heart_mm).probability < 0.01


@pytest.mark.parametrize("period_s", [5.0, 7.1, 9.0, 12.0])
def test_a_heart_nearly_in_step_with_the_exposures_is_none_though_its_gap_is_smooth(period_s):
    # 112 beats a minute at two pairs a second look like one in eight seconds.
    for phase in np.arange(0.0, 6.0, 1.5):
        beats = 2.5 * np.sin(2.0 * np.pi * np.arange(1, 41) * PAIR_S / period_s + phase)
        assert max(told_by(beats[:count], 1.8).probability for count in range(3, 41)) < 0.1


def test_a_gap_that_breathes_is_one_before_the_breath_is_over():
    found = [told_by(breath(count), 2.0, 0.5 * breath(count)).probability for count in range(14)]
    assert found[1] < 0.1  # one gap tells little
    assert min(found[8:]) > 0.5


def test_what_counts_is_how_large_a_contradiction_has_been_of_late():
    assert told_by(0.25 * breath(59), 0.8).size_mm == pytest.approx(1.5 / np.sqrt(2.0), rel=0.1)
    assert told_by([*breath(59), *(breath(59) / 6.0)], 2.0).size_mm < 2.0
    assert told_by([], 2.0).size_mm == 0.0


def test_planes_that_agree_again_are_believed_again():
    apart = list(breath(39))
    assert told_by(apart, 2.0).probability > 0.5
    assert told_by(apart + [0.1, -0.1] * 5, 0.5).probability < 0.1


def test_a_ring_that_belongs_elsewhere_breathes_about_there():
    moved_mm = 20.0
    agreed = told_by([0.1, -0.1] * 10, 0.5).anew()
    assert agreed.size_mm == 0.0
    contradiction = agreed
    for index, (gap_mm, gone_mm) in enumerate(zip(breath(14), 0.5 * breath(14), strict=True), start=21):
        contradiction = contradiction.after(index * PAIR_S, gap_mm, 1.0, moved_mm + gone_mm)
    assert contradiction.probability > 0.5
    still = agreed
    for index, gone_mm in enumerate(breath(14), start=21):
        still = still.after(index * PAIR_S, 0.1, 1.0, moved_mm + gone_mm)
    assert still.probability < 0.01


def test_a_plane_that_holds_on_to_what_lies_still_gives_no_pose():
    def pair(index, *, a_lies_still):
        there, still = lasso_pair(index, moved(index)), lasso_pair(index, moved(0))
        late = dataclasses.replace(there.b, stamp_ns=there.b.stamp_ns + LATE_NS)
        return FramePair(there.stamp_ns, still.a if a_lies_still else there.a, late)

    tracker = RingTracker(CONFIG)
    tracker.initialise(pair(0, a_lies_still=False), lasso_seed())
    results = [tracker.track(pair(index, a_lies_still=True)) for index in range(1, 14)]
    for result in results[2:]:
        # In pairs 10 to 13 the ring is near where it began, where both planes have it.
        assert_no_pose(result, LOST)
    assert "as the breath goes" in results[-1].reason
    back = [tracker.track(pair(index, a_lies_still=False)) for index in range(14, 30)]
    assert back[-1].motion is not None
    assert centre_error_mm(back[-1], moved(29)) < 0.5
