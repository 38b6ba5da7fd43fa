import pytest

from lasso_motion_ros.brost2009.tracker import Brost2009Tracker
from lasso_motion_ros.config.tracker import TrackerConfig
from lasso_motion_ros.core.errors import TrackingError
from lasso_motion_ros.ring.tracker import RingTracker
from lasso_motion_ros.stream.tracker_factory import create_tracker


@pytest.mark.parametrize(("method", "kind"), [("appearance", RingTracker), ("brost2009", Brost2009Tracker)])
def test_the_configuration_names_the_method(method, kind):
    tracker = create_tracker(TrackerConfig(method=method))
    assert type(tracker) is kind
    with pytest.raises(TrackingError, match="seed the tracker first"):
        tracker.set_reference()


def test_ours_is_the_default():
    assert type(create_tracker(TrackerConfig())) is RingTracker


def test_every_tracker_is_a_new_one():
    assert create_tracker(TrackerConfig()) is not create_tracker(TrackerConfig())
