"""The mean of successive pairs shows the first pair's ring, with less noise."""

from __future__ import annotations

import numpy as np
import pytest
from support.lasso_inputs import lasso_pair

from lasso_motion_ros.initialisation.compensated_mean import compensated_mean, motions_of
from lasso_motion_ros.initialisation.laid_pair import LaidPair

MOVES = ((0.0, 0.0, 0.0), (1e-3, -2e-3, 4e-3), (2e-3, -1e-3, 8e-3))


@pytest.mark.slow
def test_the_mean_lies_nearer_to_the_first_pair_without_noise_than_that_pair_itself() -> None:
    pairs = [LaidPair.of(lasso_pair(k, move, sigma=8.0), bright=False) for k, move in enumerate(MOVES)]
    clean = LaidPair.of(lasso_pair(0, sigma=0.0), bright=False)
    mean = compensated_mean(pairs, motions_of(pairs))

    def like(one: LaidPair, plane: str) -> float:
        return float(np.corrcoef(one.bands[plane].reshape(-1), clean.bands[plane].reshape(-1))[0, 1])

    for plane in "ab":
        assert like(mean, plane) > 1.15 * like(pairs[0], plane)
    assert mean.pair is pairs[0].pair


def test_the_mean_of_a_pair_alone_is_the_pair() -> None:
    first = LaidPair.of(lasso_pair(0), bright=False)
    mean = compensated_mean([first], motions_of([first]))
    for plane in "ab":
        assert mean.laid[plane].values == pytest.approx(first.laid[plane].values)
