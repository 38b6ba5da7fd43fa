"""What a pair is searched for: candidates of both planes, and what is made of them."""

import numpy as np
import pytest
from support.lasso_inputs import CURVE, LOOP, PERIOD_NS, VIEWS, lasso_image, lasso_pair, lasso_seed, noisy

from lasso_motion_ros.config.ring import SearchConfig
from lasso_motion_ros.config.tracker import TrackerConfig
from lasso_motion_ros.geometry.frames import Frame, FramePair
from lasso_motion_ros.ring import loop_finder
from lasso_motion_ros.ring.alignment import align
from lasso_motion_ros.ring.loop_views import LoopViews
from lasso_motion_ros.ring.search import SearchCandidate
from lasso_motion_ros.ring.tracker import AppearanceTracker
from lasso_motion_ros.tracking.tracker import TrackerState

DOWN = np.array([0.0, 0.001, -0.005])
FAR = np.array([0.0, 0.0, 0.03])  # where nothing is
ASIDE = np.array([0.0, 0.0, 0.012])  # nor there, and near


def candidates(*places):
    """The search's answer: per candidate, where each plane would show the loop, from its centre at the reference."""
    found = [{plane: LOOP.centre + place for plane, place in zip("ab", both, strict=True)} for both in places]
    return [SearchCandidate(20.0 - rank, centres) for rank, centres in enumerate(found)]


@pytest.fixture
def aligned(monkeypatch):
    """Where alignments started from."""
    starts = []

    def spied(images, appearances, arms, centres, *others):
        starts.append(centres)
        return align(images, appearances, arms, centres, *others)

    monkeypatch.setattr(loop_finder, "align", spied)
    return starts


def test_what_was_tried_is_not_tried_again(monkeypatch, aligned):
    tracker = AppearanceTracker(TrackerConfig())
    tracker.initialise(lasso_pair(0, np.zeros(3)), lasso_seed())
    nowhere = [(DOWN - ASIDE, DOWN + side * ASIDE) for side in (-1.0, -0.7, 0.7, 1.0)]
    monkeypatch.setattr(loop_finder, "join_peaks", lambda *_: candidates((DOWN, DOWN + FAR), *nowhere))
    monkeypatch.setattr(loop_finder, "AFAR_CANDIDATES", 0)
    result = tracker.track(lasso_pair(1, DOWN))
    assert result.state is TrackerState.LOST
    assert "plane B" in result.reason
    assert len(aligned) == 5  # near the prediction; in the whole picture they are known


@pytest.mark.parametrize(("apart", "looks"), [(0.0, 2), (0.006, 1), (-0.006, 1)])
def test_a_rival_on_which_the_planes_would_disagree_is_not_looked_at(monkeypatch, aligned, apart, looks):
    rival = DOWN + np.array([0.004, 0.0, 0.0])
    tracker = AppearanceTracker(TrackerConfig())
    tracker.initialise(lasso_pair(0, np.zeros(3)), lasso_seed())
    places = candidates((DOWN, DOWN), (rival, rival + np.array([0.0, 0.0, apart])))
    monkeypatch.setattr(loop_finder, "join_peaks", lambda *_: places)
    assert tracker.track(lasso_pair(1, DOWN)).state is TrackerState.TRACKING
    assert len(aligned) == looks


def test_with_plane_b_later_only_rivals_of_the_same_place_in_plane_a_are_judged_beforehand(monkeypatch, aligned):
    def late_pair(index, place):
        pixels = noisy(lasso_image(CURVE + place, VIEWS["b"]), [index, 3])
        stamp_ns = index * PERIOD_NS
        return FramePair(stamp_ns, lasso_pair(index, place).a, Frame(stamp_ns + PERIOD_NS // 2, pixels, VIEWS["b"]))

    tracker = AppearanceTracker(TrackerConfig())
    tracker.initialise(late_pair(0, np.zeros(3)), lasso_seed())
    far = np.array([0.0, 0.0, 0.02])
    rivals = (DOWN, DOWN + far), (DOWN - ASIDE, DOWN - ASIDE + far)
    monkeypatch.setattr(loop_finder, "join_peaks", lambda *_: candidates((DOWN, DOWN), *rivals))
    assert tracker.track(late_pair(1, DOWN)).state.has_pose
    assert [float(starts["a"][2]) for starts in aligned] == [
        LOOP.centre[2] + place[2] for place in (DOWN, DOWN - ASIDE)
    ]


def test_where_nothing_is_nothing_is_fitted(monkeypatch, aligned):
    def fits(*_):
        raise AssertionError("nobody needs to know")

    tracker = AppearanceTracker(TrackerConfig())
    tracker.initialise(lasso_pair(0, np.zeros(3)), lasso_seed())
    monkeypatch.setattr(LoopViews, "fits", fits)
    monkeypatch.setattr(loop_finder, "join_peaks", lambda *_: candidates((DOWN, DOWN), (FAR, FAR)))
    assert tracker.track(lasso_pair(1, None)).state is TrackerState.LOST
    assert len(aligned) == 2


def test_what_lay_outside_the_first_look_is_tried_again(monkeypatch):
    """Cut by the edge of the part about the prediction a loop shows as a peak there, too, but cannot be aligned."""
    tracker = AppearanceTracker(TrackerConfig(search=SearchConfig(near_mm=2.0)))
    tracker.initialise(lasso_pair(0, np.zeros(3)), lasso_seed())
    for index in range(1, 5):
        assert tracker.track(lasso_pair(index, np.zeros(3))).state is TrackerState.TRACKING
    monkeypatch.setattr(loop_finder, "join_peaks", lambda *_: candidates((FAR, FAR)))
    assert tracker.track(lasso_pair(5, FAR)).state is TrackerState.DISPLACED
