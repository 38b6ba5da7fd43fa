"""Which candidate ellipse the published method takes."""

from __future__ import annotations

import numpy as np
import pytest
from support.method_inputs import angle_deg, biplane, ring

from lasso_motion_ros.brost2009.model import most_circular, reconstruct_model, spread_ratio
from lasso_motion_ros.config.brost2009 import ModelConfig
from lasso_motion_ros.core.errors import ReconstructionError
from lasso_motion_ros.geometry.frames import PLANES
from lasso_motion_ros.seeding.cones import Ellipse3D
from lasso_motion_ros.seeding.reconstruction import Candidate, Reconstruction

VIEWS = biplane()
NORMAL = np.array([0.3, -0.5, 0.8])
CENTRE = np.array([0.012, -0.020, 0.015])


def outlines(loop: Ellipse3D) -> dict:
    return {plane: VIEWS[plane].project(loop.points(60)) for plane in PLANES}


def candidate(circularity: float, edge_on: tuple = (), reprojection_px: float = 1.0) -> Candidate:
    return Candidate(ring(NORMAL, CENTRE, axis_ratio=circularity), edge_on, reprojection_px)


def test_the_more_circular_of_the_two_cone_candidates_is_taken_however_it_reprojects() -> None:
    candidates = (candidate(0.8), candidate(0.9, reprojection_px=3.0), candidate(0.99, ("a",)))
    assert most_circular(Reconstruction(candidates[0], candidates), ()) is candidates[1]


def test_an_edge_on_loop_takes_its_line() -> None:
    candidates = (candidate(0.9), candidate(0.8), candidate(0.5, ("a",)), candidate(0.4, ("b",)))
    reconstruction = Reconstruction(candidates[0], candidates)
    assert most_circular(reconstruction, ("a",)) is candidates[2]
    assert most_circular(reconstruction, ("b",)) is candidates[3]


@pytest.mark.parametrize(
    ("edge_on", "said"), [((), "edge-on in neither plane"), (("b",), "plane B$"), (("a", "b"), "plane A and B$")]
)
def test_nothing_of_the_papers_kind_is_said(edge_on: tuple, said: str) -> None:
    candidates = (candidate(0.9, ("a",)),)
    with pytest.raises(ReconstructionError, match=said):
        most_circular(Reconstruction(candidates[0], candidates), edge_on)


@pytest.mark.parametrize("rule", ["circular", "likely"])
def test_a_ring_is_recovered(rule: str) -> None:
    expected = ring(NORMAL, CENTRE)
    found = reconstruct_model(VIEWS, outlines(expected), ModelConfig(candidate=rule)).ellipse
    np.testing.assert_allclose(found.centre, CENTRE, atol=1e-8)
    assert angle_deg(found.normal, NORMAL) < 1e-4


def test_an_ellipse_has_a_likelier_and_a_more_circular_reading() -> None:
    # Outlines that only the true, less circular ellipse explains: the rules part.
    truth = ring(NORMAL, CENTRE, axis_ratio=0.7)
    seen = outlines(truth)
    circular = reconstruct_model(VIEWS, seen, ModelConfig())
    likely = reconstruct_model(VIEWS, seen, ModelConfig(candidate="likely"))
    assert circular.ellipse.circularity >= likely.ellipse.circularity
    assert likely.misfit <= circular.misfit


def test_a_loop_edge_on_in_one_plane_is_cut_by_the_plane_of_its_line() -> None:
    across = np.cross(CENTRE - VIEWS["b"].source, [0.3, 0.2, 1.0])
    expected = ring(across, CENTRE)
    seen = outlines(expected)
    assert spread_ratio(seen["b"]) < 0.05 < 0.1 < spread_ratio(seen["a"])
    found = reconstruct_model(VIEWS, seen, ModelConfig())
    assert found.edge_on == ("b",)
    assert np.linalg.norm(found.ellipse.centre - CENTRE) < 0.3e-3
    # Never edge-on, says the configuration: the cones' candidates are taken.
    with pytest.raises(ReconstructionError):
        reconstruct_model(VIEWS, seen, ModelConfig(edge_on_ratio=0.0))


def test_spread_ratio_by_hand() -> None:
    # Corners of a rectangle of 6 × 2 turned by half a radian: spreads 3 and 1.
    corners = np.array([[3.0, 1.0], [-3.0, 1.0], [-3.0, -1.0], [3.0, -1.0]])
    turn = np.array([[np.cos(0.5), -np.sin(0.5)], [np.sin(0.5), np.cos(0.5)]])
    assert spread_ratio(corners @ turn.T + [100.0, -7.0]) == pytest.approx(1.0 / 3.0)
    assert spread_ratio(np.array([[0.0, 0.0], [1.0, 2.0], [2.0, 4.0]])) == pytest.approx(0.0, abs=1e-12)
