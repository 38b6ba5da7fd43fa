"""A ring that breathes, as two planes see it, and the filter that follows it."""

import numpy as np
from support.method_inputs import biplane

from lasso_motion_ros.motion.motion_model import TUNING, Observation
from lasso_motion_ros.motion.respiration import RespiratoryMotion

SIGHT = {name: -view.source / np.linalg.norm(view.source) for name, view in biplane().items()}
ACROSS = {name: np.linalg.svd(ray[None])[2][1:] for name, ray in SIGHT.items()}
DIRECTION = np.array([0.08, -0.25, -1.0]) / np.linalg.norm([0.08, -0.25, -1.0])
PERIOD_S, AMPLITUDE_M, INTERVAL_S = 4.0, 0.012, 0.3
SIGMA_M = 4e-5
RISE = Observation(np.array([[0.0, 0.0, 1.0]]), np.array([0.004]), np.array([[1e-10]]))


def breathing(time_s):
    """(3,) metres from the first time on: 12 mm along a line, with a little hysteresis aside."""
    phase = 2.0 * np.pi * time_s / PERIOD_S
    along = 0.5 * AMPLITUDE_M * (1.0 - np.cos(phase + 1.0)) - 0.5 * AMPLITUDE_M * (1.0 - np.cos(1.0))
    return along * DIRECTION + 0.0005 * (np.sin(phase + 1.0) - np.sin(1.0)) * np.array([1.0, 0.0, 0.0])


def observation(plane, displacement, random=None, sigma=SIGMA_M):
    noise = np.zeros(2) if random is None else random.normal(scale=sigma, size=2)
    return Observation(ACROSS[plane], ACROSS[plane] @ displacement + noise, sigma**2 * np.eye(2))


def step(motion, time_s, late_s, moved, random=None, planes="ab"):
    """One pair: plane A at a time, plane B late, what each sees of a motion moved(time)."""
    if "a" in planes:
        motion.observe(time_s, a=observation("a", moved(time_s), random))
    else:
        motion.mark_a(time_s)
    if "b" in planes:
        # What plane B measures refers to its own first exposure.
        motion.observe(time_s + late_s, b=observation("b", moved(time_s + late_s) - moved(late_s), random))


def run(count, late_s, moved=breathing, seed=0, learn=True, tuning=TUNING):
    """The filter after a number of pairs, and at each the error (3,) and the covariance, with what it knew then."""
    random = np.random.default_rng(seed)
    motion = RespiratoryMotion(0.0, late_s, tuning=tuning)
    errors, covariances = [], []
    for index in range(1, count + 1):
        step(motion, index * INTERVAL_S, late_s, moved, random)
        if learn:
            motion.learn(motion.at_a.displacement)
        errors.append(motion.at_a.displacement - moved(index * INTERVAL_S))
        covariances.append(motion.at_a.covariance)
    return motion, np.array(errors), np.array(covariances)
