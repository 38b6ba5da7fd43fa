"""Probabilities of in place, elsewhere and absent: how they change from pair to pair, and with time alone."""

import dataclasses
import math

import numpy as np
import pytest

from lasso_motion_ros.ring.track_state import StateTuning, TrackBelief

TUNING = StateTuning()
PAIR_S = 1.0 / 3.0
SEEN, UNSEEN = 0.9999, 0.0001


def after(belief, *pairs, interval_s=PAIR_S):
    """The belief after pairs of (probability that the ring is seen, standard deviations off its breathing)."""
    for seen, sigmas in pairs:
        belief = belief.after(interval_s, seen, sigmas, TUNING)
    return belief


def is_displaced(belief):
    return belief.elsewhere > TUNING.displaced


def has_pose(belief):
    return belief.in_place >= TUNING.pose


def test_what_moves_with_the_heart_beside_it_speaks_against_it_only():
    def asked(companions, pairs=1):
        belief = TrackBelief()
        for _ in range(pairs):
            belief = belief.after(PAIR_S, SEEN, 1.0, TUNING, companions)
        return belief

    assert asked(8.0) == asked(0.0)
    assert has_pose(asked(-2.0))
    assert not has_pose(asked(-9.0))  # one pair in which both planes' companions are elsewhere will do
    assert is_displaced(asked(-9.0, pairs=2))
    assert is_displaced(asked(-6.0, pairs=6))


def test_a_turned_ring_is_displaced_only_where_it_is_off_its_breathing_too():
    def asked(sigmas, turned, pairs):
        belief = TrackBelief()
        for _ in range(pairs):
            belief = belief.after(PAIR_S, SEEN, sigmas, TUNING, turned=turned)
        return belief

    assert has_pose(asked(1.0, 4.5, pairs=20))
    assert has_pose(asked(2.5, 0.0, pairs=20))
    assert is_displaced(asked(2.5, 4.5, pairs=3))


def test_before_a_breath_is_known_a_surprise_tells_of_a_hand_once_the_heart_had_time_for_a_beat():
    beat_s = TUNING.longest_beat_s
    assert TUNING.surprise(beat_s + 0.1, is_complete=False) == TUNING.first_surprise_sigmas
    assert TUNING.surprise(beat_s - 0.1, is_complete=False) == TUNING.surprise_sigmas
    assert TUNING.surprise(beat_s + 0.1, is_complete=True) == TUNING.surprise_sigmas


def test_probabilities_sum_to_one_whatever_comes():
    random = np.random.default_rng(1)
    belief = TrackBelief()
    for _ in range(200):
        belief = belief.after(random.uniform(0.01, 5.0), random.uniform(), random.exponential(3.0), TUNING)
        assert belief.in_place + belief.elsewhere + belief.absent == pytest.approx(1.0)
        assert belief.in_place + belief.hidden + belief.away == pytest.approx(1.0)
        assert min(dataclasses.astuple(belief)) >= 0.0


def test_the_chances_of_a_change_by_hand():
    # As likely in place as elsewhere, and half a chance of not being seen: images say nothing, time alone acts.
    tuning = StateTuning(
        leaves_per_s=0.1, returns_per_s=0.2, vanishes_per_s=0.05, appears_per_s=0.4, elsewhere_sigmas=0.0
    )
    leaves, returns, vanishes, appears = (1.0 - math.exp(-2.0 * rate) for rate in (0.1, 0.2, 0.05, 0.4))

    def by_time(belief):
        return dataclasses.astuple(belief.after(2.0, 0.5, 0.0, tuning))

    stays, comes = 1.0 - leaves, 1.0 - returns
    seen = by_time(TrackBelief(1.0, 0.0))
    assert seen == pytest.approx((1.0 - leaves - vanishes, leaves, stays * vanishes, leaves * vanishes))
    aside = by_time(TrackBelief(0.0, 1.0))
    assert aside == pytest.approx((returns, 1.0 - returns - vanishes, returns * vanishes, comes * vanishes))
    gone = 1.0 - appears
    hidden = by_time(TrackBelief(0.0, 0.0, 1.0))
    assert hidden == pytest.approx((0.8 * appears, 0.2 * appears, stays * gone, leaves * gone))
    hidden_aside = by_time(TrackBelief(0.0, 0.0, 0.0, 1.0))
    assert hidden_aside == pytest.approx((0.03 * appears, 0.97 * appears, returns * gone, comes * gone))


def test_what_the_images_say_by_hand():
    # Ten to one for being seen, at the distance at which both places are as likely: only the prior tells them apart.
    still = StateTuning(leaves_per_s=0.0, returns_per_s=0.0, vanishes_per_s=0.0, appears_per_s=0.0)
    belief = TrackBelief(0.6, 0.3, 0.1).after(1.0, 10.0 / 11.0, still.elsewhere_sigmas, still)
    assert dataclasses.astuple(belief) == pytest.approx(np.array([6.0, 3.0, 0.1, 0.0]) / 9.1, abs=1e-4)
    # On the curve: exp(½ 3.3²) = 231 times as likely in place.
    belief = TrackBelief(0.5, 0.5, 0.0).after(1.0, SEEN, 0.0, still)
    assert belief.in_place / belief.elsewhere == pytest.approx(math.exp(0.5 * still.elsewhere_sigmas**2), rel=1e-3)


def test_in_its_place_it_stays():
    random = np.random.default_rng(2)
    belief = TrackBelief()
    for _ in range(1000):
        belief = after(belief, (SEEN, abs(random.normal())))
        assert belief.in_place > TUNING.tracking


def test_one_outlier_does_not_displace():
    for sigmas in (3.5, 4.0):
        belief = after(TrackBelief(), (SEEN, sigmas))
        assert not is_displaced(belief)
        assert after(belief, (SEEN, 0.5), (SEEN, 0.5)).in_place > TUNING.tracking


@pytest.mark.parametrize("sigmas", [4.0, 5.0, 8.0])
def test_what_stays_off_its_curve_is_displaced_within_three_pairs(sigmas):
    belief = after(TrackBelief(), *[(SEEN, sigmas)] * 3)
    assert is_displaced(belief)
    assert not has_pose(belief)


def test_no_one_pair_may_say_more_than_its_limit():
    far, farther = (after(TrackBelief(), (SEEN, sigmas)) for sigmas in (TUNING.largest_sigmas, 40.0))
    assert dataclasses.astuple(far) == dataclasses.astuple(farther)


@pytest.mark.parametrize("interval_s", [1.0 / 15.0, 1.0 / 3.0])
def test_displaced_it_takes_two_pairs_to_come_back(interval_s):
    belief = after(TrackBelief(), *[(SEEN, 8.0)] * 10, interval_s=interval_s)
    first = after(belief, (SEEN, 0.3), interval_s=interval_s)
    assert not has_pose(first)
    second = after(first, (SEEN, 0.3), interval_s=interval_s)
    assert second.in_place > TUNING.tracking


def test_out_of_view_it_is_neither_here_nor_there():
    belief = after(TrackBelief(), (UNSEEN, 0.0))
    assert belief.absent > 0.9
    assert not has_pose(belief)
    gone = after(belief, *[(UNSEEN, 0.0)] * 30)
    assert gone.absent > 0.99
    # Seen again where it belongs it is in its place; 25 mm away it was moved.
    assert after(gone, (SEEN, 0.3)).in_place > TUNING.tracking
    assert is_displaced(after(gone, (SEEN, 8.0)))


def test_what_was_elsewhere_when_it_vanished_is_expected_there():
    vanished = after(TrackBelief(), *[(SEEN, 8.0)] * 3, *[(UNSEEN, 0.0)] * 5)
    assert vanished.absent > 0.99
    assert vanished.away > 0.9
    # Neither here nor there, it is where it was; and that it is back takes two looks, as if it had been seen all along.
    assert is_displaced(after(vanished, (SEEN, 2.8)))
    assert not has_pose(after(vanished, (SEEN, 0.3)))
    assert after(vanished, (SEEN, 0.3), (SEEN, 0.3)).in_place > TUNING.tracking


def test_a_place_that_is_hardly_the_ring_moves_no_belief():
    # Of 60 % nothing follows: neither that it was displaced, nor that it returned.
    belief = after(TrackBelief(), *[(0.6, 8.0)] * 1)
    assert belief.in_place < TUNING.pose
    assert after(TrackBelief(0.0, 1.0, 0.0), (0.6, 0.3)).in_place < TUNING.tracking


def test_the_longer_nobody_looked_the_less_is_sure():
    spans = [after(TrackBelief(0.0, 1.0, 0.0), (SEEN, 2.0), interval_s=span).in_place for span in (0.1, 1.0, 10.0)]
    assert spans == sorted(spans)
    assert spans[0] < 0.5 < spans[2]
