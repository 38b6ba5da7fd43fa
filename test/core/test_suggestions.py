"""A mistyped name gets the nearest known one as a suggestion, and only a near one."""

from __future__ import annotations

from lasso_motion_ros.core.suggestions import did_you_mean


def test_the_nearest_name_is_suggested() -> None:
    assert did_you_mean("pionts", {"points", "ports", "scales"}) == "did you mean points?"


def test_nothing_is_suggested_where_nothing_is_near() -> None:
    assert did_you_mean("zzzz", ("points", "scales")) == ""
    assert did_you_mean("points", ()) == ""
