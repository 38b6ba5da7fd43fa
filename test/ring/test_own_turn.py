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


STRAIGHT = np.zeros(3)


def after(degrees):
    """Turns about x in turn, as it belongs being straight."""
    one = EXPECTED
    for turn in degrees:
        one = one.seen(about_x(turn), STRAIGHT)
    return one


def test_the_expectation_counts_as_some_pairs():
    expected = np.sqrt((EXPECTED_PAIRS * 2.5**2 + 9.0**2 / 3.0) / (EXPECTED_PAIRS + 1.0))
    assert np.degrees(after([9.0]).sigma_rad) == pytest.approx(expected)


def test_a_ring_that_hardly_turns_is_known_to_after_some_time_and_another_one_likewise():
    still, tilting = after([0.5, 0.0] * 30), after([9.0, 0.0] * 30)
    assert np.degrees(still.sigma_rad) < 0.8
    assert still.excess == 1.0
    assert 3.2 < np.degrees(tilting.sigma_rad) < 5.3
    assert tilting.excess == pytest.approx(np.degrees(tilting.sigma_rad) / 2.5)


def test_what_is_long_past_is_forgotten():
    one = after([0.0] * 500)
    assert one.pairs == REMEMBERED_PAIRS
    expected = np.sqrt(36.0 / 3.0 / REMEMBERED_PAIRS)
    assert np.degrees(one.seen(about_x(6.0), STRAIGHT).sigma_rad) == pytest.approx(expected, rel=1e-3)


def test_a_turn_that_stays_counts_once():
    assert after([9.0] * 12).excess == 1.0
    assert after([0.3] * 19 + [25.0] * 30).excess < 1.2


def test_it_counts_from_how_the_ring_belongs():
    one = EXPECTED
    for turn in (12.0, 11.0, 12.0, 11.0) * 6:
        one = one.seen(about_x(turn), about_x(11.5))
    assert np.degrees(one.sigma_rad) < 1.3


def test_a_turn_speaks_of_a_hand_the_more_the_further_it_is_and_never_against_one():
    def odds(turned_deg, of=EXPECTED):
        return of.log_odds_of_a_hand(about_x(turned_deg), STRAIGHT)

    assert [odds(0.0), odds(3.2)] == [0.0, 0.0]
    assert odds(5.0) == pytest.approx(2.6 * (2.0 - 1.3))
    assert odds(20.0) == 4.5  # what is seen there may be a loop that was taken the wrong way round
    # A ring that turns by itself twice as far has to be turned twice as far.
    lively = OwnTurn(np.radians(2.5), np.radians(5.0) ** 2)
    assert odds(10.0, lively) == pytest.approx(odds(5.0))


def test_a_turn_that_stays_speaks_of_a_hand_once():
    turned = EXPECTED.seen(about_x(9.0), STRAIGHT)
    assert turned.log_odds_of_a_hand(about_x(9.0), STRAIGHT) == 0.0
    assert EXPECTED.log_odds_of_a_hand(about_x(9.0), STRAIGHT) == 4.5
    # Back where it belongs: nothing.
    assert turned.log_odds_of_a_hand(about_x(0.5), STRAIGHT) == 0.0
