"""The worst frames: which they are, and that the curves are drawn where they lie in the image."""

import dataclasses

import cv2
import numpy as np
import pytest
from support.drawn_recording import loop, projections, shift, stamp
from support.method_inputs import draw_curve

from lasso_motion_ros.evaluation.measures import PairEstimate, PairScore, PairTruth
from lasso_motion_ros.geometry.frames import Frame, FramePair
from lasso_motion_ros.geometry.transforms import apply
from lasso_motion_ros.reports.worst_frames import (
    MODEL_COLOUR,
    TRUE_COLOUR,
    TUNING,
    error_mm,
    worst_pairs,
    worst_picture,
)

PLAIN = PairScore(0, 0, False, expected=True, hidden=False, displaced=False, has_pose=True, state="TRACKING")


def off_by(index, millimetres, **changes):
    return dataclasses.replace(
        PLAIN, index=index, true_centre_m=np.zeros(3), centre_m=np.array([0.0, 1e-3 * millimetres, 0.0]), **changes
    )


def test_false_poses_come_first_then_the_largest_errors():
    scores = [
        off_by(0, 50.0, is_reference=True),
        off_by(1, 1.0),
        off_by(2, 3.0),
        off_by(3, 0.2, hidden=True),
        dataclasses.replace(PLAIN, index=4, has_pose=False),
        off_by(5, 2.0),
    ]
    assert [score.index for score in worst_pairs(scores, 3)] == [3, 2, 5]
    assert error_mm(scores[2]) == pytest.approx(3.0)


def test_without_truth_in_space_the_larger_plane_counts():
    scores = [
        dataclasses.replace(PLAIN, index=i, error_2d_mm={"a": a, "b": b}) for i, (a, b) in enumerate([(1, 2), (3, 0)])
    ]
    assert [score.index for score in worst_pairs(scores, 5)] == [1, 0]


def pair_at(z_mm, depth=np.uint8, planes="ab"):
    frames = {
        plane: Frame(
            stamp(0),
            (draw_curve(projection.project(apply(shift(z_mm), loop())), (512, 512), background=180.0)).astype(depth),
            projection,
        )
        for plane, projection in projections().items()
        if plane in planes
    }
    return FramePair(stamp(0), frames.get("a"), frames.get("b"))


def truth_at(z_mm):
    lines = {plane: p.project(apply(shift(z_mm), loop())) for plane, p in projections().items()}
    return PairTruth(stamp(0), centrelines=lines, projections=projections())


def pixels_of(picture, colour):
    return (np.abs(picture.astype(int) - colour).max(axis=2) < 40).sum()


@pytest.mark.parametrize("depth", [np.uint8, np.uint16])
def test_curves_lie_on_the_drawn_ring(depth):
    """The ring in the image is dark: a curve on it has dark pixels next to it all along, one beside it has few."""
    shares = []
    for z_mm in (0.0, 3.0):
        estimate = PairEstimate(stamp(0), "TRACKING", motion_raw=shift(z_mm), loop=apply(shift(z_mm), loop()))
        picture = worst_picture(pair_at(0.0, depth), truth_at(z_mm), estimate)[30:-60, : TUNING.cell_px]
        dark = cv2.dilate((picture.max(axis=2) < 60).astype(np.uint8), np.ones((7, 7)))
        drawn = np.abs(picture.astype(int) - MODEL_COLOUR).max(axis=2) < 40
        shares.append(dark[drawn].mean())
    assert shares[0] > 0.95
    assert shares[1] < 0.5


def test_both_curves_are_seen_where_they_differ():
    estimate = PairEstimate(stamp(0), "TRACKING", motion_raw=shift(2.0), loop=apply(shift(2.0), loop()))
    picture = worst_picture(pair_at(0.0), truth_at(0.0), estimate)
    assert pixels_of(picture, MODEL_COLOUR) > 300
    assert pixels_of(picture, TRUE_COLOUR) > 300


def test_a_missing_plane_and_a_missing_pose_are_said_not_drawn():
    picture = worst_picture(pair_at(0.0, planes="a"), truth_at(0.0), None)
    assert picture.shape[1] == 2 * TUNING.cell_px + 6
    assert pixels_of(picture[30:-60], MODEL_COLOUR) == 0
