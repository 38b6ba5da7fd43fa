"""Of all circles in space the ring's is found, edge-on in a plane, beside long wires, with plane B late or off, too."""

from __future__ import annotations

import numpy as np
import pytest
from support.lasso_inputs import lasso_curve, lasso_image, noisy
from support.method_inputs import draw_curve
from support.tracking_inputs import LOOP, VIEWS

from lasso_motion_ros.geometry.frames import Frame, Plane
from lasso_motion_ros.geometry.transforms import rotation_from_vector
from lasso_motion_ros.initialisation.circle_fit import find_circles, line_beyond, off_calibration
from lasso_motion_ros.initialisation.circles import Circles
from lasso_motion_ros.initialisation.direction_maps import DirectionMaps, curvature, direction_maps
from lasso_motion_ros.initialisation.epipolar_grid import EpipolarGrid
from lasso_motion_ros.initialisation.laid_image import LaidImage, row_range

ELSEWHERE = np.array([0.0, 0.0, 0.5])
UP = np.array([0.0, 0.0, 4e-3])
OFF = np.array([0.0, 0.0, 3e-3])
BEST = 3  # of which models are made first
RADIUS = float(np.linalg.norm(LOOP.semi_major))


def _tilted(normal: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The lasso's curve (N, 3), turned so that its axis is `normal`, and that axis."""
    normal = normal / np.linalg.norm(normal)
    axis = np.cross(LOOP.normal, normal)
    turn = rotation_from_vector(axis / np.linalg.norm(axis) * np.arccos(np.clip(LOOP.normal @ normal, -1.0, 1.0)))
    return LOOP.centre + (lasso_curve() - LOOP.centre) @ turn.T, normal


def _shown(
    curve: np.ndarray, lift: np.ndarray, *, wires: bool = False, faint: bool = False, noise: int = 0
) -> tuple[dict[Plane, DirectionMaps], EpipolarGrid]:
    """The lines of two drawn images, of which plane B sees the curve lifted, and the grid on which they lie."""
    frames: dict[Plane, Frame] = {}
    for plane, view in VIEWS.items():
        image = lasso_image(curve + lift if plane == "b" else curve, view)
        if wires:
            for x in (190.0, 300.0, 330.0):
                line = np.array([[x, -20.0], [x + 25.0, 250.0], [x - 15.0, 530.0]])
                image = draw_curve(line, image.shape, sigma_px=1.6, background=image, depth=45.0)
        if faint:
            background = lasso_image(curve + ELSEWHERE, view).astype(np.float64)
            image = (background + 0.17 * (image - background)).astype(np.uint8)
        frames[plane] = Frame(0, noisy(image, ord(plane) + noise), view)
    grid = EpipolarGrid.of(VIEWS)
    rows = row_range(frames, grid)
    maps = {
        plane: direction_maps(curvature(LaidImage.of(frame, plane, grid, rows, logarithm=True)), bright=False)
        for plane, frame in frames.items()
    }
    return maps, grid


def test_a_long_line_goes_on_beyond_both_ends_of_a_circle_that_is_edge_on_and_a_shaft_beyond_one() -> None:
    grid = EpipolarGrid.of(VIEWS)
    normal = np.cross(grid.view["b"], grid.sideways["b"])
    circle = Circles(LOOP.centre[None], normal[None], np.array([RADIUS]), np.zeros(1), np.zeros(1))
    curve, _ = _tilted(normal)
    away = VIEWS["b"].project(curve)
    ends = away[[away[:, 0].argmin(), away[:, 0].argmax()]]
    step = (ends[1] - ends[0]) / np.linalg.norm(ends[1] - ends[0])

    def beyond(left_px: float, right_px: float) -> float:
        frames = {}
        for plane, view in VIEWS.items():
            image = lasso_image(curve, view)
            if plane == "b" and (left_px or right_px):
                line = np.array([ends[0] - left_px * step, ends[1] + right_px * step])
                image = draw_curve(line, image.shape, sigma_px=1.6, background=image, depth=45.0)
            frames[plane] = Frame(0, noisy(image, ord(plane)), view)
        rows = row_range(frames, grid)
        laid = {p: LaidImage.of(frame, p, grid, rows, logarithm=True) for p, frame in frames.items()}
        maps = {plane: direction_maps(curvature(one), bright=False) for plane, one in laid.items()}
        return float(line_beyond(circle, maps, grid)[0])

    assert beyond(120.0, 120.0) > 0.8
    assert beyond(120.0, 0.0) < 0.4
    assert beyond(0.0, 0.0) < 0.4


@pytest.mark.parametrize("case", ["open", "edge-on", "nearly edge-on", "wires", "late"])
def test_one_of_the_best_of_all_circles_lies_on_the_ring(case: str) -> None:
    view = VIEWS["b"].source - LOOP.centre
    edge_on = np.cross(view, [0.2, 0.1, 1.0])
    nearly = edge_on / np.linalg.norm(edge_on) + 0.2 * view / np.linalg.norm(view)
    curve, normal = _tilted({"edge-on": edge_on, "nearly edge-on": nearly}.get(case, LOOP.normal + 1e-6))
    lift = UP if case == "late" else np.zeros(3)
    circles = find_circles(*_shown(curve, lift, wires=case == "wires"), 0.17 if case == "late" else 0.0)
    away = np.linalg.norm(circles.centres[:BEST] - curve.mean(axis=0), axis=1)
    aligned = np.abs(circles.normals[:BEST] @ normal) > np.cos(np.radians(8.0))
    on = np.flatnonzero((away < 1.2e-3) & aligned)
    assert len(on)
    assert circles.radii[on[0]] == pytest.approx(RADIUS, rel=0.08)
    if case == "late":
        up = EpipolarGrid.of(VIEWS).upward
        assert circles.lifts[on[0]] == pytest.approx(float(UP @ up), abs=1.5e-3)  # a step of the search


def test_the_best_circle_lies_on_a_faint_ring_not_on_a_part_of_it() -> None:
    curve, normal = _tilted(np.array([2.04, -2.56, 0.42]))
    circles = find_circles(*_shown(curve, np.zeros(3), faint=True, noise=3), 0.0)
    assert np.linalg.norm(circles.centres[0] - curve.mean(axis=0)) < 1.2e-3
    assert abs(circles.normals[0] @ normal) > np.cos(np.radians(8.0))


def test_where_planes_are_off_their_calibration_a_circle_that_is_let_go_comes_nearer_to_the_ring() -> None:
    curve, _ = _tilted(LOOP.normal + 1e-6)
    shown, grid = _shown(curve, OFF)

    def away(circles: Circles) -> np.ndarray:
        return np.asarray(np.linalg.norm(circles.centres - curve.mean(axis=0), axis=1))

    held = find_circles(shown, grid, 0.0)
    best = off_calibration(held, shown, grid, 0.0)[:1]
    assert away(best) < 0.8e-3 < away(held).min()
    assert best.lifts > held.lifts[away(held).argmin()] + 0.5e-3
    assert best.lifts == pytest.approx(float(OFF @ grid.upward), abs=1.2e-3)
    assert not len(off_calibration(held, shown, grid, 0.17))  # where plane B is exposed later none is held


def test_where_planes_are_as_calibrated_none_is_taken_away_from_the_ring() -> None:
    curve, _ = _tilted(LOOP.normal + 1e-6)
    shown, grid = _shown(curve, np.zeros(3))
    off = off_calibration(find_circles(shown, grid, 0.0), shown, grid, 0.0)
    assert np.all(np.linalg.norm(off.centres - curve.mean(axis=0), axis=1) > 1.2e-3)


def test_circles_that_are_told_apart_are_the_best_of_their_neighbours() -> None:
    normals = np.array([[0.0, 0.0, 1.0]] * 3 + [[1.0, 0.0, 0.0]])
    centres = np.array([[0.0, 0.0, 0.0], [1e-3, 0.0, 0.0], [9e-3, 0.0, 0.0], [0.0, 0.0, 0.0]])
    scores = np.array([0.5, 0.9, 0.4, 0.3])
    circles = Circles(centres, normals, np.full(4, 0.01), np.zeros(4), scores)
    assert circles.distinct(4, 3e-3, 0.9).scores.tolist() == [0.9, 0.4, 0.3]
    assert circles.distinct(2, 3e-3, 0.9).scores.tolist() == [0.9, 0.4]


@pytest.mark.parametrize("count", [1, 40, 10_000])
def test_circles_are_told_apart_however_many_there_are(count: int) -> None:
    random = np.random.default_rng(7)
    normals = random.normal(size=(1_000, 3))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    centres, scores = random.uniform(-0.01, 0.01, (1_000, 3)), np.round(random.uniform(size=1_000), 2)
    circles = Circles(centres, normals, np.full(1_000, 0.01), np.zeros(1_000), scores)
    expected: list[int] = []
    for k in np.argsort(-scores, kind="stable").tolist():
        is_same = (np.linalg.norm(centres[expected] - centres[k], axis=1) < 3e-3) & (
            np.abs(normals[expected] @ normals[k]) > 0.6
        )
        if len(expected) < count and not is_same.any():
            expected.append(k)
    assert circles.distinct_numbers(count, 3e-3, 0.6).tolist() == expected
