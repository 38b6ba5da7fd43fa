"""Breathing drawn by hand, and the curve of a ring that has breathed so."""

import numpy as np

from lasso_motion_ros.ring.breathing_curve import BreathingCurve, CurveTuning

UP, ASIDE = np.array([0.0, 0.0, 1.0]), np.array([1.0, 0.0, 0.0])
PAIR_S = 0.3
SIGMA_M = 1e-4


def wave(time_s, depth_mm=12.0, period_s=4.0, hysteresis_mm=0.0):
    """Breathing along the patient's axis from the first time on, (3,) metres; in on one side and out on the other."""
    phase = 2.0 * np.pi * time_s / period_s
    return 1e-3 * (0.5 * depth_mm * (1.0 - np.cos(phase)) * UP + hysteresis_mm * np.sin(phase) * ASIDE)


def after(places, pair_s=PAIR_S):
    """A curve that has accepted places (N, 3) in turn, and the time of the last."""
    curve = BreathingCurve(np.zeros(3), 0.0, CurveTuning())
    for index, place in enumerate(places, start=1):
        curve.accept(index * pair_s, place)
    return curve, len(places) * pair_s


def breathed(duration_s=16.0, pair_s=PAIR_S, seed=1, jitter_mm=0.05, **of_wave):
    random = np.random.default_rng(seed)
    times = np.arange(1, round(duration_s / pair_s) + 1) * pair_s
    return after([wave(t, **of_wave) + 1e-3 * jitter_mm * random.normal(size=3) for t in times], pair_s)
