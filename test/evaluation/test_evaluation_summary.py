"""The measures of a recording, from scores that are given."""

from __future__ import annotations

import pytest

from lasso_motion_ros.evaluation.measures import PairScore
from lasso_motion_ros.evaluation.summary import summarise


def score(index: int, nees: float) -> PairScore:
    """A pair with a pose whose squared error is so large in units of its covariance."""
    return PairScore(
        index,
        index,
        is_reference=False,
        expected=True,
        hidden=False,
        displaced=False,
        has_pose=True,
        state="TRACKING",
        nees=nees,
        centre_sigma_mm=1.0,
    )


def test_the_ellipsoids_are_those_of_three_dimensions() -> None:
    # χ² with three degrees of freedom, by table: 68 % below 3.506, 95 % below 7.815.
    summary = summarise([score(index, nees) for index, nees in enumerate((3.50, 3.51, 7.81, 7.82))])
    assert summary.covariance_68_share == pytest.approx(1 / 4)
    assert summary.covariance_95_share == pytest.approx(3 / 4)
