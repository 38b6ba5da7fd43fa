"""A ring in images that are filtered over time: followed where it is, and not where it was."""

from functools import cache

import numpy as np
import pytest
from support.breathing_lasso import CONFIG, LOST, TRACKING, centre_error_mm, moved
from support.lasso_inputs import CURVE, NOISE, PERIOD_NS, VIEWS, lasso_image, lasso_seed

from lasso_motion_ros.geometry.frames import Frame, FramePair
from lasso_motion_ros.ring.ring_options import RingOptions
from lasso_motion_ros.ring.temporal_filter import DisplayChainTuning
from lasso_motion_ros.ring.tracker import RingTracker

PAIRS = 14


@cache
def lagging(share):
    """Pairs of the breathing lasso in noise, of which a filter keeps a share; its first image is the first shown."""
    state, pairs = {}, []
    for index in range(PAIRS):
        frames = {}
        for p in "ab":
            noise = NOISE * np.random.default_rng([index, ord(p)]).standard_normal((512, 512))
            image = lasso_image(CURVE + moved(index), VIEWS[p]) + noise
            state[p] = (1.0 - share) * image + share * state.get(p, image)
            frames[p] = Frame(index * PERIOD_NS, np.clip(np.rint(state[p]), 0, 255).astype(np.uint8), VIEWS[p])
        pairs.append(FramePair(index * PERIOD_NS, frames["a"], frames["b"]))
    return pairs


def tracked(options, share=0.5):
    tracker = RingTracker(CONFIG, options=options)
    first, *others = lagging(share)
    return [tracker.initialise(first, lasso_seed()), *(tracker.track(pair) for pair in others)]


def test_a_ring_in_filtered_images_is_where_it_is():
    undone, left = tracked(RingOptions()), tracked(RingOptions(display=DisplayChainTuning(undo=False)))
    assert all(result.state is TRACKING for result in undone)
    assert undone[0].temporal_filter == undone[1].temporal_filter == {}
    for plane in "ab":
        assert undone[-1].temporal_filter[plane] == pytest.approx(0.5, abs=0.04)
    assert left[-1].temporal_filter == {}
    errors = [
        [
            centre_error_mm(one, moved(index))
            for index, one in enumerate(results)
            if index > 1 and one.motion is not None
        ]
        for results in (undone, left)
    ]
    assert np.mean(errors[0]) < 0.05
    assert np.mean(errors[1]) > 2.0 * np.mean(errors[0])


def test_pairs_for_which_there_is_no_time_do_not_hide_the_filter():
    """Every second pair is left out: told of them, the tracker undoes the filter that there is, with its period."""
    tracker = RingTracker(CONFIG, options=RingOptions())
    first, *others = lagging(0.5)
    tracker.leave_out(first)  # before there is a ring it is nothing
    tracker.initialise(first, lasso_seed())
    errors = []
    for index, pair in enumerate(others, start=1):
        if index % 2:
            tracker.leave_out(pair)
            continue
        result = tracker.track(pair)
        assert result.state is TRACKING
        if index > 4:
            errors.append(centre_error_mm(result, moved(index)))
    for plane in "ab":
        assert result.temporal_filter[plane] == pytest.approx(0.5, abs=0.04)
    assert np.mean(errors) < 0.05


@pytest.mark.parametrize("share", [0.85, 0.92])
def test_a_filter_too_strong_to_be_undone_leaves_no_pose(share):
    # Three images tell; what those before show is all that was known of the ring.
    for result in tracked(RingOptions(), share)[4:]:
        assert result.state is LOST
        assert result.motion is None
        assert result.reason == "too strong a filter over time in plane A and B: the images show what was"


def told(result):
    """All of a result, to the last bit."""
    arrays = (result.motion, result.covariance, result.loop)
    words = (result.stamp_ns, result.state, result.reason, result.residual_px, result.temporal_filter)
    return [None if one is None else one.tobytes() for one in arrays], words


@pytest.mark.parametrize("share", [0.0, 0.5])
def test_what_is_worked_out_ahead_changes_no_bit_of_an_answer(share):
    """Plane A's frame comes early, sometimes twice, sometimes one that makes no pair, or one that is left out."""
    plain, early = (RingTracker(CONFIG) for _ in range(2))
    first, *others = lagging(share)
    early.prepare(first.a)  # before there is a ring it is nothing
    for tracker in (plain, early):
        tracker.initialise(first, lasso_seed())
    for index, pair in enumerate(others, start=1):
        if index % 4 == 2:
            early.prepare(others[index % len(others)].a)
        else:
            early.prepare(pair.a)
        if index % 4 == 3:
            early.prepare(pair.a)
        if index == 9:
            for tracker in (plain, early):
                tracker.leave_out(pair)
            continue
        if index == 11:
            for tracker in (plain, early):
                tracker.set_reference()
        results = [tracker.track(pair) for tracker in (plain, early)]
        assert told(results[0]) == told(results[1])
        for tracker in (plain, early)[index % 2 :]:
            tracker.learn()
    assert results[0].state is TRACKING
