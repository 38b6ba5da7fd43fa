"""How far the ring goes to and fro on its seat, by places of which the truth is known."""

import numpy as np
import pytest

from lasso_motion_ros.ring.seat import Seat, SeatTuning, _correlation, _log_likelihoods

TUNING = SeatTuning()
AXIS = np.array([0.0, 0.0, 1.0])
NOISE = np.diag([1e-10, 4e-10, 1e-10])


def after(places, times, noise=NOISE):
    seat = Seat.first(TUNING)
    for time_s, place in zip(times, places, strict=True):
        seat = seat.seen(time_s, place, noise, AXIS)
    return seat


def breathing(times):
    """Places of a breath with a way out beside the way in."""
    depth = 6e-3 * (1.0 - np.cos(2.0 * np.pi * times / 4.0))
    speed = np.gradient(depth, times)
    return np.stack([0.1 * depth + 1e-1 * speed * 0.5, 0.2 * depth, depth], axis=1)


def test_a_ring_that_only_breathes_is_sure_of_its_seat():
    times = np.arange(40) / 3.0
    rng = np.random.default_rng(1)
    places = breathing(times) + rng.normal(0.0, np.sqrt(NOISE.diagonal()), (40, 3))
    seat = after(places, times)
    assert np.sqrt(seat.variance) < 0.5 * np.sqrt(Seat.first(TUNING).variance)


@pytest.mark.parametrize("way", [(1.0, 0.0, 0.0), (0.6, 0.8, 0.0)])
def test_a_ring_that_goes_to_and_fro_by_half_a_millimetre_is_not(way):
    times = np.arange(40) / 3.0
    rng = np.random.default_rng(2)
    aside = 5e-4 * np.sin(2.0 * np.pi * times / 7.0)[:, None] * way
    places = breathing(times) + aside + rng.normal(0.0, np.sqrt(NOISE.diagonal()), (40, 3))
    assert np.sqrt(after(places, times).variance) > 1.2 * np.sqrt(Seat.first(TUNING).variance)


def test_a_heartbeat_is_no_seat():
    times = np.arange(40) / 3.0
    rng = np.random.default_rng(3)
    noise = np.diag([9e-8, 9e-8, 1e-10])
    places = breathing(times) + rng.normal(0.0, np.sqrt(noise.diagonal()), (40, 3))
    assert np.sqrt(after(places, times, noise).variance) < 1.2 * np.sqrt(Seat.first(TUNING).variance)


def test_a_few_places_tell_nothing():
    times = np.arange(TUNING.fewest - 1) / 3.0
    assert after(breathing(times), times).variance == Seat.first(TUNING).variance


def test_places_of_one_heartbeat_count_as_one():
    seat = Seat.first(TUNING).seen(1.0, np.zeros(3), NOISE, AXIS)
    assert seat.seen(1.0 + 0.9 * TUNING.spacing_s, np.ones(3), NOISE, AXIS) is seat


def test_no_more_places_are_kept_than_said():
    times = np.arange(60) * 0.5
    seat = after(breathing(times), times)
    assert len(seat.times_s) == len(seat.places) == len(seat.noises) == TUNING.kept
    assert seat.times_s[-1] == times[-1]


def test_covariance_grows_from_nothing_to_twice_the_variance():
    seat = Seat.first(TUNING)
    assert not seat.covariance(0.0).any()
    sizes = [seat.covariance(since_s)[0, 0] for since_s in (0.3, 1.0, 3.0, 60.0)]
    assert sizes == sorted(sizes)
    np.testing.assert_allclose(seat.covariance(60.0), 2.0 * seat.variance * np.eye(3), rtol=1e-9)
    np.testing.assert_array_equal(seat.covariance(-2.0), seat.covariance(2.0))  # the reference may be later


def test_a_ring_put_elsewhere_keeps_what_is_known_of_it_but_not_its_places():
    times = np.arange(40) / 3.0
    seat = after(breathing(times), times)
    anew = seat.anew()
    assert anew.variance == seat.variance != Seat.first(TUNING).variance
    assert len(anew.times_s) == 0


def test_likelihood_is_that_of_the_part_that_no_term_explains():
    """Against the normal density of contrasts that are orthogonal to the terms, written out."""
    rng = np.random.default_rng(4)
    times = np.sort(rng.uniform(0.0, 5.0, 7))
    sigmas, values = rng.uniform(1e-4, 3e-4, 7), rng.normal(0.0, 3e-4, 7)
    terms = np.stack([np.ones(7), times], axis=1)
    together = _correlation(np.subtract.outer(times, times), 1.5)
    variances, noises = np.array([1e-8, 9e-8]), (1.0, 2.0)
    found = _log_likelihoods(values, sigmas, terms, together, variances, noises)

    def expected(variance, noise):
        covariance = variance * together + noise * np.diag(sigmas**2)
        inverse = np.linalg.inv(covariance)
        known = terms.T @ inverse @ terms
        left = inverse - inverse @ terms @ np.linalg.solve(known, terms.T @ inverse)
        logs = np.linalg.slogdet(covariance)[1] + np.linalg.slogdet(known)[1]
        return -0.5 * (logs + values @ left @ values)

    direct = np.array([[expected(v, n) for n in noises] for v in variances])
    # A restricted likelihood is known up to what does not depend on the covariance (Harville, Biometrika 61, 1974).
    np.testing.assert_allclose(found - found[0, 0], direct - direct[0, 0], rtol=1e-9)
