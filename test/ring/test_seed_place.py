"""A seed is refused where its own images show the ring elsewhere, and taken where it was clicked."""

from types import SimpleNamespace

import numpy as np
import pytest
from support.breathing_lasso import CONFIG
from support.lasso_inputs import lasso_pair, lasso_seed
from support.ring_fits import detection_at

from lasso_motion_ros.core.errors import SeedError
from lasso_motion_ros.ring.detector import RingDetector
from lasso_motion_ros.ring.seed_place import require_clicked_place
from lasso_motion_ros.ring.tracker import RingTracker

CENTRE = np.array([0.005, -0.010, 0.020])
MODEL = SimpleNamespace(centre=CENTRE)
ASIDE = np.array([0.004, 0.005, 0.0])


def test_the_best_place_counts_by_hand():
    here, there = detection_at(CENTRE), detection_at(CENTRE + ASIDE)
    require_clicked_place([here, there], MODEL)  # its like may lie beside it
    require_clicked_place([], MODEL)
    with pytest.raises(SeedError, match=r"as plainly \d\.\d mm aside in plane [AB]: was the same loop clicked"):
        require_clicked_place([there, here], MODEL)


def test_a_refused_place_leaves_no_model(monkeypatch):
    centre = RingTracker(CONFIG)
    centre.initialise(lasso_pair(0), lasso_seed())
    ring = centre._track.model.centre
    monkeypatch.setattr(RingDetector, "detect", lambda *_: [detection_at(ring + ASIDE)])
    tracker = RingTracker(CONFIG)
    with pytest.raises(SeedError, match="mm aside in plane"):
        tracker.initialise(lasso_pair(0), lasso_seed())
    assert tracker._track is None
