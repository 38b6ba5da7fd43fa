"""A ring that the heartbeat tilts by more than an alignment mends is looked at once more, from afar."""

from dataclasses import replace

import pytest
from support.breathing_lasso import CONFIG, WARM, centre_error_mm, moved
from support.lasso_inputs import curve_pair, lasso_seed, turned

from lasso_motion_ros.config.ring import JudgementConfig
from lasso_motion_ros.ring.detector import DetectorTuning
from lasso_motion_ros.ring.tracker import RingTracker


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


def test_a_ring_that_the_heart_tilts_at_every_other_pair_keeps_its_poses():
    tracker = RingTracker(CONFIG)
    tracker.initialise(turned_pair(0, (0.0, 0.0, 0.0)), lasso_seed())
    results = [tracker.track(turned_pair(k, (8.6 * (k % 2), 0.0, 0.0))) for k in range(1, 13)]
    assert sum(result.motion is None for result in results) <= 2  # until it is known to
    assert all(result.motion is not None for result in results[4:])


def test_a_ring_that_is_turned_for_good_stays_lost(tracker):
    # As by a C-arm that has moved, which is no matter of getting used to.
    for k in range(12):
        result = tracker.track(turned_pair(WARM + k, (0.0, 0.0, 11.0)))
        assert result.motion is None
