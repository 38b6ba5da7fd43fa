"""The loop's shape and its own deformation; seeds; catheters that follow the heart."""

import dataclasses

import numpy as np
import pytest

from lasso_motion_ros.geometry.transforms import rigid
from lasso_motion_ros.phantom.catheters import (
    SEPTUM,
    build_loop,
    deformed_loop,
    electrode,
    followed,
    lasso_shaft,
    loop_segments,
    spline,
)
from lasso_motion_ros.phantom.distractors import distractor_segments
from lasso_motion_ros.phantom.seeds import clicks_along_loop
from lasso_motion_ros.phantom.settings import DistractorSettings, LassoSettings

LASSO = LassoSettings(centre_mm=(10.0, 5.0, 8.0), normal=(0.0, 0.0, 1.0), diameter_mm=20.0, turns=0.85, helix_mm=1.4)


@pytest.mark.parametrize("turns", [0.85, 1.25])
def test_the_loop_has_its_length_centre_and_rise(turns: float) -> None:
    loop = build_loop(dataclasses.replace(LASSO, turns=turns), SEPTUM)
    assert loop.points.shape == (90, 3)
    steps = np.linalg.norm(np.diff(loop.points, axis=0), axis=1)
    assert steps.sum() == pytest.approx(turns * np.pi * 0.020, rel=0.04)  # winds inside itself
    assert np.ptp(steps) < 1e-5
    assert loop.points.mean(axis=0) == pytest.approx([0.010, 0.005, 0.008], abs=1e-12)
    assert np.ptp(loop.points @ loop.normal) == pytest.approx(1.4e-3, rel=1e-3)
    # The gap of an open loop, or the overlap of a longer one, is what is missing of whole turns.
    ends = loop.points[[0, -1]] - loop.points[[0, -1]].mean(axis=0)
    assert np.linalg.norm(ends[0] - ends[1]) == pytest.approx(
        0.020 * np.sin(np.pi * abs(1 - turns)), rel=0.1, abs=1.5e-3
    )


def test_the_loops_axis_points_to_the_shaft() -> None:
    for normal in ((0.0, 0.0, 1.0), (0.0, 0.0, -1.0)):
        loop = build_loop(dataclasses.replace(LASSO, normal=normal), SEPTUM)
        assert loop.normal @ (SEPTUM - loop.centre) > 0
        # The rise ends at the shaft's side.
        assert (loop.points[-1] - loop.points[0]) @ loop.normal > 0


def test_own_tilt_and_stretch_leave_the_centre() -> None:
    loop = build_loop(LASSO, SEPTUM)
    assert deformed_loop(loop, 0.0, 0.0) == pytest.approx(loop.points, abs=1e-15)
    moved = deformed_loop(loop, np.radians(3.0), 0.02)
    assert moved.mean(axis=0) == pytest.approx(loop.centre, abs=1e-12)
    radius = np.linalg.norm(deformed_loop(loop, 0.0, 0.02) - loop.centre, axis=1)
    assert radius == pytest.approx(1.02 * np.linalg.norm(loop.points - loop.centre, axis=1), rel=5e-4)
    tilted = deformed_loop(loop, np.radians(3.0), 0.0) - loop.centre
    height = np.cross(loop.across, loop.points - loop.centre) @ loop.normal
    in_plane = loop.points - loop.centre
    expected = (in_plane @ loop.normal) * np.cos(np.radians(3.0)) + height * np.sin(np.radians(3.0))
    assert tilted @ loop.normal == pytest.approx(expected, abs=1e-12)


@pytest.mark.parametrize("count", [0, 10, 20])
def test_electrodes_are_short_flat_cylinders_on_the_loop(count: int) -> None:
    loop = build_loop(LASSO, SEPTUM)
    segments = loop_segments(loop.points, LassoSettings(electrodes=count))
    rings = segments.radius > 0.5e-3
    assert rings.sum() == count
    length = np.linalg.norm(segments.end - segments.start, axis=1)[rings]
    assert length == pytest.approx(1.0e-3, rel=0.01)
    for middle in 0.5 * (segments.start + segments.end)[rings]:
        assert np.linalg.norm(loop.points - middle, axis=1).min() < 0.4e-3


def test_curves() -> None:
    line = np.array([[0.0, 0, 0], [1.0, 0, 0], [3.0, 0, 0]])
    ring = electrode(line, 1.5, 1.0, 0.1, 5.0)
    assert (ring.start[0, 0], ring.end[0, 0]) == pytest.approx((1.0, 2.0))
    smooth = spline(line * 0.01)
    assert (smooth[0, 0], smooth[-1, 0]) == pytest.approx((0.0, 0.03))


def test_the_shaft_starts_at_the_loop_and_ends_at_rest() -> None:
    loop = build_loop(LASSO, SEPTUM)
    motion = rigid((0, 0, 0), (0, 0, -0.02))
    still = lasso_shaft(loop.points, loop.normal, np.eye(4))
    moved = lasso_shaft(loop.points + np.array([0, 0, -0.02]), loop.normal, motion)
    assert still[0] == pytest.approx(loop.points[-1])
    assert moved[0] - still[0] == pytest.approx([0, 0, -0.02])
    assert moved[-1] == pytest.approx(still[-1])
    assert followed(np.zeros(3), 0.5, motion) == pytest.approx([0, 0, -0.01])


@pytest.mark.parametrize("turns", [0.85, 1.0, 1.25])
def test_seeds_are_clicks_along_the_loop(turns: float) -> None:
    angle = np.linspace(0.0, 2 * np.pi * turns, 90)
    curve = 500.0 + 80.0 * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    counts, starts, senses, errors = set(), [], set(), []
    for seed in range(60):
        clicks = clicks_along_loop(curve, turns, np.random.default_rng(seed))
        counts.add(len(clicks))
        offset = clicks - 500.0
        errors.append(np.linalg.norm(offset, axis=1) - 80.0)
        swept = np.unwrap(np.arctan2(offset[:, 1], offset[:, 0]))
        senses.add(np.sign(swept[-1] - swept[0]))
        # In order along the loop, once round at the most.
        assert np.all(np.sign(np.diff(swept)) == np.sign(swept[-1] - swept[0])) or turns == 1.25
        starts.append(swept[0] % (2 * np.pi))
    assert counts == set(range(8, 15))
    assert senses == {-1.0, 1.0}
    if turns == 1.0:
        assert np.std(starts) > 1.0
    assert np.std(np.concatenate(errors)) == pytest.approx(1.5, rel=0.1)


def test_every_distractor_adds_something() -> None:
    assert len(distractor_segments(DistractorSettings(), np.eye(4), np.zeros(3))) == 0
    for change in ({"sternal_wires": 2}, {"ecg_leads": 1}, {"oesophageal_probe": True}, {"second_ring": True}):
        settings = dataclasses.replace(DistractorSettings(), **change)
        assert len(distractor_segments(settings, np.eye(4), np.zeros(3))) > 10
