"""The live picture: the curve where it projects, the state in its colour, for any bit depth and size."""

import numpy as np
import pytest
from support.rendering_inputs import views

from lasso_motion_ros.geometry.frames import Frame
from lasso_motion_ros.geometry.projection import Projection
from lasso_motion_ros.overlay.tracking_picture import CLICK_COLOUR, PROPOSAL_COLOUR, STATE_COLOURS, draw_tracking
from lasso_motion_ros.overlay.windowing import window_image
from lasso_motion_ros.tracking.tracker import TrackerState

VIEW = views()["plain"]
ANGLE = np.linspace(0.0, 2.0 * np.pi, 64)
LOOP = 0.02 * np.stack([np.cos(ANGLE), 0.0 * ANGLE, np.sin(ANGLE)], axis=1)


def frame(size=512, dtype=np.uint8):
    scale = size / 512
    projection = Projection(np.diag([scale, scale, 1.0]) @ VIEW.matrix, size, size)
    noise = np.random.default_rng(0).integers(60, 200, (size, size))
    return Frame(0, (noise * (16 if dtype == np.uint16 else 1)).astype(dtype), projection)


def is_near(picture, point, colour, reach=1, tolerance=150):
    x, y = np.rint(point).astype(int)
    patch = picture[y - reach : y + reach + 1, x - reach : x + reach + 1].astype(int)
    return np.abs(patch - np.array(colour)).sum(axis=-1).min() < tolerance


@pytest.mark.parametrize("size", [512, 1024])
@pytest.mark.parametrize("dtype", [np.uint8, np.uint16])
@pytest.mark.parametrize("state", ["TRACKING", "DEGRADED"])
def test_the_loop_lies_where_it_projects_in_the_colour_of_the_state(size, dtype, state):
    shown = frame(size, dtype)
    picture = draw_tracking(shown, LOOP, state)
    assert picture.shape == (size, size, 3)
    colour = STATE_COLOURS[TrackerState(state)]
    assert all(is_near(picture, point, colour) for point in shown.projection.project(LOOP[::4]))
    # Thin: of what the loop encloses, nearly all is film.
    grey = window_image(shown.pixels)
    assert (picture[size // 2, size // 2] == grey[size // 2, size // 2]).all()


@pytest.mark.parametrize("state", ["LOST", "DISPLACED", "WAITING_FOR_SEED", "INACTIVE"])
def test_no_curve_is_drawn_in_a_state_without_a_pose(state):
    with_loop, without = (draw_tracking(frame(), loop, state, "why") for loop in (LOOP, None))
    np.testing.assert_array_equal(with_loop, without)


@pytest.mark.parametrize("state", ["WAITING_FOR_SEED", "LOST", "DISPLACED"])
def test_a_proposed_ring_is_drawn_in_its_own_colour_while_there_is_no_pose_only(state):
    shown = frame()
    picture = draw_tracking(shown, None, state, proposed=[LOOP])
    assert all(is_near(picture, point, PROPOSAL_COLOUR) for point in shown.projection.project(LOOP[::4]))
    with_ring, without = (draw_tracking(shown, LOOP, "TRACKING", proposed=rings) for rings in ([LOOP], []))
    np.testing.assert_array_equal(with_ring, without)


@pytest.mark.parametrize("state", list(TrackerState))
def test_every_state_is_written_in_its_colour(state):
    picture = draw_tracking(frame(), None, state)
    corner = picture[:40, :300].astype(int)
    matches = np.abs(corner - np.array(STATE_COLOURS[state])).sum(axis=-1) < 60
    assert matches[:, 6:].sum() > 25  # the words; the bar at the very left is not counted


def test_the_reason_stands_under_the_state_and_is_cut_to_fit():
    plain = draw_tracking(frame(), None, "LOST")
    short = draw_tracking(frame(), None, "LOST", "no lasso seen")
    long = draw_tracking(frame(), None, "LOST", "no lasso seen " * 30)
    lowest = [
        np.flatnonzero((p != draw_tracking(frame(), None, "TRACKING")).any(axis=(1, 2))).max() for p in (plain, short)
    ]
    assert lowest[1] > lowest[0] + 8
    assert long.shape == short.shape


def test_clicks_are_marked():
    clicks = np.array([[200.0, 300.0], [250.4, 320.6], [np.nan, 1.0]])
    picture = draw_tracking(frame(), None, "WAITING_FOR_SEED", clicks=clicks)
    assert all(is_near(picture, click, CLICK_COLOUR) for click in clicks[:2])


def test_an_unknown_state_is_an_error():
    with pytest.raises(ValueError, match="ASLEEP"):
        draw_tracking(frame(), None, "ASLEEP")
