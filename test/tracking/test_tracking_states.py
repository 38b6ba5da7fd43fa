"""The states, pair by pair, where the lasso is hidden, taken out, or moved to another vein: on rendered pictures."""

import dataclasses
from collections.abc import Iterator

import pytest

from lasso_motion_ros.bench.suite.sequence import render_sequence, run_sequence
from lasso_motion_ros.config.tracker import TrackerConfig
from lasso_motion_ros.evaluation.measures import PairScore
from lasso_motion_ros.geometry.frames import Plane
from lasso_motion_ros.geometry.projection import Projection
from lasso_motion_ros.phantom import Simulator
from lasso_motion_ros.phantom.imaging import Pixels
from lasso_motion_ros.phantom.scenario import load_scenario
from lasso_motion_ros.phantom.settings import Event
from lasso_motion_ros.stream.tracker_factory import create_tracker

FIRST = 9  # pair of the event: two and a half seconds after the seed
PAIRS = 16
MOVED_MM = (16.0, 6.0, 18.2)  # 25 mm
TRACKING, LOST, DISPLACED = "TRACKING", "LOST", "DISPLACED"


@pytest.fixture(scope="module", autouse=True)
def _pictures_before_the_event() -> Iterator[None]:
    """Rendered once: they are the same, whatever the event will be."""
    expose, known = Simulator._expose, dict[tuple[Plane, int], Pixels]()

    def exposed(self: Simulator, plane: Plane, index: int, projection: Projection) -> Pixels:
        if index >= FIRST:
            return expose(self, plane, index, projection)
        if (plane, index) not in known:
            known[plane, index] = expose(self, plane, index, projection)
        return known[plane, index]

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Simulator, "_expose", exposed)
        yield


def scores_with(event: Event) -> tuple[PairScore, ...]:
    """3.75 pairs/s, 15 mm of breathing, 25 quanta a pixel, a heartbeat."""
    scenario = dataclasses.replace(load_scenario("06_hidden_then_moved"), pairs=PAIRS, events=(event,))
    return run_sequence(render_sequence(scenario), create_tracker(TrackerConfig())).scores


def states(scores: tuple[PairScore, ...]) -> list[str]:
    return [score.state for score in scores]


def assert_followed(scores: tuple[PairScore, ...]) -> None:
    for score in scores:
        assert score.state == TRACKING
        assert score.centre_error_mm is not None
        assert score.centre_error_mm < 0.3


@pytest.mark.slow
def test_hidden_for_five_pairs_and_back() -> None:
    scores = scores_with(Event("hide", FIRST, FIRST + 4))
    assert states(scores[FIRST : FIRST + 5]) == [LOST] * 5
    assert not any(score.has_pose for score in scores[FIRST : FIRST + 5])
    back = scores[FIRST + 5 :]
    # Found again by itself within three pairs; and what is published is never anything else.
    assert_followed(back[2:])
    assert all(score.centre_error_mm < 0.3 for score in back if score.has_pose)
    assert_followed(scores[:FIRST])


@pytest.mark.slow
def test_taken_out_for_good() -> None:
    scores = scores_with(Event("remove", FIRST))
    assert states(scores[FIRST:]) == [LOST] * (PAIRS - FIRST)
    assert not any(score.has_pose for score in scores[FIRST:])
    assert_followed(scores[:FIRST])


@pytest.mark.slow
def test_moved_at_once_to_another_vein() -> None:
    scores = scores_with(Event("move", FIRST, shift_mm=MOVED_MM, turn_deg=(4.0, 0.0, 4.0)))
    assert all(score.displaced for score in scores[FIRST:])
    # LOST, where nothing tells the moved ring from what is not the ring.
    assert set(states(scores[FIRST:])) <= {DISPLACED, LOST}
    assert states(scores[FIRST:]).count(DISPLACED) >= PAIRS - FIRST - 2
    assert not any(score.has_pose for score in scores[FIRST:])
    assert_followed(scores[:FIRST])


@pytest.mark.slow
def test_moved_over_three_pairs_to_another_vein() -> None:
    scores = scores_with(Event("move", FIRST, FIRST + 2, shift_mm=MOVED_MM))
    # The first thirds are 8 mm each, no more than a breath in a quarter of a second; then it is said.
    assert states(scores[FIRST + 2 :]) == [DISPLACED] * (PAIRS - FIRST - 2)
    assert not any(score.has_pose for score in scores[FIRST + 2 :])
