import dataclasses

import numpy as np
import pytest

from lasso_motion_ros.config.ring import JudgementConfig
from lasso_motion_ros.geometry.frames import Frame, FramePair
from lasso_motion_ros.geometry.projection import Projection
from lasso_motion_ros.ring.alignment import Alignment
from lasso_motion_ros.ring.finding import Finding
from lasso_motion_ros.ring.loop_views import PlaneFit
from lasso_motion_ros.ring.verdict import refusal_of, state_of
from lasso_motion_ros.tracking.tracker import TrackerState

CONFIG = JudgementConfig(one_plane_s=3.0, degraded_turn_deg=6.0, lost_turn_deg=8.0, full_visible=0.8)
VIEW = Projection(np.array([[900.0, 0.0, 64.0, 50.0], [0.0, 900.0, 64.0, 50.0], [0.0, 0.0, 1.0, 0.8]]), 8, 8)
FRAME = Frame(0, np.zeros((8, 8), np.uint8), VIEW)
BOTH, ONLY_A = FramePair(0, FRAME, FRAME), FramePair(0, FRAME, None)
FIT = PlaneFit(np.zeros(3), np.eye(3)[:2], 1e-10 * np.eye(2), 0.2, 0.9, 1.0, 1.0, 0.1, np.zeros((1, 13), np.float32))


class Views:
    """What the planes showed."""

    def __init__(self, *of_planes):
        self._fits = of_planes

    def fits(self, covariance):
        return self._fits


ALIGNMENT = Alignment({"a": 1.0, "b": 1.0}, np.zeros(3), 0.0, (0.9,), False, Views(FIT, FIT), np.eye(8))
GOOD = Finding(ALIGNMENT, ("a", "b"), None, False, 0.1, 0.8, 1.6)
BY_A = dataclasses.replace(GOOD, seen=("a",))


def state(finding=GOOD, pair=BOTH, *, alone_s=0.0, turned_deg=0.0):
    return state_of(finding, pair, CONFIG, alone_s=alone_s, turned_deg=turned_deg)


@pytest.mark.parametrize(
    ("change", "followed", "expected"),
    [
        ({}, True, ""),
        ({"gap_mm": 1.6}, True, ""),
        ({"gap_mm": 1.7}, True, "the planes disagree by 1.7 mm: moved C-arm without a new calibration?"),
        ({"faint": "b", "gap_mm": 0.7}, True, ""),
        ({"faint": "b", "gap_mm": 0.6}, False, ""),
        (
            {"faint": "b", "gap_mm": 0.7},
            False,
            "plane B shows the lasso only faintly, and not quite where the other does",
        ),
        (
            {"seen": ("b",)},
            True,
            "plane A does not show the lasso: hidden there, or moved C-arm without a new calibration?",
        ),
    ],
)
def test_refusals(change, followed, expected):
    assert refusal_of(dataclasses.replace(GOOD, **change), BOTH, followed=followed) == expected


def test_a_plane_that_was_not_exposed_is_borne_while_the_lasso_is_followed():
    assert refusal_of(BY_A, ONLY_A, followed=True) == ""
    assert refusal_of(BY_A, ONLY_A, followed=False) == "plane B missing: after a loss both have to show the lasso"
    assert state(BY_A, ONLY_A, alone_s=3.0) == (
        TrackerState.DEGRADED,
        "plane B missing: depth from the breathing so far",
    )
    assert state(BY_A, ONLY_A, alone_s=3.1) == (TrackerState.LOST, "plane B missing for 3.1 s")


@pytest.mark.parametrize(
    ("change", "asked", "expected", "said"),
    [
        ({}, {}, TrackerState.TRACKING, ""),
        ({}, {"turned_deg": 6.0}, TrackerState.TRACKING, ""),
        ({}, {"turned_deg": 6.1}, TrackerState.DEGRADED, "turned by 6 degrees"),
        ({}, {"turned_deg": 8.1}, TrackerState.LOST, "turned by 8 degrees"),
        ({"faint": "a"}, {}, TrackerState.DEGRADED, "plane A shows the lasso only faintly"),
        ({"edge_on": True}, {}, TrackerState.DEGRADED, "edge-on in both planes"),
        ({"gap_mm": 0.8}, {}, TrackerState.TRACKING, ""),
        ({"gap_mm": 0.9}, {}, TrackerState.DEGRADED, "the planes disagree by 0.9 mm"),
    ],
)
def test_states(change, asked, expected, said):
    found, reason = state(dataclasses.replace(GOOD, **change), **asked)
    assert found is expected
    assert said in reason
    assert (reason == "") == (found is TrackerState.TRACKING)


def test_a_part_that_is_not_seen_is_said():
    views = Views(FIT, dataclasses.replace(FIT, visible=0.79))
    finding = dataclasses.replace(GOOD, alignment=dataclasses.replace(ALIGNMENT, views=views))
    assert state(finding) == (TrackerState.DEGRADED, "only 79 % of the lasso is seen")
