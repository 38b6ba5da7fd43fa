"""The path beside a curve is the best of all, and both strips' are found at once."""

from itertools import product

import numpy as np
import pytest

from lasso_motion_ros.ring.loop_curve import TUNING, _quantile, _ridge_paths


@pytest.mark.parametrize("rows", [1, 2, 5, 6])
def test_no_way_through_the_strip_gains_more(rows):
    gains = np.random.default_rng(rows).normal(0.0, 0.5, (2, rows, 5))
    ways = np.array([way for way in product(range(5), repeat=rows) if (np.abs(np.diff(way)) <= 3).all()])
    penalty = TUNING.bend * (np.diff(ways, axis=1) ** 2).sum(axis=1)
    for gain, found in zip(gains, _ridge_paths(gains), strict=True):
        np.testing.assert_array_equal(found, ways[(gain[np.arange(rows), ways].sum(axis=1) - penalty).argmax()])


@pytest.mark.parametrize("share", [0.0, 0.31, 0.95])
def test_the_quantile_is_numpy_s(share):
    values = np.random.default_rng(0).normal(size=(17, 9)).astype(np.float32)
    assert _quantile(values, share) == pytest.approx(np.quantile(values, share), rel=1e-6)
