"""What is expected of the ring's motion, and what is learned of its directions."""

from dataclasses import replace

import numpy as np
import pytest
from support.respiration_inputs import AMPLITUDE_M, DIRECTION, INTERVAL_S, RISE, breathing, run

from lasso_motion_ros.motion import matern, oscillator
from lasso_motion_ros.motion.motion_model import (
    AT_A,
    SIZE,
    TUNING,
    displacement_at,
    first_states,
    measured,
)
from lasso_motion_ros.motion.respiration import RespiratoryMotion

DISPLACEMENT = displacement_at(None)
SHAPE = np.array([[0.16, 0.0, 0.0], [0.0, 0.3, 0.25], [0.0, 0.25, 1.0]])


def test_far_ahead_only_the_spread_is_known():
    motion, _, _ = run(30, 0.0)
    far = motion.predict(1000.0)
    times = np.arange(0, 31) * INTERVAL_S
    seen = np.array([breathing(t) for t in times])
    # Where it has been, on the average, give or take as much as it has moved.
    assert 1e3 * np.linalg.norm(far.displacement - seen.mean(axis=0)) < 4.0
    size = np.sqrt(DIRECTION @ far.covariance @ DIRECTION)
    assert 0.5 * AMPLITUDE_M / np.sqrt(2.0) < size < 3.0 * AMPLITUDE_M / np.sqrt(2.0)


def test_the_spread_is_learned_along_the_motion():
    motion, _, _ = run(30, 0.0)
    values, axes = np.linalg.eigh(motion.spread)
    assert abs(axes[:, -1] @ DIRECTION) > 0.99
    # A sinusoid of 12 mm has a standard deviation of 4.2 mm.
    assert 1e3 * np.sqrt(values[-1]) == pytest.approx(12.0 / np.sqrt(8.0), rel=0.3)
    assert 1e3 * np.sqrt(values[0]) < 1.5
    times = np.arange(0, 31) * INTERVAL_S  # the reference's zero counts, too
    np.testing.assert_allclose(motion.mean, np.mean([breathing(t) for t in times], axis=0), atol=5e-5)


def test_at_the_seed_position_heartbeat_and_mean_add_up_to_zero():
    """By the formula for a measurement, of what breathing, heart and mean may be each by itself."""
    heart = TUNING.hearts(0.1).covariances[[0, 3, 50, 195]]
    expected = np.zeros((SIZE, SIZE, 4))
    expected[:9, :9] = np.kron(matern.stationary(TUNING.time_scale_s), 1e-4 * SHAPE)[..., None]
    beat = oscillator.stationary(TUNING.heartbeat_damping_per_s, TUNING.heartbeat_turning_rad_s)
    expected[9:15, 9:15] = np.stack([np.kron(beat, one) for one in heart], axis=-1)
    expected[15:18, 15:18] = 1e-4 * SHAPE[..., None]
    _, expected, _, _ = measured(np.zeros((SIZE, 4)), expected, DISPLACEMENT, np.zeros(3), 1e-14 * np.eye(3))
    expected[AT_A, AT_A] = 1e-14 * np.eye(3)[..., None]
    state, found = first_states(1e-4 * SHAPE, heart, TUNING)
    assert not state.any()
    np.testing.assert_allclose(found, expected, rtol=1e-9, atol=1e-16)
    found = np.moveaxis(found, -1, 0)
    np.testing.assert_allclose(DISPLACEMENT @ found @ DISPLACEMENT.T, np.broadcast_to(0.0, (4, 3, 3)), atol=2e-14)


def test_before_anything_is_learned_every_direction_is_open():
    values = np.linalg.eigvalsh(RespiratoryMotion(0.0, 0.0).spread)
    assert values[0] == pytest.approx(values[-1])
    assert 0.005 < np.sqrt(values[0]) < 0.02


@pytest.mark.parametrize("scale_s", [0.03, 1.0])
def test_whatever_the_time_scale_the_future_has_a_positive_covariance(scale_s):
    motion = RespiratoryMotion(0.0, 0.05, tuning=replace(TUNING, time_scale_s=scale_s))
    for interval_s in (0.01, 0.07, 0.13):
        covariance = motion.predict(0.05 + interval_s).covariance
        assert np.linalg.eigvalsh(covariance).min() > 0.0
        assert np.sqrt(np.trace(covariance)) < 0.03


def test_what_is_seen_along_the_body_tells_the_depth_before_any_breath():
    # Of a still heart: what a heartbeat may have risen tells no depth, and takes a sixth of it.
    beating = RespiratoryMotion(0.0, 0.15, shape=SHAPE, between=RISE).origin_b
    assert 0.7e-3 < beating.displacement[1] < 0.95e-3
    still = replace(TUNING, heartbeats_any_way=((1e-4, 1.0),), heartbeats_one_way=())
    told = RespiratoryMotion(0.0, 0.15, shape=SHAPE, between=RISE, tuning=still).origin_b
    np.testing.assert_allclose(told.displacement, [0.0, 0.001, 0.004], atol=1e-4)
    untold = RespiratoryMotion(0.0, 0.15, shape=SHAPE, tuning=still).origin_b
    assert told.covariance[2, 2] < 1e-9 < untold.covariance[2, 2]
    # Of 4 mm along the body a quarter, give or take what the shape leaves open.
    open_share = np.sqrt((0.3 - 0.25**2) / 0.3)
    assert np.sqrt(told.covariance[1, 1] / untold.covariance[1, 1]) == pytest.approx(open_share, rel=0.05)


def test_a_direction_that_has_been_seen_outweighs_the_one_expected():
    expected = np.array([0.0, -0.26, -1.0])
    motion = RespiratoryMotion(0.0, 0.0, shape=np.outer(expected, expected) + 0.05 * np.eye(3))
    other = np.array([0.0, 1.0, -1.0]) / np.sqrt(2.0)
    for millimetres in (2.0, 5.0, 9.0, 12.0, 8.0, 3.0):
        motion.learn(1e-3 * millimetres * other)
    main = np.linalg.eigh(motion.spread)[1][:, -1]
    assert abs(main @ other) > 0.99


@pytest.mark.parametrize("noise_m", [1e-7, 3e-5, 1e-2])  # defined to be, measured, hardly known
def test_a_measurement_is_taken_in_by_josephs_form(noise_m):
    random = np.random.default_rng(4)
    factors = 0.01 * random.normal(size=(3, SIZE, SIZE))
    states, covariances = random.normal(size=(3, SIZE)), factors @ factors.swapaxes(-1, -2)
    h, value, noise = random.normal(size=(2, 3)) @ DISPLACEMENT, random.normal(size=2), noise_m**2 * np.eye(2)
    measurement = h, value, noise
    found_states, found, distance, peak = measured(states.T, np.moveaxis(covariances, 0, -1), *measurement)
    for i, (state, covariance) in enumerate(zip(states, covariances, strict=True)):
        expected = h @ covariance @ h.T + noise
        gain = covariance @ h.T @ np.linalg.inv(expected)
        keep = np.eye(SIZE) - gain @ h
        plain = keep @ covariance @ keep.T + gain @ noise @ gain.T
        innovation = value - h @ state
        np.testing.assert_allclose(found_states[:, i], state + gain @ innovation, rtol=1e-9)
        np.testing.assert_allclose(found[..., i], plain, atol=1e-12 * np.abs(covariances).max())
        assert distance[i] == pytest.approx(innovation @ np.linalg.inv(expected) @ innovation, rel=1e-9)
        density = -0.5 * (np.linalg.slogdet(expected)[1] + 2.0 * np.log(2.0 * np.pi))
        assert peak[i] == pytest.approx(density, rel=1e-9)
