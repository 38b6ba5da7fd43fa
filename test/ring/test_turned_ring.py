"""A ring that the heartbeat tilts by more than an alignment mends is looked at once more, from afar."""

from dataclasses import replace

import pytest
from support.breathing_lasso import CONFIG, WARM, centre_error_mm, moved
from support.lasso_inputs import curve_pair, turned

from lasso_motion_ros.config.ring import JudgementConfig
from lasso_motion_ros.ring.detector import DetectorTuning


def turned_pair(index, turn_deg):
    """A pair in which the ring lies turned by (3,) degrees about its centre."""
    return curve_pair(index, turned(turn_deg) + moved(index))


@pytest.mark.parametrize("turn_deg", [(7.0, 0.0, 0.0), (0.0, -7.5, 0.0), (-5.0, 5.0, 2.0), (0.0, 0.0, 7.5)])
def test_a_ring_that_has_turned_much_is_found(tracker, turn_deg):
    for index in (WARM, WARM + 1):
        result = tracker.track(turned_pair(index, turn_deg))
        assert result.motion is not None, result.reason
        assert centre_error_mm(result, moved(index)) < 0.4


@pytest.mark.parametrize("from_afar", [True, False])
def test_without_a_look_from_afar_a_ring_that_turned_more_is_lost(tracker, from_afar):
    tracker.reconfigure(replace(CONFIG, judgement=JudgementConfig(degraded_turn_deg=25.0, lost_turn_deg=30.0)))
    tracker._track.detector._tuning = DetectorTuning(from_afar=from_afar, electrodes=False)
    result = tracker.track(turned_pair(WARM, (12.0, 0.0, 0.0)))
    assert (result.motion is not None) == from_afar
