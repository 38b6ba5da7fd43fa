"""The compiled kernels of the filter in time against the plain versions."""

from __future__ import annotations

from contextlib import nullcontext

import numpy as np
import pytest

from lasso_motion_ros.core.compiled import has_kernels, plain
from lasso_motion_ros.motion import motion_model
from lasso_motion_ros.motion.breathing_rotation import BreathingRotation
from lasso_motion_ros.motion.heartbeat import Beats
from lasso_motion_ros.motion.motion_model import TUNING, Observation
from lasso_motion_ros.motion.respiration import RespiratoryMotion

pytestmark = pytest.mark.skipif(not has_kernels(), reason="the extra `fast` is not installed")


@pytest.mark.parametrize("seed", range(10))
def test_states_begin_and_move_on_alike(seed: int) -> None:
    generator = np.random.default_rng(seed)
    spread = np.cov(generator.normal(size=(3, 9)) * 1e-2)
    heart = generator.permutation(TUNING.hearts(0.1).covariances)[: (1, 8, 32, 33, 70)[seed % 5]]
    phase = None if seed < 5 else 0.17 * seed
    told: list[tuple[np.ndarray, ...]] = []
    for version in (nullcontext(), plain()):
        with version:
            first = motion_model.first_states(spread, heart, TUNING, phase)
            moving = first[0] + 1e-3 * np.random.default_rng(seed).normal(size=first[0].shape), first[1]
            told.append((*first, *motion_model.moved_on(*moving, 0.067 * (seed + 1), spread, heart, TUNING)))
    for one, other in zip(*told, strict=True):
        np.testing.assert_allclose(one, other, rtol=1e-9, atol=1e-9 * np.abs(other).max())


@pytest.mark.parametrize("late_s", [0.0, 0.03])
@pytest.mark.parametrize("peaks_s", [(), (-1.4, -0.6, 0.3), (-1.4, -0.6, 0.3, 1.1, 1.9)])
def test_exposures_are_taken_in_alike(peaks_s: tuple[float, ...], late_s: float) -> None:
    """Of either plane, or none, one after the other and many at once; also where the phase of the beat gets lost."""
    told: list[list[np.ndarray]] = []
    for version in (nullcontext(), plain()):
        with version:
            generator = np.random.default_rng(2)
            across = np.linalg.qr(generator.normal(size=(3, 3)))[0]
            between = Observation(across[1:2], np.array([4e-4]), np.array([[1e-7]])) if late_s > 0.0 else None
            motion = RespiratoryMotion(0.0, late_s, between=between, beats=Beats.of(peaks_s))
            told.append([np.array(motion.later(0.05)._tells_of_beats)])
            for number in range(1, 14):
                time_s, place = 0.2 * number, 1e-3 * generator.normal(size=3)
                noise = np.cov(generator.normal(size=(2, 5)) * 1e-4)
                likelihood = 0.0
                if number == 4:
                    motion.mark_a(time_s)
                else:
                    likelihood += motion.observe(time_s, a=Observation(across[:2], across[:2] @ place, noise))
                if number != 7:
                    seen = Observation(across[1:], across[1:] @ place, noise)
                    likelihood += motion.observe(time_s + late_s, b=seen)
                motion.learn(place)
                foretold = motion.predict(time_s + 0.1)
                told[-1] += [motion._state, motion._covariance, motion._log_weights, np.array(likelihood)]
                told[-1] += [
                    motion.at_a.displacement,
                    motion.at_a.covariance,
                    foretold.displacement,
                    foretold.covariance,
                ]
    for one, other in zip(*told, strict=True):
        np.testing.assert_allclose(one, other, rtol=1e-7, atol=1e-9 * np.abs(other).max())
        if one.ndim == 3:
            np.testing.assert_array_equal(one, one.swapaxes(0, 1))


def followed(late_s: float, pairs: int, noise_m: float) -> tuple[list[np.ndarray], float]:
    generator = np.random.default_rng(3)
    motion = RespiratoryMotion(0.0, late_s)
    across = np.linalg.qr(generator.normal(size=(3, 3)))[0]
    seen: list[np.ndarray] = []
    likelihood = 0.0
    for number in range(1, pairs + 1):
        time_s = number / 15.0
        place = np.array([1e-3, 3e-3, 8e-3]) * np.sin(time_s) + generator.normal(size=3) * noise_m
        for plane, offset in (("a", 0.0), ("b", late_s)):
            rows = across[:2] if plane == "a" else across[1:]
            observation = Observation(rows, rows @ place, 0.1 * noise_m**2 * np.eye(2))
            likelihood += motion.observe(time_s + offset, **{plane: observation})
        motion.learn(motion.at_a.displacement)
        foretold = motion.predict(time_s + 1.0)
        seen += [motion.at_a.displacement, motion.at_a.covariance, foretold.displacement, foretold.covariance]
    return seen, likelihood


@pytest.mark.parametrize(
    ("late_s", "pairs", "noise_m", "nearly"),
    [
        (0.03, 24, 1e-4, 1e-9),
        # Rounding that one half of the covariances does not share with the other would grow from pair to pair.
        (0.0, 60, 1e-5, 1e-6),
    ],
)
def test_a_ring_is_followed_alike_however_long(late_s: float, pairs: int, noise_m: float, nearly: float) -> None:
    compiled, likelihood = followed(late_s, pairs, noise_m)
    with plain():
        plainly, plain_likelihood = followed(late_s, pairs, noise_m)
    assert likelihood == pytest.approx(plain_likelihood, rel=nearly)
    for one, other in zip(compiled, plainly, strict=True):
        np.testing.assert_allclose(one, other, rtol=nearly, atol=1e-3 * nearly)
    for at_a, foretold in zip(compiled[1::4], compiled[3::4], strict=True):
        assert min(np.linalg.eigvalsh(at_a)[0], np.linalg.eigvalsh(foretold)[0]) > 0.0


@pytest.mark.parametrize("seed", range(6))
def test_a_rotation_is_told_alike(seed: int) -> None:
    generator = np.random.default_rng(seed)
    rotation, plainly = BreathingRotation(), BreathingRotation()
    way, slope = generator.normal(size=3), generator.normal(size=3) * (seed % 3)
    for number in range(40):
        displacement = 5e-3 * np.sin(number / 5.0) * way + generator.normal(size=3) * 1e-4
        turn = slope * displacement[0] + generator.normal(size=3) * 1e-2
        pair = 0.2 * number, displacement, turn, float(generator.normal() * 1e-2)
        rotation.learn(*pair)
        with plain():
            plainly.learn(*pair)
        assert rotation.probability == pytest.approx(plainly.probability, rel=1e-9)
        there = generator.normal(size=3) * 1e-2
        one, other = rotation.between(displacement, there), plainly.between(displacement, there)
        np.testing.assert_allclose(one.vector, other.vector, rtol=1e-9, atol=1e-14)
        np.testing.assert_allclose(one.covariance, other.covariance, rtol=1e-9, atol=1e-14)
