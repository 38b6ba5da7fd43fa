"""The filter in time where R peaks tell when the heart beats."""

from dataclasses import replace

import numpy as np
import pytest
from support.respiration_inputs import INTERVAL_S, breathing, observation

from lasso_motion_ros.core.compiled import has_kernels, plain
from lasso_motion_ros.motion.heartbeat import Beats
from lasso_motion_ros.motion.motion_model import (
    BEAT_SHAPE,
    SIZE,
    SIZE_WITH_BEATS,
    TUNING,
    displacement_at,
    first_states,
    since_b_at,
)
from lasso_motion_ros.motion.respiration import RespiratoryMotion

WAY = np.array([0.6, -0.64, 0.48])
LATE_S = 0.15
FEW = replace(TUNING, heartbeat_ways=6)


def contraction(phase):
    return np.sin(np.pi * phase / 0.45) ** 2 if phase < 0.45 else 0.0


def beating(with_peaks, pairs=40, late_s=LATE_S, heart_m=3.5e-3, seed=0, tuning=TUNING, lost_after=None):
    """The motion, the error of each pair in metres, and squared in units of the covariance; beats vary by a tenth."""
    random = np.random.default_rng(seed)
    ends_s = pairs * INTERVAL_S + 2.0
    peaks_s = -3.0 + np.cumsum(random.normal(0.83, 0.08, size=int(ends_s / 0.6) + 6))
    every = Beats.of(peaks_s)

    def known(time_s):
        if not with_peaks or (lost_after is not None and time_s > lost_after):
            time_s = -np.inf if not with_peaks else lost_after
        return Beats.of([peak for peak in peaks_s if peak <= time_s])

    def heart(time_s):
        return heart_m * contraction(every.phase(time_s)) * WAY

    motion = RespiratoryMotion(0.0, late_s, beats=known(late_s), tuning=tuning)
    errors, normalised = [], []
    for index in range(1, pairs + 1):
        time_s = index * INTERVAL_S
        now = breathing(time_s) + heart(time_s) - heart(0.0)
        later = breathing(time_s + late_s) - breathing(late_s) + heart(time_s + late_s) - heart(late_s)
        motion = motion.hearing(known(time_s + late_s))
        motion.observe(time_s, a=observation("a", now, random))
        motion.observe(time_s + late_s, b=observation("b", later, random))
        error = motion.at_a.displacement - now
        errors.append(np.linalg.norm(error))
        normalised.append(error @ np.linalg.solve(motion.at_a.covariance, error))
        motion.learn(motion.at_a.displacement)
    return motion, np.array(errors), np.array(normalised)


def test_with_r_peaks_a_strong_heart_puts_depth_off_by_less():
    with_peaks, without = (np.concatenate([beating(told, seed=s)[1][10:] for s in range(4)]) for told in (True, False))
    assert with_peaks.mean() < 0.75 * without.mean()


def test_its_errors_lie_within_the_covariance():
    normalised = np.concatenate([beating(True, seed=seed)[2] for seed in range(4)])
    assert np.mean(normalised < 7.81) > 0.88  # 95 % of three degrees of freedom


def test_what_the_heart_does_in_its_beat_is_learned():
    motion, _, _ = beating(True)
    state = motion._state @ motion.weights
    waves = [displacement_at(phase)[:, BEAT_SHAPE] @ state[BEAT_SHAPE] for phase in (0.225, 0.725)]
    np.testing.assert_allclose(waves[0] - waves[1], 3.5e-3 * WAY, atol=0.9e-3)


@pytest.mark.skipif(not has_kernels(), reason="the extra `fast` is not installed")
def test_compiled_and_plain_it_is_followed_alike():
    compiled = beating(True, pairs=12, tuning=FEW)[0].at_a
    with plain():
        plainly = beating(True, pairs=12, tuning=FEW)[0].at_a
    np.testing.assert_allclose(compiled.displacement, plainly.displacement, atol=1e-10)
    np.testing.assert_allclose(compiled.covariance, plainly.covariance, rtol=1e-6, atol=1e-15)


def test_at_the_seed_the_displacement_is_zero_at_any_phase():
    hearts = TUNING.hearts(LATE_S).covariances[:5]
    for phase in (0.0, 0.3, 0.9):
        state, covariance = first_states(1e-4 * np.eye(3), hearts, TUNING, phase)
        assert state.shape == (SIZE_WITH_BEATS, 5)
        assert not state.any()
        covariance, displacement = np.moveaxis(covariance, -1, 0), displacement_at(phase)
        np.testing.assert_allclose(displacement @ covariance @ displacement.T, np.zeros((5, 3, 3)), atol=2e-14)
        # Half a beat later it has moved, by twice what cosine and sine of odd harmonics have of the beat's variance.
        later = displacement_at((phase + 0.5) % 1.0)[:, BEAT_SHAPE] @ covariance[:, BEAT_SHAPE, BEAT_SHAPE]
        assert (np.trace(later @ displacement_at((phase + 0.5) % 1.0)[:, BEAT_SHAPE].T, axis1=1, axis2=2) > 0).all()


def test_a_phase_by_hand():
    at_half = displacement_at(0.5)
    assert at_half.shape == (3, SIZE_WITH_BEATS)
    # cos π, sin π, cos 2π, sin 2π, cos 3π, sin 3π
    np.testing.assert_allclose(at_half[0, BEAT_SHAPE][::3], [-1.0, 0.0, 1.0, 0.0, -1.0, 0.0], atol=1e-15)
    np.testing.assert_array_equal(at_half[:, :SIZE], displacement_at(None))
    np.testing.assert_array_equal(since_b_at(0.5)[:, 18:21], -np.eye(3))


def test_where_the_ecg_is_lost_the_heart_is_as_strong_as_it_was_learned_to_be():
    told, _, _ = beating(True, tuning=FEW)
    never, _, _ = beating(False, tuning=FEW)
    # 3.5 mm of sin² through 0.45 of the beat have a variance of 0.118 · 3.5² mm² over the beat.
    assert np.trace(told.heartbeat) == pytest.approx(0.118 * 3.5e-3**2, rel=0.35)
    lost = told.hearing(None)
    assert lost.beats is None
    assert told.beats is not None
    assert len(lost._state) == SIZE
    np.testing.assert_allclose(lost.at_a.displacement, told.at_a.displacement, atol=1e-12)
    now = told._time_s
    np.testing.assert_allclose(lost.predict(now).displacement, told.predict(now).displacement, atol=1e-9)
    spread, usual = (np.trace(motion.predict(now + 1.0).covariance) for motion in (lost, never))
    assert spread > 0.7 * usual


def test_where_the_ecg_is_lost_a_weak_heart_is_still_known_to_be_weak():
    told, _, _ = beating(True, tuning=FEW, heart_m=0.5e-3)
    assert np.trace(told.hearing(None).heartbeat) == pytest.approx(np.trace(told.heartbeat), rel=0.3)


def test_what_was_learned_of_a_beat_is_not_forgotten_while_peaks_are_missed():
    told, _, _ = beating(True, tuning=FEW)
    now = told._time_s
    again = told.hearing(None).hearing(Beats.of(now + 0.83 * np.arange(-3.0, 1.0))).later(now + 0.1)
    assert len(again._state) == SIZE_WITH_BEATS
    before, after = (motion._state[BEAT_SHAPE] @ motion.weights for motion in (told, again))
    np.testing.assert_allclose(after, before, atol=1e-6)
    # Parted anew, the displacement stays where it was.
    meanwhile = told.hearing(None).predict(now + 0.1).displacement
    np.testing.assert_allclose(again.predict(now + 0.1).displacement, meanwhile, atol=1e-9)


def test_errors_lie_within_the_covariance_after_the_peaks_have_stopped():
    inside = [beating(True, pairs=60, tuning=FEW, seed=seed, lost_after=9.0)[2][32:] for seed in range(4)]
    assert np.mean(np.concatenate(inside) < 7.81) > 0.85


def test_what_is_foretold_changes_with_the_peaks_that_are_heard():
    motion, _, _ = beating(True, pairs=30, tuning=FEW)
    time_s = motion._time_s + 0.2
    sooner = Beats.of([peak + 0.2 for peak in motion.beats.peaks_s])
    before, heard = motion.predict(time_s), motion.hearing(sooner)
    assert np.linalg.norm(heard.predict(time_s).displacement - before.displacement) > 5e-5
    np.testing.assert_allclose(heard.later(time_s).predict(time_s).displacement, heard.predict(time_s).displacement)
    since_b = heard.expected_between(time_s).displacement
    np.testing.assert_allclose(heard.later(time_s).expected_between(time_s).displacement, since_b)
    there = np.array([1e-3, 2e-3, 3e-3])
    heard.move(there)
    np.testing.assert_allclose(heard.predict(heard._time_s).displacement, there, atol=1e-12)


def test_beyond_the_last_phase_that_is_known_it_is_foretold_without_it():
    motion, _, _ = beating(True, pairs=30, tuning=FEW)
    time_s = motion.beats.peaks_s[-1] + 2.0 * motion.beats.beat_s
    foretold, later = motion.predict(time_s), motion.later(time_s).predict(time_s)
    np.testing.assert_array_equal(foretold.displacement, later.displacement)
    np.testing.assert_array_equal(foretold.covariance, later.covariance)


def test_the_state_tells_of_beats_while_their_phase_is_known():
    motion = RespiratoryMotion(0.0, LATE_S, beats=Beats.of([0.5, 1.3, 2.1]), tuning=FEW)
    assert motion.beats is None
    assert motion.later(0.4).beats is None
    assert motion.later(0.6).beats is not None
    assert motion.later(2.1 + 1.4 * 0.8).beats is not None
    assert motion.later(0.6).later(2.1 + 1.5 * 0.8).beats is None


@pytest.mark.parametrize("later_s", [-1000.0, 30.0])
def test_peaks_of_another_clock_tell_of_no_beats(later_s):
    motion = RespiratoryMotion(0.0, LATE_S, beats=Beats.of(later_s + 0.8 * np.arange(5)), tuning=FEW)
    assert motion.beats is None
    assert motion.hearing(Beats.of(later_s + 0.8 * np.arange(6))).later(1.0).beats is None


def test_hearing_the_same_again_changes_nothing():
    told, _, _ = beating(True, pairs=3, tuning=FEW)
    assert told.hearing(told.beats) is told
