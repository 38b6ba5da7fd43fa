"""A ring that the heartbeat tilts by more than an alignment mends is looked at once more, from afar."""

import pytest
from support.breathing_lasso import WARM, centre_error_mm, moved
from support.lasso_inputs import curve_pair, turned

from lasso_motion_ros.ring import loop_finder


def turned_pair(index, turn_deg):
    """A pair in which the ring lies turned by (3,) degrees about its centre."""
    return curve_pair(index, turned(turn_deg) + moved(index))


@pytest.mark.parametrize("turn_deg", [(7.0, 0.0, 0.0), (0.0, -7.5, 0.0), (-5.0, 5.0, 2.0), (0.0, 0.0, 7.5)])
def test_a_ring_that_has_turned_much_is_found(tracker, turn_deg):
    for index in (WARM, WARM + 1):
        result = tracker.track(turned_pair(index, turn_deg))
        assert result.motion is not None, result.reason
        assert centre_error_mm(result, moved(index)) < 0.4


def test_without_a_second_look_it_is_not(monkeypatch, tracker):
    monkeypatch.setattr(loop_finder, "AFAR_CANDIDATES", 0)
    assert tracker.track(turned_pair(WARM, (-5.0, 5.0, 2.0))).motion is None
