"""A seed is refused where its own images show the ring elsewhere, and taken where it was clicked."""

from types import SimpleNamespace

import numpy as np
import pytest
from support.breathing_lasso import CONFIG
from support.lasso_inputs import VIEWS, lasso_pair, lasso_seed
from support.ring_fits import detection_at

from lasso_motion_ros.core.errors import SeedError
from lasso_motion_ros.ring.detector import RingDetector
from lasso_motion_ros.ring.seed_place import require_clicked_place
from lasso_motion_ros.ring.tracker import RingTracker

WHY = r"as plainly \d\.\d mm aside in plane B: was the same loop clicked in both planes"
CENTRE = np.array([0.005, -0.010, 0.020])
MODEL = SimpleNamespace(centre=CENTRE)


def toward_a(centre, way_m=6e-3):
    """A place that plane A sees where it sees another, and plane B does not."""
    ray = centre - VIEWS["a"].source
    return centre + way_m * ray / np.linalg.norm(ray)


def test_the_best_place_counts_by_hand():
    here, there = detection_at(CENTRE), detection_at(toward_a(CENTRE))
    require_clicked_place([here, there], MODEL)  # its like may lie beside it
    require_clicked_place([], MODEL)
    with pytest.raises(SeedError, match=WHY):
        require_clicked_place([there, here], MODEL)


def test_a_second_lasso_is_elsewhere_in_both_planes_and_may_show_more():
    require_clicked_place([detection_at(CENTRE + np.array([0.02, 0.02, 0.01])), detection_at(CENTRE)], MODEL)


def test_a_refused_place_leaves_no_model(monkeypatch):
    centre = RingTracker(CONFIG)
    centre.initialise(lasso_pair(0), lasso_seed())
    ring = centre._track.model.centre
    monkeypatch.setattr(RingDetector, "detect", lambda *_: [detection_at(toward_a(ring))])
    tracker = RingTracker(CONFIG)
    with pytest.raises(SeedError, match=WHY):
        tracker.initialise(lasso_pair(0), lasso_seed())
    assert tracker._track is None
