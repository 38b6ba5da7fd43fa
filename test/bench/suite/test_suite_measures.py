"""The suite's measures, by hand."""

import numpy as np
import pytest
from support.suite_inputs import result, score

from lasso_motion_ros.bench.suite.suite_measures import confusion, measures


def test_measures_by_hand() -> None:
    off = np.array([0.003, 0.0, 0.0])
    scores = [
        score(0, error_2d_mm={"a": 0.1, "b": 0.3}),
        score(1, centre_error_m=off / 3.0, nees=1.0, centre_sigma_mm=2.0),
        score(2, centre_error_m=off, nees=5.0, centre_sigma_mm=4.0),
        score(3, has_pose=False),
    ]
    found = measures(scores)
    assert (found.pairs, found.poses, found.silent, found.missing) == (3, 2, 1, 1)
    assert found.centre_mean_mm == pytest.approx(2.0)
    assert found.centre_max_mm == pytest.approx(3.0)
    assert found.model_mm == pytest.approx(0.2)
    assert (found.inside_68, found.inside_95, found.sigma_mm) == (0.5, 1.0, 3.0)


def test_states_are_counted_against_the_truth() -> None:
    found = confusion([result(score(0), score(1), score(2), score(3, hidden=True, expected=False, has_pose=False))])
    assert found["one plane"] == {"TRACKING": 1}
    assert found["both planes"] == {"TRACKING": 1}
    assert found["hidden or gone"] == {"TRACKING": 1}
