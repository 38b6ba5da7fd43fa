"""A ring is carried to later pairs by its own electrodes; what does not move with it says nothing for it."""

from __future__ import annotations

import numpy as np
import pytest
from support.tracking_inputs import VIEWS

from lasso_motion_ros.initialisation.carried_rings import begun, carried
from lasso_motion_ros.initialisation.circles import Circles
from lasso_motion_ros.initialisation.electrode_spots import ElectrodePoints, Spots, points_of
from lasso_motion_ros.initialisation.epipolar_grid import EpipolarGrid
from lasso_motion_ros.initialisation.nearby_points import PointCloud
from lasso_motion_ros.initialisation.shaped_rings import ShapedRings

POLES = 10
CLUTTER = 1500
LIFT_M = 1.5e-3
RING = ShapedRings.of(
    Circles(np.array([[0.0, 0.005, -0.004]]), np.array([[0.6, 0.0, 0.8]]), np.array([0.011]), np.zeros(1), np.zeros(1))
)
MOVES = (np.zeros(3), np.array([3e-3, -2e-3, 11e-3]), np.array([5e-3, -3e-3, 26e-3]))


def _cloud(number: int, *, has_ring: bool = True) -> PointCloud:
    """A pair's points: those of a ring that has moved, and others anywhere."""
    random = np.random.default_rng(number)
    poles = (
        RING.points(2.0 * np.pi * np.arange(POLES) / POLES)[0] + MOVES[number] + random.normal(0.0, 0.1e-3, (POLES, 3))
    )
    others = random.uniform(-0.05, 0.05, (CLUTTER, 3))
    places = np.concatenate([poles, others]) if has_ring else others
    count = len(places)
    lifts = random.uniform(-LIFT_M, LIFT_M, count)
    lifts[: POLES if has_ring else 0] = 0.2e-3
    spots = np.stack([np.arange(count)] * 2, axis=1)
    return PointCloud(ElectrodePoints(places, lifts, random.uniform(2.0, 3.5, count), spots), LIFT_M)


def test_a_ring_that_moves_as_one_is_found_in_every_pair_and_says_more_than_in_one() -> None:
    clouds = [_cloud(number) for number in range(3)]
    rings, alone = begun(RING, clouds[0])
    together = carried(rings, clouds, is_later=False)
    assert together.evidence[0] > 2.0 * alone[0]
    for moved, move in zip(together.moved, MOVES, strict=True):
        assert moved[0, :3] == pytest.approx(move, abs=0.15e-3)
    assert together.rings.centres == pytest.approx(RING.centres, abs=0.2e-3)
    assert together.rings.radii == pytest.approx(RING.radii, abs=0.2e-3)
    assert together.rings.lifts == pytest.approx([0.2e-3], abs=0.05e-3)


def test_chance_does_not_repeat_itself() -> None:
    clouds = [_cloud(number) for number in range(3)]
    rings, alone = begun(RING, clouds[0])
    real = carried(rings, clouds, is_later=False).evidence
    by_chance = carried(rings, [clouds[0], *(_cloud(k, has_ring=False) for k in (1, 2))], is_later=False).evidence
    assert by_chance[0] - alone[0] < 0.25 * (real[0] - alone[0])


def test_a_ring_without_any_points_is_left_where_it_is() -> None:
    nothing = PointCloud(_cloud(0).points[:0], LIFT_M)
    still = carried(RING, [nothing, nothing], is_later=False)
    assert still.evidence.tolist() == [0.0]
    assert still.rings.centres == pytest.approx(RING.centres)
    assert still.moved[1].tolist() == [[0.0] * 4]


def test_a_long_line_in_one_plane_makes_a_ring_doubtful_and_its_own_electrodes_do_not() -> None:
    grid = EpipolarGrid.of(VIEWS)
    # Plane B sees it edge-on: each of its spots there meets two in plane A.
    normal = np.cross(grid.view["b"], grid.sideways["b"])
    edge_on = ShapedRings.of(Circles(grid.centre[None], normal[None], np.array([0.011]), np.zeros(1), np.zeros(1)))
    poles = edge_on.points(2.0 * np.pi * np.arange(POLES) / POLES)[0]
    laid = {plane: _laid(grid, plane, poles) for plane in VIEWS}
    random = np.random.default_rng(5)
    noise = random.uniform(-0.04, 0.04, (2, 900))
    line = np.linspace(-0.06, 0.06, 120)

    def evidence(spots: dict[str, Spots]) -> tuple[float, float]:
        clouds = [PointCloud(points_of(spots, grid, LIFT_M), LIFT_M)]
        before = carried(edge_on, clouds, is_later=False)
        return float(before.evidence[0]), float(before.questioned(clouds, list(grid.view.values())).evidence[0])

    alone, still = evidence({plane: laid[plane] for plane in VIEWS})
    assert still > 0.8 * alone
    a, b = laid["a"], laid["b"]
    crowded = {
        "a": Spots(np.append(a.columns, noise[0]), np.append(a.rows, noise[1]), np.full(POLES + 900, 2.5)),
        "b": Spots(
            np.append(b.columns, line), np.append(b.rows, 0.0 * line + b.rows.mean()), np.full(POLES + 120, 2.5)
        ),
    }
    with_line, doubtful = evidence(crowded)
    assert doubtful < 0.5 * with_line


def _laid(grid: EpipolarGrid, plane: str, places: np.ndarray) -> Spots:
    columns, rows = grid.lay(plane, places)
    return Spots(columns, rows, np.full(len(rows), 2.5))
