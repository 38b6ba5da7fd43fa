import pytest

from lasso_motion_ros.tracking.tracker import TrackerState


@pytest.mark.parametrize("state", TrackerState)
def test_a_published_state_tells_of_a_pose_as_the_state_does(state: TrackerState) -> None:
    assert TrackerState.tells_of_pose(state.value) == state.has_pose
    assert state.has_pose == (state.value in {"TRACKING", "DEGRADED"})


@pytest.mark.parametrize("published", ["", "tracking", "SOMETHING_NEW"])
def test_what_is_no_state_tells_of_no_pose(published: str) -> None:
    assert not TrackerState.tells_of_pose(published)
