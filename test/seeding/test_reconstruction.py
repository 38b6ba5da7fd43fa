import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from support.method_inputs import angle_deg, biplane, flip_pixels, flipped, plane, ring

from lasso_motion_ros.core.errors import ReconstructionError
from lasso_motion_ros.geometry.curves import distance_to_curve
from lasso_motion_ros.geometry.projection import Projection
from lasso_motion_ros.geometry.transforms import apply, inverse, rigid
from lasso_motion_ros.seeding.reconstruction import epipolar_shift, reconstruct_ellipse

VIEWS = biplane()
NORMAL = np.array([0.3, -0.5, 0.8])
CENTRE = np.array([0.012, -0.020, 0.015])

offsets = st.tuples(*[st.floats(-0.04, 0.04)] * 3)
directions = st.tuples(*[st.floats(-1.0, 1.0)] * 3)


def outlines(loop, views=VIEWS, count=60):
    points = loop.points(count) if hasattr(loop, "points") else loop
    return {name: view.project(points) for name, view in views.items()}


def assert_same(found, expected, tolerance_m=1e-8):
    np.testing.assert_allclose(found.centre, expected.centre, atol=tolerance_m)
    assert angle_deg(found.normal, expected.normal) < np.degrees(tolerance_m / 0.01) + 1e-6
    for axis in ("semi_major", "semi_minor"):
        assert np.linalg.norm(getattr(found, axis)) == pytest.approx(
            np.linalg.norm(getattr(expected, axis)), abs=tolerance_m
        )


def edge_on_normal(view, centre, turn):
    """A normal for which the plane of a ring at `centre` holds the view's source."""
    towards = centre - view.source
    across = np.cross(towards, [0.3, 0.2, 1.0])
    return rigid(turn * towards / np.linalg.norm(towards), np.zeros(3))[:3, :3] @ across


@settings(max_examples=40, deadline=None)
@given(directions, offsets, st.floats(0.005, 0.015), st.booleans())
def test_circles_are_recovered_exactly(normal, centre, radius, mirrored):
    assume(np.linalg.norm(normal) > 0.1)
    views = biplane(mirrored=mirrored)
    lines_of_sight = [np.array(centre) - view.source for view in views.values()]
    # Away from edge-on, and from the symmetric case in which both candidates are circles.
    assume(all(10.0 < angle_deg(normal, sight) < 80.0 for sight in lines_of_sight))
    expected = ring(normal, centre, radius)
    found = reconstruct_ellipse(views, outlines(expected, views))
    circular = sorted(c.ellipse.circularity for c in found.candidates if c.edge_on == ())
    # Nearer than that the outlines, polylines as they are, decide between the two.
    assume(len(circular) == 2 and circular[1] - circular[0] > 5e-3)
    assert_same(found.chosen.ellipse, expected, 1e-6)
    assert found.chosen.edge_on == ()
    assert found.chosen.reprojection_px < 0.1  # what polylines of 120 points leave
    assert found.chosen.ellipse.circularity == pytest.approx(1.0, abs=1e-4)


@pytest.mark.parametrize("axis_ratio", [0.6, 0.8, 0.95])
def test_a_true_ellipse_is_among_the_candidates(axis_ratio):
    # Which of two is chosen depends on circularity alone, so only circles are certain to be chosen.
    expected = ring(NORMAL, CENTRE, axis_ratio=axis_ratio)
    found = reconstruct_ellipse(VIEWS, outlines(expected))
    nearest = min(found.candidates, key=lambda c: np.linalg.norm(c.ellipse.centre - CENTRE) + c.reprojection_px)
    assert_same(nearest.ellipse, expected)


def test_both_candidates_and_which_is_the_circle():
    found = reconstruct_ellipse(VIEWS, outlines(ring(NORMAL, CENTRE)))
    cone_cone = [c for c in found.candidates if c.edge_on == ()]
    assert len(cone_cone) == 2
    assert found.chosen is found.candidates[0]
    # Both explain the outlines; the other is no circle.
    assert max(c.reprojection_px for c in cone_cone) < 0.05
    first, second = (c.ellipse.circularity for c in cone_cone)
    assert first == pytest.approx(1.0, abs=1e-6)
    assert second < 0.9
    assert [c.misfit for c in found.candidates] == sorted(c.misfit for c in found.candidates)


def test_misfit_by_hand():
    candidate = reconstruct_ellipse(VIEWS, outlines(ring(NORMAL, CENTRE, axis_ratio=0.7))).candidates[-1]
    # (reprojection / 1.5 px)² + ((1 − circularity) / 0.15)²
    expected = (candidate.reprojection_px / 1.5) ** 2 + ((1 - candidate.ellipse.circularity) / 0.15) ** 2
    assert candidate.misfit == pytest.approx(expected)


@pytest.mark.parametrize("edge_on", ["a", "b"])
@pytest.mark.parametrize("turn", [0.2, 1.0, 2.5])
def test_edge_on_in_one_plane(edge_on, turn):
    expected = ring(edge_on_normal(VIEWS[edge_on], CENTRE, turn), CENTRE)
    clicked = outlines(expected)
    random = np.random.default_rng(3)
    noisy = {name: points + random.normal(scale=0.3, size=points.shape) for name, points in clicked.items()}
    for seen in (clicked, noisy):
        found = reconstruct_ellipse(VIEWS, seen).chosen
        assert np.linalg.norm(found.ellipse.centre - CENTRE) < 0.3e-3
        assert angle_deg(found.ellipse.normal, expected.normal) < 3.0
        assert found.reprojection_px < 1.0


@pytest.mark.parametrize("noise_px", [0.0, 0.7])
def test_edge_on_in_both_planes_four_rays_touch_it(noise_px):
    sights = [CENTRE - VIEWS[name].source for name in "ab"]
    expected = ring(np.cross(*sights), CENTRE)
    random = np.random.default_rng(4)
    seen = {
        name: points + random.normal(scale=noise_px, size=points.shape) for name, points in outlines(expected).items()
    }
    found = reconstruct_ellipse(VIEWS, seen).chosen
    assert found.edge_on == ("a", "b")
    assert found.ellipse.circularity == pytest.approx(1.0)
    assert np.linalg.norm(found.ellipse.centre - CENTRE) < (0.4e-3 if noise_px else 1e-5)
    assert angle_deg(found.ellipse.normal, expected.normal) < (2.0 if noise_px else 0.1)
    radius = np.linalg.norm(expected.semi_major)
    assert np.linalg.norm(found.ellipse.semi_major) == pytest.approx(radius, abs=0.4e-3 if noise_px else 1e-5)


@pytest.mark.parametrize("edge_on", ["a", "b"])
def test_helical_loop_seen_edge_on_never_is_a_line(edge_on):
    # 1.1 turns rising by 2 mm: its image is a thin S, through which an ellipse may be laid.
    flat = ring(edge_on_normal(VIEWS[edge_on], CENTRE, 1.0), CENTRE)
    turn = np.linspace(0.0, 1.1, 120)[:, None]
    angle = 2.0 * np.pi * turn
    loop = flat.centre + np.cos(angle) * flat.semi_major + np.sin(angle) * flat.semi_minor
    loop = loop + (turn - 0.55) * 2e-3 * flat.normal
    found = reconstruct_ellipse(VIEWS, outlines(loop)).chosen
    assert np.linalg.norm(found.ellipse.centre - CENTRE) < 0.7e-3
    assert angle_deg(found.ellipse.normal, flat.normal) < 10.0
    truth = np.vstack([loop, loop[:1]])
    assert distance_to_curve(found.ellipse.points(100), truth).mean() < 0.7e-3


def test_plane_through_line_and_source_holds_the_edge_on_ring():
    expected = ring(edge_on_normal(VIEWS["b"], CENTRE, 1.0), CENTRE)
    plane_cone = [c for c in reconstruct_ellipse(VIEWS, outlines(expected)).candidates if c.edge_on == ("b",)]
    assert len(plane_cone) == 1
    # Points of the plane have z′ = 0: the cut keeps to the plane, and its points to the ring.
    assert_same(plane_cone[0].ellipse, expected, 1e-6)
    towards = CENTRE - VIEWS["b"].source
    assert plane_cone[0].ellipse.normal @ towards / np.linalg.norm(towards) == pytest.approx(0.0, abs=1e-6)


@pytest.mark.parametrize("factors", [(-1.0, 1.0), (1.0, -1.0), (1e-4, -2e5)])
def test_scale_and_sign_of_the_matrices_mean_nothing(factors):
    loop = ring(NORMAL, CENTRE)
    seen = {
        name: points + np.random.default_rng(5).normal(size=points.shape) for name, points in outlines(loop).items()
    }
    views = {
        name: Projection(factor * VIEWS[name].matrix, 1024, 1024) for name, factor in zip("ab", factors, strict=True)
    }
    assert_same(reconstruct_ellipse(views, seen).chosen.ellipse, reconstruct_ellipse(VIEWS, seen).chosen.ellipse)


def test_the_planes_can_be_swapped():
    seen = outlines(ring(NORMAL, CENTRE))
    seen = {
        name: points + np.random.default_rng(5).normal(scale=5.0, size=points.shape) for name, points in seen.items()
    }
    swapped = reconstruct_ellipse({"a": VIEWS["b"], "b": VIEWS["a"]}, {"a": seen["b"], "b": seen["a"]})
    # η is the inverse then, also where it minimises the rank; the midpoint of the split double root is not.
    assert_same(swapped.chosen.ellipse, reconstruct_ellipse(VIEWS, seen).chosen.ellipse, 1e-9)


@pytest.mark.parametrize("mirrored", [("a",), ("b",), ("a", "b")])
def test_mirrored_displays_give_the_same(mirrored):
    seen = outlines(ring(NORMAL, CENTRE))
    seen = {name: points + np.random.default_rng(5).normal(size=points.shape) for name, points in seen.items()}
    views = {name: flipped(view) if name in mirrored else view for name, view in VIEWS.items()}
    other = {name: flip_pixels(points, VIEWS[name]) if name in mirrored else points for name, points in seen.items()}
    assert_same(reconstruct_ellipse(views, other).chosen.ellipse, reconstruct_ellipse(VIEWS, seen).chosen.ellipse)


def test_the_world_frame_can_be_anywhere():
    # Half a metre off and turned: whatever depends on the origin or forgets to normalise d with n shows here.
    move = rigid([0.4, -1.0, 0.7], [0.2, -0.1, 0.3])
    views = {name: Projection(view.matrix @ inverse(move), 1024, 1024) for name, view in VIEWS.items()}
    random = np.random.default_rng(5)
    seen = {name: points + random.normal(size=points.shape) for name, points in outlines(ring(NORMAL, CENTRE)).items()}
    here = reconstruct_ellipse(VIEWS, seen).chosen.ellipse
    there = reconstruct_ellipse(views, seen).chosen.ellipse
    np.testing.assert_allclose(there.centre, apply(move, here.centre), atol=1e-7)
    assert angle_deg(there.normal, move[:3, :3] @ here.normal) < 1e-3


def test_order_and_direction_of_the_points_mean_nothing():
    seen = outlines(ring(NORMAL, CENTRE))
    turned = {"a": seen["a"][::-1], "b": np.roll(seen["b"], 17, axis=0)}
    assert_same(reconstruct_ellipse(VIEWS, turned).chosen.ellipse, reconstruct_ellipse(VIEWS, seen).chosen.ellipse)


@pytest.mark.parametrize("second", [-30.0, -28.0, 150.0, 152.0])
def test_views_nearly_the_same_or_opposite_are_refused(second):
    views = {"a": VIEWS["a"], "b": plane(second)}
    with pytest.raises(ReconstructionError, match=r"look from \d\.\d° apart; depth needs at least 5°"):
        reconstruct_ellipse(views, outlines(ring(NORMAL, np.zeros(3)), views))


@pytest.mark.parametrize("difference", ["place", "size"])
def test_outlines_of_different_loops_are_refused(difference):
    other = (
        ring(NORMAL, CENTRE + np.array([0.0, 0.0, 0.015]))
        if difference == "place"
        else ring(NORMAL, CENTRE, radius=0.004)
    )
    seen = {"a": outlines(ring(NORMAL, CENTRE))["a"], "b": outlines(other)["b"]}
    with pytest.raises(ReconstructionError, match=r"no 3-D ellipse explains the two outlines: the best lies .* px"):
        reconstruct_ellipse(VIEWS, seen)


def test_points_without_a_loop_are_refused_for_both_planes_by_name():
    seen = outlines(ring(NORMAL, CENTRE))
    few = {name: points[:5] for name, points in seen.items()}
    with pytest.raises(ReconstructionError, match=r"plane A: an ellipse needs.*plane B: an ellipse needs"):
        reconstruct_ellipse(VIEWS, few)
    one_spot = {"a": np.repeat(seen["a"][:1], 8, axis=0), "b": seen["b"]}
    with pytest.raises(ReconstructionError):
        reconstruct_ellipse(VIEWS, one_spot)


def test_a_loop_behind_a_source_is_refused():
    # In front of a source is the side of the world origin: moved 2 m away, the ring is behind.
    behind = VIEWS["b"].source + (VIEWS["b"].source - np.zeros(3)) * 0.5
    far = ring(NORMAL, behind)
    with pytest.raises(ReconstructionError, match="behind the source of plane B"):
        reconstruct_ellipse(VIEWS, outlines(far))


def across_epipolar_lines(name, centre=CENTRE):
    """(2,) unit pixel direction in which a point moves when it leaves the plane through both sources and a centre."""
    normal = np.cross(VIEWS["a"].source - centre, VIEWS["b"].source - centre)
    step = VIEWS[name].jacobian(centre) @ normal
    return step / np.linalg.norm(step)


@pytest.mark.parametrize("share_of_a", [0.0, 0.5, 1.0])
def test_planes_that_agree_are_not_shifted(share_of_a):
    for loop in (ring(NORMAL, CENTRE), ring([0.9, 0.1, 0.4], CENTRE, 0.012)):
        shifts = epipolar_shift(VIEWS, outlines(loop, count=200), share_of_a)
        for shift in shifts.values():
            np.testing.assert_allclose(shift, 0.0, atol=0.02)


@pytest.mark.parametrize("size_px", [-6.0, 3.0])
@pytest.mark.parametrize("share_of_a", [0.0, 0.25, 1.0])
def test_a_shift_across_the_epipolar_lines_is_found(size_px, share_of_a):
    seen = outlines(ring(NORMAL, CENTRE))
    seen["b"] = seen["b"] + size_px * across_epipolar_lines("b")
    shifts = epipolar_shift(VIEWS, seen, share_of_a)
    # Plane B takes its share as it is; what plane A takes is the opposite, in its own pixels.
    np.testing.assert_allclose(
        shifts["b"], (1.0 - share_of_a) * size_px * across_epipolar_lines("b"), atol=0.06 * abs(size_px)
    )
    scale = VIEWS["b"].millimetres_per_pixel(CENTRE) / VIEWS["a"].millimetres_per_pixel(CENTRE)
    expected = -share_of_a * size_px * scale * across_epipolar_lines("a")
    np.testing.assert_allclose(shifts["a"], expected, atol=0.06 * abs(size_px))
    # Taken out, the planes agree.
    after = epipolar_shift(VIEWS, {name: seen[name] - shifts[name] for name in "ab"}, share_of_a)
    assert max(np.linalg.norm(shift) for shift in after.values()) < 0.05 * abs(size_px)


def test_a_loop_that_looks_larger_in_one_plane_is_not_shifted():
    # Both tangents count: what is a fifth larger lies a tenth of its height too high above and too low below.
    seen = outlines(ring(NORMAL, CENTRE), count=200)
    middle = VIEWS["b"].project(CENTRE)
    seen["b"] = middle + 1.2 * (seen["b"] - middle)
    for shift in epipolar_shift(VIEWS, seen, 0.5).values():
        np.testing.assert_allclose(shift, 0.0, atol=0.15)


def test_a_shift_along_the_epipolar_lines_is_depth_and_not_seen():
    seen = outlines(ring(NORMAL, CENTRE))
    across = across_epipolar_lines("b")
    seen["b"] = seen["b"] + 6.0 * np.array([-across[1], across[0]])
    for shift in epipolar_shift(VIEWS, seen, 0.5).values():
        assert np.linalg.norm(shift) < 0.3


def test_shifts_on_mirrored_and_scaled_planes_are_the_same():
    seen = outlines(ring(NORMAL, CENTRE))
    seen["b"] = seen["b"] + 4.0 * across_epipolar_lines("b")
    here = epipolar_shift(VIEWS, seen, 0.5)
    views = {"a": Projection(-3.0 * VIEWS["a"].matrix, 1024, 1024), "b": flipped(VIEWS["b"])}
    there = epipolar_shift(views, {"a": seen["a"], "b": flip_pixels(seen["b"], VIEWS["b"])}, 0.5)
    np.testing.assert_allclose(there["a"], here["a"], atol=1e-6)
    np.testing.assert_allclose(there["b"] * [-1.0, 1.0], here["b"], atol=1e-6)


def test_shifts_between_views_nearly_the_same_are_refused():
    views = {"a": VIEWS["a"], "b": plane(-29.0)}
    with pytest.raises(ReconstructionError, match="look from"):
        epipolar_shift(views, outlines(ring(NORMAL, CENTRE), views), 0.5)
