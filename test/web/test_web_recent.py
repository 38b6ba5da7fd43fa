"""A mapping that keeps its newest entries only."""

from lasso_motion_ros.web.recent import Recent


def test_the_oldest_entry_goes_and_one_that_is_set_again_is_the_newest():
    recent: Recent[str, int] = Recent(2)
    assert recent.newest is None
    recent["a"], recent["b"] = 1, 2
    recent["a"] = 3
    assert recent.newest == "a"
    recent["c"] = 4
    assert recent == {"a": 3, "c": 4}
