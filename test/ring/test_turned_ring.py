"""A ring that the heartbeat tilts by more than an alignment mends is looked at once more, from afar."""

import copy

import numpy as np
import pytest
from support.breathing_lasso import WARM, centre_error_mm, moved, warm_up
from support.lasso_inputs import CURVE, LOOP, PERIOD_NS, VIEWS, lasso_image, noisy

from lasso_motion_ros.geometry.frames import Frame, FramePair
from lasso_motion_ros.geometry.transforms import rotation_from_vector
from lasso_motion_ros.ring import loop_finder


def turned_pair(index, turn_deg):
    """A pair in which the ring lies turned by (3,) degrees about its centre."""
    arms = (CURVE - LOOP.centre) @ rotation_from_vector(np.radians(turn_deg)).T
    frames = {
        p: Frame(
            index * PERIOD_NS, noisy(lasso_image(LOOP.centre + moved(index) + arms, VIEWS[p]), [index, 3]), VIEWS[p]
        )
        for p in "ab"
    }
    return FramePair(index * PERIOD_NS, frames["a"], frames["b"])


@pytest.mark.parametrize("turn_deg", [(7.0, 0.0, 0.0), (0.0, -7.5, 0.0), (-5.0, 5.0, 2.0), (0.0, 0.0, 7.5)])
def test_a_ring_that_has_turned_much_is_found(turn_deg):
    tracker = copy.deepcopy(warm_up()[0])
    for index in (WARM, WARM + 1):
        result = tracker.track(turned_pair(index, turn_deg))
        assert result.motion is not None, result.reason
        assert centre_error_mm(result, moved(index)) < 0.4


def test_without_a_second_look_it_is_not(monkeypatch):
    monkeypatch.setattr(loop_finder, "AFAR_CANDIDATES", 0)
    assert copy.deepcopy(warm_up()[0]).track(turned_pair(WARM, (-5.0, 5.0, 2.0))).motion is None
