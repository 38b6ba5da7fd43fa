"""What the tests of the tracker start from."""

import copy

import pytest
from support.breathing_lasso import warm_up

from lasso_motion_ros.ring.tracker import RingTracker


@pytest.fixture
def tracker() -> RingTracker:
    """A tracker that has followed the drawn lasso for a breath and a half; each test has its own."""
    return copy.deepcopy(warm_up()[0])
