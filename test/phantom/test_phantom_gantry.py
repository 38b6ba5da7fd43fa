"""Projections under table pan, gantry turn, zoom and calibration error."""

import dataclasses

import numpy as np
import pytest

from lasso_motion_ros.phantom.gantry import progress, published_projection, true_projection
from lasso_motion_ros.phantom.settings import CalibrationSettings, Event, Scenario

POINTS = np.array([[0.01, -0.02, 0.015], [-0.03, 0.01, 0.0], [0.0, 0.0, 0.0], [0.02, 0.03, -0.04]])


def scenario(*events: Event, **changes: object) -> Scenario:
    return dataclasses.replace(Scenario(), pairs=20, events=events, **changes)


def test_progress_of_an_event() -> None:
    event = Event(kind="move", first=4, last=7)
    assert [progress(event, pair) for pair in (3, 4, 5, 7, 12)] == [0.0, 0.25, 0.5, 1.0, 1.0]
    assert progress(Event(kind="zoom", first=4), 4) == 1.0


def test_a_table_pan_moves_the_patient_past_the_gantry() -> None:
    shifted = scenario(Event(kind="table_pan", first=5, shift_mm=(10.0, 0.0, -20.0)))
    before, after = (true_projection(shifted, "a", pair) for pair in (4, 5))
    assert after.project(POINTS) == pytest.approx(before.project(POINTS + np.array([0.010, 0.0, -0.020])))


def test_a_gantry_turn_is_the_carm_at_the_new_angles() -> None:
    turned = scenario(Event(kind="gantry_turn", first=5, last=6, plane="a", lao_deg=-10.0, cranial_deg=6.0))
    direction = true_projection(turned, "a", 6).viewing_direction
    lao, cranial = np.arctan2(direction[0], -direction[1]), np.arcsin(direction[2])
    assert np.degrees([lao, cranial]) == pytest.approx([-40.0, 6.0])
    assert np.degrees(np.arcsin(true_projection(turned, "a", 5).viewing_direction[2])) == pytest.approx(3.0)
    assert true_projection(turned, "b", 6).matrix == pytest.approx(true_projection(turned, "b", 0).matrix)


def test_zoom_magnifies_about_the_middle_of_the_picture() -> None:
    zoomed = scenario(Event(kind="zoom", first=5, plane="b", factor=1.25))
    before, after = (true_projection(zoomed, "b", pair).project(POINTS) - 511.5 for pair in (4, 5))
    assert after == pytest.approx(1.25 * before)


@pytest.mark.parametrize(
    "event",
    [
        Event(kind="table_pan", first=5, shift_mm=(10.0, 0.0, 0.0), calibrated=False),
        Event(kind="gantry_turn", first=5, lao_deg=5.0, calibrated=False),
        Event(kind="zoom", first=5, factor=1.2, calibrated=False),
    ],
)
def test_an_uncalibrated_event_is_not_published(event: Event) -> None:
    silent = scenario(event)
    assert published_projection(silent, "a", 6).matrix == pytest.approx(true_projection(silent, "a", 0).matrix)
    assert not np.allclose(true_projection(silent, "a", 6).matrix, true_projection(silent, "a", 0).matrix)
    told = scenario(dataclasses.replace(event, calibrated=True))
    assert published_projection(told, "a", 6).matrix == pytest.approx(true_projection(told, "a", 6).matrix)


def test_calibration_error_has_the_size_asked_for() -> None:
    def pair(**error: float) -> tuple:
        off = scenario(calibration_error=CalibrationSettings(**error))
        return true_projection(off, "a", 0), published_projection(off, "a", 0), published_projection(off, "b", 0)

    true, published, _ = pair()
    assert published.matrix == pytest.approx(true.matrix)
    true, published, other = pair(shift_px=1.5)
    shift = published.project(POINTS) - true.project(POINTS)
    assert np.linalg.norm(shift, axis=1) == pytest.approx(1.5)
    assert np.ptp(shift, axis=0) == pytest.approx(0.0, abs=1e-9)
    true, published, _ = pair(shift_mm=2.0)
    assert np.linalg.norm(published.source - true.source) == pytest.approx(2.0e-3)
    true, published, _ = pair(angle_deg=0.5)
    assert np.linalg.norm(published.source) == pytest.approx(np.linalg.norm(true.source))
    turn = np.linalg.inv(true.decompose()[1]) @ published.decompose()[1]
    assert np.degrees(np.arccos((np.trace(turn) - 1) / 2)) == pytest.approx(0.5, rel=1e-3)
    del other
