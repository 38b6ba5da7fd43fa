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


def told_by(gaps_mm, slack_mm):
    contradiction = PlaneContradiction(TUNING)
    for index, gap_mm in enumerate(gaps_mm, start=1):
        contradiction = contradiction.after(index * PAIR_S, gap_mm, slack_mm)
    return contradiction


def test_the_first_gap_is_weighed_by_two_densities():
    # By hand: a gap that breathes is normal about zero, 3 mm with 0.4 mm of noise; one of the heart's is Student's.
    breathes = stats.norm.logpdf(2.0, scale=np.hypot(3.0, 0.4))
    beats = stats.t.logpdf(2.0, 4.0, scale=np.hypot(0.5, 0.15))
    told = told_by([2.0], 0.5)
    assert told.evidence == pytest.approx(breathes - beats, abs=1e-9)
    assert told.probability == pytest.approx(1.0 / (1.0 + np.exp(4.0 - told.evidence)), rel=1e-9)
    assert told.state[0] == pytest.approx(2.0 * 9.0 / (9.0 + 0.16), rel=1e-9)
    assert told.size_mm == pytest.approx(2.0)
    assert told.text == "the planes disagree by 2.0 mm, as the breath goes: one of them shows something else?"


@pytest.mark.parametrize("heart_mm", [0.0, 0.5, 2.0])
def test_a_heart_is_no_contradiction(heart_mm):
    for seed in range(20):
        gaps_mm = np.random.default_rng(seed).normal(scale=np.hypot(heart_mm, 0.1), size=40)
        assert told_by(gaps_mm, heart_mm).probability < 0.01


def test_a_gap_that_breathes_is_one_before_the_breath_is_over():
    gaps_mm = 6.0 * np.sin(2.0 * np.pi * np.arange(1, 14) * PAIR_S / 4.0)
    found = [told_by(gaps_mm[:count], 2.0).probability for count in range(14)]
    assert found[1] < 0.1  # one gap tells little
    assert min(found[8:]) > 0.5


def test_what_counts_is_how_large_a_contradiction_has_been_of_late():
    breath = np.sin(2.0 * np.pi * np.arange(1, 60) * PAIR_S / 4.0)
    assert told_by(1.5 * breath, 0.8).size_mm == pytest.approx(1.5 / np.sqrt(2.0), rel=0.1)
    assert told_by([*(6.0 * breath), *(1.0 * breath)], 2.0).size_mm < 2.0
    assert told_by([], 2.0).size_mm == 0.0


def test_planes_that_agree_again_are_believed_again():
    breathing = list(6.0 * np.sin(2.0 * np.pi * np.arange(1, 40) * PAIR_S / 4.0))
    assert told_by(breathing, 2.0).probability > 0.5
    assert told_by(breathing + [0.1, -0.1] * 5, 0.5).probability < 0.1


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
