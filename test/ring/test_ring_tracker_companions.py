"""A ring that leaves its place where its own past cannot tell: with and without a device that moves with the heart."""

import cv2
import numpy as np
import pytest
from support.breathing_lasso import CONFIG, DISPLACED, PAIR_S, breathing, centre_error_mm, moved
from support.lasso_inputs import CURVE, LOOP, VIEWS, lasso_image, lasso_seed, pair_of

from lasso_motion_ros.ring.tracker import RingTracker

ALONG = breathing(6.0 * PAIR_S) / np.linalg.norm(breathing(6.0 * PAIR_S))  # where a deeper breath takes it, too
ACROSS = np.cross(ALONG, [0.0, 0.6, 0.8]) / np.linalg.norm(np.cross(ALONG, [0.0, 0.6, 0.8]))
# Two pairs of a coronary-sinus catheter's electrodes, metres from the ring's centre: clear of it in both views.
SINUS = np.array([[0.028, 0.014, -0.030], [0.030, 0.016, -0.028], [0.035, 0.019, -0.027], [0.037, 0.021, -0.025]])


def images(ring_m, heart_m, *, has_sinus):
    """Both planes, the ring and what lies in the heart having moved by (3,) metres."""
    shown = {}
    for plane, view in VIEWS.items():
        grey = lasso_image(CURVE + ring_m, view).astype(np.float32)
        if has_sinus:
            radius = 0.9 / view.millimetres_per_pixel(LOOP.centre)
            for x, y in view.project(LOOP.centre + SINUS + heart_m):
                dark = np.zeros_like(grey)
                cv2.circle(dark, (round(16 * x), round(16 * y)), round(16 * radius), 1.0, cv2.FILLED, cv2.LINE_AA, 4)
                grey *= 1.0 - 0.4 * cv2.GaussianBlur(dark, (0, 0), 1.0)
        shown[plane] = grey
    return shown


def followed(pairs, aside, *, has_sinus):
    """What the tracker says, pair by pair, of a ring that lies (3,) m beside its place, as a function of the pair."""
    tracker = RingTracker(CONFIG)
    tracker.initialise(pair_of(0, images(np.zeros(3), np.zeros(3), has_sinus=has_sinus)), lasso_seed())
    return [
        tracker.track(pair_of(k, images(moved(k) + aside(k), moved(k), has_sinus=has_sinus))) for k in range(1, pairs)
    ]


def wrong(results):
    """The pairs whose pose is more than 2 mm off."""
    errors = [(k, centre_error_mm(one, moved(k))) for k, one in enumerate(results, 1) if one.motion is not None]
    return [k for k, error_mm in errors if error_mm > 2.0]


def slides(k):
    return 0.5e-3 * max(k - 15, 0) * PAIR_S * ALONG


def is_put(k):
    return 0.010 * min(max(k - 9, 0) / 2.0, 1.0) * ALONG


def test_a_slide_along_the_breath_is_noticed_by_what_moves_with_the_heart():
    results = followed(36, slides, has_sinus=True)
    assert wrong(results) == []
    late = [one.reason for one in results[-3:]]
    assert all("beside it" in one or "breath" in one for one in late)
    # Not before it has slid far enough to be doubted.
    assert all(one.motion is not None for one in results[:20])


@pytest.mark.parametrize("way", [ALONG, ACROSS, (ALONG + ACROSS) / np.sqrt(2.0)])
def test_a_slide_is_silent_where_it_may_mislead_and_neither_before_nor_again_after(way):
    def slid(k):
        return 0.5e-3 * max(k - 15, 0) * PAIR_S * way

    results = followed(40, slid, has_sinus=True)
    assert wrong(results) == []
    first = next(k for k, one in enumerate(results, 1) if one.motion is None)
    # Its own past tells that it slides from 1.1 mm on; what moves with the heart tells how far.
    assert 1.5e-3 < np.linalg.norm(slid(first)) < 2.05e-3
    assert all(one.motion is None for one in results[first:])


def test_a_ring_put_aside_along_the_first_breath_is_displaced():
    results = followed(18, is_put, has_sinus=True)
    assert wrong(results) == []
    assert results[-1].state is DISPLACED


@pytest.mark.parametrize("way", [ALONG, ACROSS])
@pytest.mark.parametrize("away_mm", [4.0, 20.0])
def test_put_back_it_is_in_its_place_after_two_pairs(away_mm, way):
    # Eight seconds displaced are not held against it.
    results = followed(48, lambda k: 1e-3 * away_mm * way * (16 <= k < 40), has_sinus=True)
    assert wrong(results) == []
    assert results[30].state is DISPLACED
    assert [one.motion is not None for one in results[39:]] == [False] * 2 + [True] * 6


def test_it_says_that_the_one_or_the_other_was_moved():
    reasons = [one.reason for one in followed(30, is_put, has_sinus=True)[9:]]
    assert "it has left what moves with the heart beside it, or that was moved" in reasons


@pytest.mark.parametrize("aside", [slides, is_put])
def test_nothing_but_its_own_past_would_take_either_for_breathing(aside):
    # What the other tests are worth: without the device the poses go wrong.
    assert wrong(followed(36 if aside is slides else 18, aside, has_sinus=False))


def test_a_ring_that_stays_in_its_place_is_followed_with_it():
    results = followed(24, lambda k: np.zeros(3), has_sinus=True)
    assert all(one.motion is not None for one in results)
    assert wrong(results) == []
