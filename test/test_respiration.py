"""The filter of the loop's motion: what it learns, and what it goes through again."""

import numpy as np
import pytest

from lasso_motion_ros import respiration
from lasso_motion_ros.respiration import FIRST_SPREAD_M, Observation, RespiratoryMotion

DIRECTION = np.array([0.1, 0.4, 0.9]) / np.linalg.norm([0.1, 0.4, 0.9])
# Plane A looks along y, plane B along x.
ACROSS_A, ACROSS_B = np.eye(3)[[0, 2]], np.eye(3)[[1, 2]]
NOISE = (2e-5) ** 2 * np.eye(2)
OFFSET_S = 0.2


def displacement(time_s: float) -> np.ndarray:
    """Breathing on a line, 10 mm from end to end, steepest at the start."""
    return 0.005 * np.sin(2.0 * np.pi * time_s / 4.0) * DIRECTION


def followed(pairs: int, rate_hz: float = 2.0) -> RespiratoryMotion:
    """The filter after some pairs, plane B exposed later than plane A."""
    filtered = RespiratoryMotion(0.0, OFFSET_S)
    for number in range(1, pairs + 1):
        at_a, at_b = number / rate_hz, number / rate_hz + OFFSET_S
        filtered.observe(at_a, a=Observation(ACROSS_A, ACROSS_A @ displacement(at_a), NOISE))
        filtered.mark_a(at_a)
        since_first_b = displacement(at_b) - displacement(OFFSET_S)
        filtered.observe(at_b, b=Observation(ACROSS_B, ACROSS_B @ since_first_b, NOISE))
        filtered.learn(filtered.at_a.displacement)
    return filtered


def depth_error(filtered: RespiratoryMotion) -> float:
    """Of plane B's first exposure along plane A's ray, which only B's later motion tells."""
    return float(abs(filtered.origin_b.displacement[1] - displacement(OFFSET_S)[1]))


def test_what_moved_between_the_first_exposures_is_learned_once_the_direction_shows(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    assert abs(displacement(OFFSET_S)[1]) > 0.5e-3
    again = followed(12)
    monkeypatch.setattr(respiration, "REBUILD_AT", frozenset())
    once = followed(12)
    assert depth_error(again) < 0.15e-3
    assert depth_error(again) < 0.6 * depth_error(once)
    assert np.trace(again.origin_b.covariance) < 0.5 * np.trace(once.origin_b.covariance)


def test_the_spread_narrows_to_the_line_of_the_motion() -> None:
    assert RespiratoryMotion(0.0, 0.0).spread == pytest.approx(
        (FIRST_SPREAD_M**2 + respiration.SMALLEST_SPREAD_M**2) * np.eye(3)
    )
    sizes, directions = np.linalg.eigh(followed(20).spread)
    assert abs(directions[:, 2] @ DIRECTION) > 0.99
    assert np.sqrt(sizes[1] / sizes[2]) < 0.3


def test_the_past_is_not_kept_for_ever() -> None:
    longest = respiration.LONGEST_HISTORY
    assert len(followed(longest - 1)._history) == 3 * (longest - 1)
    assert followed(longest + 5)._history == ()


def test_going_through_the_past_again_changes_nothing_where_nothing_was_learned() -> None:
    filtered = followed(5)
    filtered._rebuild()
    before = filtered.at_a
    filtered._rebuild()
    assert filtered.at_a.displacement == pytest.approx(before.displacement, abs=1e-12)
    assert filtered.at_a.covariance == pytest.approx(before.covariance, abs=1e-12)


def test_a_copy_goes_its_own_way() -> None:
    filtered = followed(3)
    before = filtered.at_a.displacement
    other = filtered.copy()
    other.observe(5.0, a=Observation(ACROSS_A, np.array([0.01, 0.01]), NOISE))
    other.mark_a(5.0)
    assert filtered.at_a.displacement == pytest.approx(before, abs=0.0)
