"""The tracker where R peaks come with the pairs: the filter in time hears of them."""

from dataclasses import replace

import numpy as np
import pytest
from support.breathing_lasso import CONFIG, TRACKING, pair
from support.lasso_inputs import PERIOD_NS, lasso_seed

from lasso_motion_ros.motion.heartbeat import Beats
from lasso_motion_ros.ring.association import Pending
from lasso_motion_ros.ring.tracker import RingTracker

BEAT_NS = 800_000_000


def heard(index, known=True):
    """A pair with the R peaks up to it, a beat every 0.8 s; or with none."""
    peaks = range(-4 * BEAT_NS, index * PERIOD_NS + 1, BEAT_NS) if known else ()
    return replace(pair(index), r_peaks_ns=tuple(peaks))


def test_what_r_peaks_tell_reaches_the_filter_and_a_pair_without_any_forgets_it():
    tracker = RingTracker(CONFIG)
    tracker.initialise(heard(0), lasso_seed())
    beats = tracker.known.motion.beats
    assert beats is not None
    assert (beats.peaks_s[-1], beats.beat_s) == (0.0, pytest.approx(0.8))
    for index in range(1, 5):
        assert tracker.track(heard(index)).state is TRACKING
    assert tracker.known.motion.beats.peaks_s[-1] == pytest.approx(4 * PERIOD_NS // BEAT_NS * 0.8)
    assert tracker.track(heard(5, known=False)).state is TRACKING
    assert tracker.known.motion.beats is None


def test_a_place_that_is_not_believed_yet_hears_of_them_too():
    tracker = RingTracker(CONFIG)
    tracker.initialise(heard(0, known=False), lasso_seed())
    track, beats = tracker.known, Beats.of([0.0, 0.8])
    track.pending = Pending(track.motion.later(0.2), 0.3)
    track.hear(beats)
    assert track.motion.later(0.5).beats is beats
    assert track.pending.motion.later(0.5).beats is beats


def test_poses_are_the_same_where_plane_a_was_worked_on_before_its_pair_was_complete():
    poses = []
    for ahead in (False, True):
        tracker = RingTracker(CONFIG)
        tracker.initialise(heard(0), lasso_seed())
        poses.append([])
        for index in range(1, 8):
            whole = heard(index)
            if ahead:
                tracker.prepare(whole.a)
            poses[-1].append(tracker.track(whole).motion)
    np.testing.assert_array_equal(poses[0], poses[1])
