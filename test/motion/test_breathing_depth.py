"""Depth of a ring that one plane alone shows, by how it has breathed while both did."""

import math

import numpy as np
import pytest

from lasso_motion_ros.motion.breathing_depth import BreathingDepth, DepthTuning
from lasso_motion_ros.motion.motion_model import Estimate

RAY = np.array([0.0, 1.0, 0.0])
WAY = np.array([0.0, -0.3, -1.0]) / math.hypot(0.3, 1.0)
STILL = np.zeros((3, 3))  # a heart that does not beat, or a place that is known
FLAT = np.eye(3) - np.outer(RAY, RAY)


def breath(time_s: float, hysteresis_m: float = 0.002, period_s: float = 4.0) -> np.ndarray:
    """(3,) m: 12 mm along the way, and beside it on the way back, along the ray."""
    u = time_s / period_s
    along = 0.012 * math.sin(math.pi * u) ** 4
    beside = hysteresis_m * math.sin(2.0 * math.pi * u) * math.sin(math.pi * u) ** 2
    return along * WAY + beside * RAY


def watched(until_s: float, rate_hz: float = 3.0, tuning: DepthTuning | None = None, **breathing: float):
    depth = BreathingDepth.first(0.0, np.zeros(3), tuning)
    for time_s in np.arange(1, round(until_s * rate_hz) + 1) / rate_hz:
        depth = depth.seen(float(time_s), Estimate(breath(time_s, **breathing), STILL))
    return depth


def alone_for(depth: BreathingDepth, start_s: float, pairs: int, rate_hz: float = 3.0, **breathing: float):
    """Errors along the ray and their standard deviations, mm, of pairs that show nothing of the depth."""
    errors, sigmas = [], []
    for time_s in start_s + np.arange(1, pairs + 1) / rate_hz:
        true = breath(time_s, **breathing)
        told = depth.with_depth(time_s, Estimate(FLAT @ true + 0.05 * RAY, STILL), RAY, WAY, STILL)
        depth = depth.passed(time_s, told.displacement)
        errors.append(1e3 * RAY @ (told.displacement - true))
        sigmas.append(1e3 * math.sqrt(RAY @ told.covariance @ RAY))
        np.testing.assert_allclose(FLAT @ told.displacement, FLAT @ true, atol=1e-12)
    return np.array(errors), np.array(sigmas)


def test_depth_follows_a_breath_that_goes_out_beside_the_way_it_went_in():
    errors, sigmas = alone_for(watched(8.0), 8.0, 60)  # for 20 s
    # Depth goes through 3.4 mm with the breath, and by 2 mm to either side of that with its speed.
    assert np.sqrt(np.mean(errors**2)) < 0.35
    assert np.all(np.abs(errors) < 3.0 * sigmas)
    assert sigmas.max() < 0.8


def test_without_its_speed_it_would_be_twice_as_far_off():
    with_it, _ = alone_for(watched(8.0), 8.0, 60)
    without, sigmas = alone_for(watched(8.0, tuning=DepthTuning(speed_s=1e-9)), 8.0, 60)
    assert np.mean(without**2) > 4.0 * np.mean(with_it**2)
    # That is known: what the function leaves over is larger then.
    assert np.mean(np.abs(without) < 2.0 * sigmas) > 0.9


def one_size(size: float, **others: float) -> DepthTuning:
    return DepthTuning(sizes=((size, 1.0),), **others)


def test_where_nothing_but_the_seed_was_seen_depth_is_what_was_expected_before():
    tuning = one_size(2.0)
    depth = BreathingDepth.first(0.0, np.zeros(3), tuning)
    at = np.array([0.003, 0.07, -0.010])  # across the ray 10 mm along the breath, 3 mm beside it; no depth
    told = depth.with_depth(2.0, Estimate(at, STILL), RAY, WAY, STILL)  # no speed is known
    np.testing.assert_allclose(told.displacement, FLAT @ at, atol=1e-12)
    # Of the seed's depth, which is zero: 1 mm of the mean and what is left, of which a part lasts.
    left = 2.0**2 * (0.25**2 + 0.3**2)
    seed, lasting = 1.0 + left, 1.0 + 2.0**2 * 0.25**2 * math.exp(-0.2)
    slopes = 0.6**2 * (10.0**2 + 3.0**2) + (20.0 * 0.010**2 * 1e3) ** 2
    expected = 1.0 + slopes + left - lasting**2 / seed + 1.0  # and 0.1 s at 10 mm/s, whose speed is not known
    assert 1e6 * RAY @ told.covariance @ RAY == pytest.approx(expected, rel=1e-9)


def test_it_is_the_normal_distribution_of_the_depth_given_those_of_the_places():
    """By conditioning the joint distribution of coefficients and depths, instead of the depths' alone."""
    tuning, random = one_size(1.0, common_share=0.3), np.random.default_rng(5)
    times, places = np.arange(5) * 0.5, random.normal(0.0, 0.004, (5, 3))
    covariances = [random.uniform(0.1e-3, 0.4e-3) ** 2 * np.eye(3) for _ in times]
    depth = BreathingDepth.first(0.0, places[0], tuning)
    for time_s, place, covariance in zip(times[1:], places[1:], covariances[1:], strict=True):
        depth = depth.seen(float(time_s), Estimate(place, covariance))
    beat = 0.2e-3
    now, here = 2.5, np.array([0.002, 0.0, -0.003])
    told = depth.with_depth(now, Estimate(here, STILL), RAY, WAY, beat**2 * np.eye(3))

    def terms(off, speed):
        return [1.0, -off[2], off[0], speed, off[2] ** 2]  # the breath goes down; x is across that and the ray

    middle = places.mean(axis=0)
    speeds = [0.0, *(-(places[1:] - places[:-1]) @ [0.0, 0.0, 1.0] / 0.5)]
    matrix = np.array([terms(p - middle, s) for p, s in zip(places, speeds, strict=True)])
    last = np.array(terms(here - middle, -(here - places[-1])[2] / 0.5))
    every = np.vstack([matrix, last])
    prior = np.square([0.001, 0.6, 0.6, 0.1, 20.0])
    at = np.append(times, now)
    own = np.array([0.0, *(c[1, 1] for c in covariances[1:]), 0.0])
    joint = every @ np.diag(prior) @ every.T + 0.25e-3**2 * np.exp(-np.abs(at[:, None] - at) / 10.0)
    joint += (0.3e-3**2 + beat**2) * np.eye(6) + 0.3 * np.sqrt(np.outer(own, own)) + 0.7 * np.diag(own)
    gain = np.linalg.solve(joint[:5, :5], joint[:5, 5])
    mean = middle[1] + gain @ (places[:, 1] - middle[1])
    assert told.displacement[1] == pytest.approx(mean, abs=1e-12)
    assert told.covariance[1, 1] == pytest.approx(joint[5, 5] - gain @ joint[:5, 5], rel=1e-9)


@pytest.mark.parametrize("noise_m", [1e-4, 1e-3, 4e-3])
def test_what_it_does_not_tell_is_learned_from_what_is_left_over(noise_m):
    random, squares, sigmas = np.random.default_rng(8), [], []
    for trial in range(60):
        depth, last = BreathingDepth.first(0.0, np.zeros(3)), 24 + trial % 12
        for pair in range(1, last):
            place = breath(pair / 3.0) + random.normal(0.0, noise_m) * RAY
            depth = depth.seen(pair / 3.0, Estimate(place, STILL))
        true = breath(last / 3.0) + random.normal(0.0, noise_m) * RAY
        told = depth.with_depth(last / 3.0, Estimate(FLAT @ true, STILL), RAY, WAY, STILL)
        variance = RAY @ told.covariance @ RAY
        squares.append((RAY @ (told.displacement - true)) ** 2 / variance)
        sigmas.append(math.sqrt(variance))
    assert np.mean(squares) < 1.5
    assert np.mean(sigmas) < max(1.5 * noise_m, 5e-4)


def test_of_a_speed_that_is_not_known_depth_is_vaguer():
    depth, true = watched(8.0), breath(9.3)
    known = depth.passed(9.0, breath(9.0)).with_depth(9.3, Estimate(FLAT @ true, STILL), RAY, WAY, STILL)
    unknown = depth.with_depth(9.3, Estimate(FLAT @ true, STILL), RAY, WAY, STILL)
    assert RAY @ unknown.covariance @ RAY > 4.0 * RAY @ known.covariance @ RAY
    assert abs(RAY @ (unknown.displacement - true)) < 2.0 * math.sqrt(RAY @ unknown.covariance @ RAY)


def test_where_no_speed_was_seen_that_it_is_not_known_counts_as_usual():
    still = BreathingDepth.first(0.0, np.zeros(3))
    for time_s in (1.0, 2.0, 3.0, 4.0):  # too far apart to tell one
        still = still.seen(time_s, Estimate(np.zeros(3), STILL))
    told = still.with_depth(5.0, Estimate(np.zeros(3), STILL), RAY, WAY, STILL)
    # A second of depth per metre a second is expected to be 0.1, and 10 mm/s are usual.
    assert 1e3 * math.sqrt(RAY @ told.covariance @ RAY) > 1.0


def test_a_strong_heart_and_a_vague_sight_make_it_vaguer():
    true = breath(8.3)
    depth = watched(8.0)
    sure = depth.with_depth(8.3, Estimate(FLAT @ true, STILL), RAY, WAY, STILL).covariance
    beating = depth.with_depth(8.3, Estimate(FLAT @ true, STILL), RAY, WAY, 0.001**2 * np.eye(3)).covariance
    assert RAY @ (beating - sure) @ RAY > 0.001**2
    vague = depth.with_depth(8.3, Estimate(FLAT @ true, 0.002**2 * np.eye(3)), RAY, WAY, STILL).covariance
    # 0.3 mm of depth go with a millimetre along the breath.
    assert 1e3 * math.sqrt(RAY @ (vague - sure) @ RAY) == pytest.approx(0.6, rel=0.35)
    np.testing.assert_allclose(FLAT @ vague @ FLAT, 0.002**2 * FLAT, atol=1e-12)


def test_a_breath_along_the_ray_is_not_foretold_from_what_it_hardly_moves_across():
    depth = BreathingDepth.first(0.0, np.zeros(3))
    random = np.random.default_rng(2)
    for time_s in np.arange(1, 25) / 3.0:
        place = 0.012 * math.sin(math.pi * time_s / 4.0) ** 2 * RAY + FLAT @ random.normal(0.0, 5e-5, 3)
        depth = depth.seen(time_s, Estimate(place, STILL))
    told = depth.with_depth(9.0, Estimate(np.zeros(3), STILL), RAY, RAY, STILL)
    # It goes through 12 mm, and is anywhere there.
    assert 1e3 * math.sqrt(told.covariance[1, 1]) > 3.0
    assert np.all(np.isfinite(told.displacement))


def test_places_of_one_heartbeat_count_as_one_and_old_ones_are_forgotten():
    depth = BreathingDepth.first(0.0, np.zeros(3))
    for time_s in np.arange(1, 1000) / 15.0:
        depth = depth.seen(time_s, Estimate(breath(time_s), STILL))
    assert len(depth.times_s) == len(depth.places) == len(depth.velocities) == depth.tuning.kept
    assert np.diff(depth.times_s).min() >= depth.tuning.spacing_s
    # What goes on after a pause has no known speed.
    assert np.all(depth.seen(80.0, Estimate(np.zeros(3), STILL)).velocities[-1] == 0.0)


def test_put_elsewhere_it_breathes_there_as_it_did():
    away = np.array([0.010, -0.008, 0.004])
    depth, true = watched(8.0).moved(away, STILL), breath(8.3) + away
    told = depth.with_depth(8.3, Estimate(FLAT @ true, STILL), RAY, WAY, STILL)
    assert 1e3 * abs(RAY @ (told.displacement - true)) < 0.35


@pytest.mark.parametrize("phase_s", [8.4, 9.4, 10.0, 10.7, 11.4])
def test_put_elsewhere_by_a_shift_that_is_hardly_known_its_depth_is_where_it_was_seen_last(phase_s):
    # By three millimetres of the breath and of what lies beside it: what was foretold of it was only a mean.
    away, off = np.array([0.010, -0.008, 0.004]), 0.003 * WAY + 0.0015 * RAY
    depth = watched(8.0).moved(away + off, 0.003**2 * np.eye(3)).passed(phase_s - 1 / 3, breath(phase_s - 1 / 3) + away)
    depth = depth.seen(phase_s, Estimate(breath(phase_s) + away, STILL))
    errors, sigmas = [], []
    for later in np.arange(1, 13) / 3.0:
        true = breath(phase_s + later) + away
        told = depth.with_depth(phase_s + later, Estimate(FLAT @ true, STILL), RAY, WAY, STILL)
        depth = depth.passed(phase_s + later, told.displacement)
        errors.append(RAY @ (told.displacement - true))
        sigmas.append(math.sqrt(RAY @ told.covariance @ RAY))
    assert 1e3 * np.abs(errors).max() < 1.0
    assert np.all(np.abs(errors) < 3.0 * np.array(sigmas))
