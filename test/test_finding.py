"""What a pair is searched for: candidates of both planes, and what is made of them."""

import numpy as np
import pytest
from lasso_inputs import LOOP, lasso_pair, lasso_seed

from lasso_motion_ros import finding
from lasso_motion_ros.appearance_tracker import AppearanceTracker
from lasso_motion_ros.configuration import TrackerConfig
from lasso_motion_ros.search import SearchCandidate
from lasso_motion_ros.tracker import TrackerState
from lasso_motion_ros.transforms import apply

DOWN = np.array([0.0, 0.001, -0.005])
FAR = np.array([0.0, 0.0, 0.03])  # where nothing is


def candidates(*places):
    """The search's answer: per candidate, where each plane would show the loop, from its centre at the reference."""
    found = [{plane: LOOP.centre + place for plane, place in zip("ab", both, strict=True)} for both in places]
    return [SearchCandidate(20.0 - rank, centres) for rank, centres in enumerate(found)]


@pytest.mark.parametrize("swapped", [False, True])
def test_planes_that_the_search_has_joined_wrongly_are_joined_anew(monkeypatch, swapped):
    tracker = AppearanceTracker(TrackerConfig())
    tracker.initialise(lasso_pair(0, np.zeros(3)), lasso_seed())
    wrong = [(DOWN, DOWN + FAR), (DOWN - FAR, DOWN)][:: -1 if swapped else 1]
    monkeypatch.setattr(finding, "join_peaks", lambda *_: candidates(*wrong))
    result = tracker.track(lasso_pair(1, DOWN))
    assert result.state is TrackerState.TRACKING
    assert np.linalg.norm(apply(result.motion, LOOP.centre) - LOOP.centre - DOWN) < 2e-4


def test_a_plane_that_no_candidate_shows_the_loop_in_is_not_joined(monkeypatch):
    tracker = AppearanceTracker(TrackerConfig())
    tracker.initialise(lasso_pair(0, np.zeros(3)), lasso_seed())
    monkeypatch.setattr(finding, "join_peaks", lambda *_: candidates((DOWN, DOWN + FAR), (DOWN - FAR, DOWN - FAR)))
    monkeypatch.setattr(finding, "AFAR_CANDIDATES", 0)
    result = tracker.track(lasso_pair(1, DOWN))
    assert result.state is TrackerState.LOST
    assert "plane B" in result.reason
