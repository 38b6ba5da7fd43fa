"""How far the ring turns by itself, by turns written out."""

import numpy as np
import pytest

from lasso_motion_ros.ring.own_turn import EXPECTED_PAIRS, REMEMBERED_PAIRS, OwnTurn

EXPECTED = OwnTurn.expected(np.radians(2.5))


def about_x(degrees):
    return np.radians([degrees, 0.0, 0.0])


def test_before_it_was_seen_it_is_as_expected():
    assert np.degrees(EXPECTED.sigma_rad) == pytest.approx(2.5)
    assert EXPECTED.excess == 1.0


def test_the_expectation_counts_as_some_pairs():
    once = EXPECTED.seen(about_x(9.0), about_x(0.0))
    assert np.degrees(once.sigma_rad) == pytest.approx(
        np.sqrt((EXPECTED_PAIRS * 2.5**2 + 9.0**2 / 3.0) / (EXPECTED_PAIRS + 1.0))
    )


def test_a_ring_that_hardly_turns_is_known_to_after_some_time_and_another_one_likewise():
    still, tilting = EXPECTED, EXPECTED
    for index in range(60):
        still = still.seen(about_x(0.5 * (index % 2)), about_x(0.5 * ((index + 1) % 2)))
        tilting = tilting.seen(about_x(9.0 * (index % 2)), about_x(9.0 * ((index + 1) % 2)))
    assert np.degrees(still.sigma_rad) < 0.8
    assert still.excess == 1.0
    assert 3.2 < np.degrees(tilting.sigma_rad) < 4.2
    assert tilting.excess == pytest.approx(np.degrees(tilting.sigma_rad) / 2.5)


def test_what_is_long_past_is_forgotten():
    one = EXPECTED
    for _ in range(500):
        one = one.seen(about_x(0.0), about_x(0.0))
    assert one.pairs == REMEMBERED_PAIRS
    assert np.degrees(one.seen(about_x(6.0), about_x(0.0)).sigma_rad) == pytest.approx(
        np.sqrt(36.0 / 3.0 / REMEMBERED_PAIRS), rel=1e-3
    )


def test_a_turn_that_stays_counts_once():
    one, before = EXPECTED, about_x(0.0)
    for _ in range(12):
        one, before = one.seen(about_x(9.0), before), about_x(9.0)
    assert one.excess == 1.0
