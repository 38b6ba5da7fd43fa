"""What a pair would make of the motion is what it makes of it."""

from __future__ import annotations

from contextlib import nullcontext

import numpy as np
import pytest
from support.respiration_inputs import INTERVAL_S, breathing, observation, run

from lasso_motion_ros.core.compiled import plain
from lasso_motion_ros.motion.heartbeat import Beats


@pytest.mark.parametrize("is_plain", [False, True])
@pytest.mark.parametrize("has_peaks", [False, True])
@pytest.mark.parametrize("late_s", [0.0, 0.05])
@pytest.mark.parametrize("planes", ["ab", "a", "b"])
def test_it_is_told_before_anything_is_taken_in(planes, late_s, has_peaks, is_plain):
    with plain() if is_plain else nullcontext():
        motion, *_ = run(5, late_s)
        time_s = 6 * INTERVAL_S
        # The phase of the beat is known at all exposures, or from the next one on.
        beats = Beats.of(time_s + 0.01 + 0.8 * np.arange(-3.0, 1.0)) if has_peaks else None
        motion = motion.hearing(beats)
        for heard in (motion, motion.later(5.3 * INTERVAL_S + late_s)):
            before = [one.copy() for one in (heard._state, heard._covariance, heard._log_weights)]
            a = observation("a", breathing(time_s) + np.array([2e-4, 0.0, 5e-4])) if "a" in planes else None
            seen_b = breathing(time_s + late_s) - breathing(late_s) - np.array([0.0, 3e-4, 1e-4])
            b = observation("b", seen_b) if "b" in planes else None
            told = heard.outcome(time_s, a, time_s + late_s, b)
            after, likelihood = heard.copy(), 0.0
            if a is None:
                after.mark_a(time_s)
            else:
                likelihood += after.observe(time_s, a=a)
            assert (told.between is None) == (len(planes) == 1)
            if told.between is not None:
                between = after.expected_between(time_s + late_s)
                np.testing.assert_allclose(told.between.displacement, between.displacement, atol=1e-11)
                np.testing.assert_allclose(told.between.covariance, between.covariance, rtol=1e-6, atol=1e-15)
            if b is not None:
                likelihood += after.observe(time_s + late_s, b=b)
            assert told.likelihood == pytest.approx(likelihood, rel=1e-9)
            for at_a in (told.at_a, told.motion.at_a):
                np.testing.assert_allclose(at_a.displacement, after.at_a.displacement, atol=1e-11)
                np.testing.assert_allclose(at_a.covariance, after.at_a.covariance, rtol=1e-6, atol=1e-15)
            np.testing.assert_allclose(told.motion.weights, after.weights, rtol=1e-6, atol=1e-9)
            for now, then in zip((heard._state, heard._covariance, heard._log_weights), before, strict=True):
                np.testing.assert_array_equal(now, then)  # nothing was taken in


def test_where_the_phase_gets_lost_the_state_then_is_worked_out_once_for_all_places(monkeypatch):
    motion, *_ = run(5, 0.02)
    time_s = motion._time_s + 2.0  # long after the last peak
    heard = motion.hearing(Beats.of(motion._time_s + 0.8 * np.arange(-3.0, 1.0))).later(motion._time_s + 0.1)
    assert heard.beats is not None
    moves, advance = [], type(heard)._advance
    monkeypatch.setattr(
        type(heard), "_advance", lambda one, at_s: (moves.append(one._time_s < at_s), advance(one, at_s))
    )
    foretold = heard.predict(time_s)
    for aside_m in (0.0, 1e-3):
        seen = observation("a", foretold.displacement + aside_m)
        told = heard.outcome(time_s, seen, time_s, None)
        assert np.linalg.norm(told.at_a.displacement - foretold.displacement) <= 2.0 * aside_m + 1e-12
    assert sum(moves) == 1
    heard.observe(time_s, a=seen)
    assert heard.predict(time_s + 0.1).covariance.trace() != foretold.covariance.trace()
