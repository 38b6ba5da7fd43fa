"""The compiled kernels of the filter in time against the plain versions."""

from __future__ import annotations

from contextlib import nullcontext

import numpy as np
import pytest

from lasso_motion_ros.core.compiled import has_kernels, plain
from lasso_motion_ros.motion import motion_model
from lasso_motion_ros.motion.breathing_rotation import BreathingRotation
from lasso_motion_ros.motion.motion_model import AT_A, ORIGIN_B, SIZE, TUNING, Observation, displacement_at, since_b_at
from lasso_motion_ros.motion.respiration import RespiratoryMotion

DISPLACEMENT, SINCE_B = displacement_at(None), since_b_at(None)

pytestmark = pytest.mark.skipif(not has_kernels(), reason="the extra `fast` is not installed")


@pytest.mark.parametrize("seed", range(10))
def test_states_move_on_and_are_measured_alike(seed: int) -> None:
    generator = np.random.default_rng(seed)
    state = generator.normal(size=(8, SIZE)) * 1e-2
    half = generator.normal(size=(8, SIZE, SIZE)) * 1e-3
    covariance = half @ half.swapaxes(1, 2)
    spread = np.cov(generator.normal(size=(3, 9)) * 1e-2)
    heart = generator.permutation(TUNING.hearts(0.1).covariances)[:8]
    h = np.linalg.qr(generator.normal(size=(3, 3)))[0][:2] @ (SINCE_B if seed % 2 else DISPLACEMENT)
    value, noise = generator.normal(size=2) * 1e-3, np.cov(generator.normal(size=(2, 5)) * 1e-4)

    from lasso_motion_ros.motion import kernels

    with plain():
        plain_moved = motion_model.moved_on(state, covariance, 0.067 * (seed + 1), spread, heart, TUNING)
    moved = motion_model.moved_on(state, covariance, 0.067 * (seed + 1), spread, heart, TUNING)
    measured = kernels.measured(state, covariance, h, value, noise)
    for one, other in zip(
        (*moved, *measured), (*plain_moved, *motion_model.measured(state, covariance, h, value, noise)), strict=True
    ):
        np.testing.assert_allclose(one, other, rtol=1e-9, atol=1e-9 * np.abs(other).max())


@pytest.mark.parametrize("block", [None, AT_A, ORIGIN_B])
def test_a_block_becomes_the_displacement_with_the_measurement(block: slice | None) -> None:
    across = Observation(np.eye(3)[:2], np.array([1e-3, -2e-3]), 1e-9 * np.eye(2))
    told: list[list[np.ndarray]] = []
    for version in (nullcontext(), plain()):
        with version:
            motion = RespiratoryMotion(0.0, 0.03).later(0.2)
            motion._update(across.across @ DISPLACEMENT, across.value, across.covariance, block)
            told.append([motion._state, motion._covariance, motion._log_weights])
    for one, other in zip(*told, strict=True):
        np.testing.assert_allclose(one, other, rtol=1e-9, atol=1e-9 * np.abs(other).max())
    state, covariance, _ = told[0]
    if block is not None:
        np.testing.assert_allclose(state[:, block], state @ DISPLACEMENT.T, atol=1e-15)
        np.testing.assert_allclose(covariance[:, block, block], DISPLACEMENT @ covariance @ DISPLACEMENT.T, atol=1e-18)


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
