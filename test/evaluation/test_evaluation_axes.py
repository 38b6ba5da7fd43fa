"""Residual by axis, on scores whose errors are known."""

import numpy as np
import pytest

from lasso_motion_ros.evaluation.axes import axis_errors, displacements_mm, residuals_mm
from lasso_motion_ros.evaluation.measures import PairScore


def score(index, true_mm, error_mm, *, reference=False):
    true = np.array([0.1, 0.2, 0.3]) + 1e-3 * np.array(true_mm)
    error = None if error_mm is None else 1e-3 * np.array(error_mm)
    return PairScore(
        index,
        index,
        reference,
        expected=not reference,
        hidden=False,
        displaced=False,
        has_pose=error is not None,
        state="TRACKING",
        centre_error_m=error,
        true_centre_m=true,
        centre_m=None if error is None else true + error,
    )


SCORES = [
    score(0, (0, 0, 0), (9, 9, 9), reference=True),
    score(1, (0, 0, 3), (0.1, 0, 1.0)),
    score(2, (0, 4, 0), (0.3, 0, -1.0)),
    score(3, (50, 50, 50), None),
]


def test_constant_and_jitter_come_apart_by_axis():
    found = axis_errors(SCORES)
    assert found is not None
    np.testing.assert_allclose(found.static_mm, [0.0, np.sqrt(8.0), np.sqrt(4.5)], atol=1e-9)
    np.testing.assert_allclose(found.constant_mm, [0.2, 0.0, 0.0], atol=1e-9)
    np.testing.assert_allclose(found.jitter_mm, [0.1, 0.0, 1.0], atol=1e-9)
    np.testing.assert_allclose(found.residual_mm, [np.sqrt(0.05), 0.0, 1.0], atol=1e-9)


def test_displacements_are_since_the_reference():
    true, found = displacements_mm(SCORES)
    np.testing.assert_allclose(true[:, 2], [0.0, 3.0, 0.0, 50.0], atol=1e-9)
    np.testing.assert_allclose(found[1], [0.1, 0.0, 4.0], atol=1e-9)
    assert np.isnan(found[3]).all()
    assert np.isnan(residuals_mm(SCORES)[[0, 3]]).all()


@pytest.mark.parametrize("scores", [[], [SCORES[0]], [SCORES[3]]])
def test_nothing_to_tell(scores):
    assert axis_errors(scores) is None
