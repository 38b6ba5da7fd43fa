import numpy as np
import pytest
from support.method_inputs import angle_deg, biplane, closed, plane, ring

from lasso_motion_ros.brost2009.features import DistanceMap, region_of_interest
from lasso_motion_ros.brost2009.registration import PlaneDistances, best_neighbour, normal_search_cost, register
from lasso_motion_ros.config.brost2009 import RegistrationConfig
from lasso_motion_ros.geometry.curves import distance_to_curve
from lasso_motion_ros.geometry.transforms import apply, rigid

VIEWS = biplane(side=512)
EXACT = RegistrationConfig(normal_search_px=0)
IDENTITY = np.eye(4)


def ideal_plane(projection, curve, side=120):
    """The exact distance to a projected curve at every pixel about it."""
    seen = projection.project(curve)
    shape = (projection.height, projection.width)
    rows, columns = region_of_interest(shape, seen.mean(axis=0), side)
    y, x = np.mgrid[rows, columns]
    values = distance_to_curve(np.column_stack([x.ravel(), y.ravel()]).astype(float), closed(seen))
    return PlaneDistances(
        projection, DistanceMap(values.reshape(x.shape).astype(np.float32), (columns.start, rows.start))
    )


def circles_plane(radius_px, side=512):
    """A frontal plane in which distance is measured to a circle about the image's middle."""
    projection = plane(0.0, side=side)
    y, x = np.mgrid[:side, :side] - (side - 1) / 2.0
    return PlaneDistances(projection, DistanceMap(np.abs(np.hypot(x, y) - radius_px).astype(np.float32), (0, 0)))


def frontal_ring(radius_px, side=512):
    """Points of a ring at the iso-centre that a frontal view shows as a circle of that radius."""
    radius = radius_px * plane(0.0, side=side).millimetres_per_pixel(np.zeros(3)) / 1e3
    return ring([0.0, 1.0, 0.0], radius=radius).points(100)


@pytest.mark.parametrize("translation_mm", [(4.0, 0.0, 0.0), (0.0, -3.0, 5.0), (-2.0, 3.0, -4.0)])
def test_translation_is_recovered(translation_mm):
    model = ring([0.3, -0.5, 0.8], [0.005, 0.0, -0.01]).points(100)
    truth = rigid([0.0, 0.0, 0.0], np.array(translation_mm) * 1e-3)
    views = tuple(ideal_plane(view, apply(truth, model)) for view in VIEWS.values())
    found, residuals = register(model, IDENTITY, views, EXACT)
    assert np.linalg.norm(apply(found, model).mean(axis=0) - apply(truth, model).mean(axis=0)) < 0.1e-3
    assert len(residuals) == 2
    assert max(residuals) < 0.4  # bilinear between pixels, |distance| does not reach 0


def test_rotation_is_recovered():
    # About an axis in the ring's plane; the spin about its normal does not show.
    loop = ring([0.3, -0.5, 0.8])
    model = loop.points(100)
    axis = loop.semi_major / np.linalg.norm(loop.semi_major)
    truth = rigid(np.radians(8.0) * axis, [0.002, 0.001, -0.003])
    views = tuple(ideal_plane(view, apply(truth, model)) for view in VIEWS.values())
    found, _ = register(model, IDENTITY, views, EXACT)
    assert angle_deg(found[:3, :3] @ loop.normal, truth[:3, :3] @ loop.normal) < 1.0
    assert np.linalg.norm(found[:3, 3] - truth[:3, 3]) < 0.15e-3


def test_the_search_starts_from_the_motion_before():
    # 25 mm is too far for a search from the identity where distances end at 20 px, and little from the pair before.
    model = ring([0.3, -0.5, 0.8]).points(100)
    truth, before = rigid([0.0, 0.1, 0.0], [0.0, 0.0, 0.025]), rigid([0.0, 0.08, 0.0], [0.001, 0.0, 0.024])
    views = tuple(ideal_plane(view, apply(truth, model)) for view in VIEWS.values())
    views = tuple(
        PlaneDistances(v.projection, DistanceMap(np.minimum(v.distances.values, 20), v.distances.origin)) for v in views
    )
    found, residuals = register(model, before, views, EXACT)
    assert np.linalg.norm(found[:3, 3] - truth[:3, 3]) < 0.2e-3
    assert max(residuals) < 0.4


def test_the_motion_is_rigid():
    model = ring([0.3, -0.5, 0.8]).points(100)
    views = tuple(ideal_plane(view, apply(rigid([0.1, 0.0, 0.1], [0.002, 0.0, 0.0]), model)) for view in VIEWS.values())
    found, _ = register(model, IDENTITY, views, EXACT)
    np.testing.assert_allclose(found[:3, :3] @ found[:3, :3].T, np.eye(3), atol=1e-12)
    assert np.linalg.det(found[:3, :3]) == pytest.approx(1.0)
    np.testing.assert_array_equal(found[3], [0.0, 0.0, 0.0, 1.0])


def test_registration_is_the_same_with_the_planes_swapped():
    model = ring([0.3, -0.5, 0.8]).points(100)
    views = tuple(ideal_plane(view, apply(rigid([0, 0, 0], [0.002, 0.0, 0.003]), model)) for view in VIEWS.values())
    (one, first), (other, second) = (register(model, IDENTITY, v, EXACT) for v in (views, views[::-1]))
    np.testing.assert_allclose(one, other, atol=1e-12)
    assert first == pytest.approx(second[::-1])


@pytest.mark.parametrize(
    ("off_px", "reach", "cost"),
    [
        (0.0, 0, 0.0),
        (8.0, 0, 8.0),
        (3.0, 5, 0.0),  # within reach, on one of the offsets −5, −4 … 5
        (-3.0, 5, 0.0),
        (8.0, 5, 3.0),  # beyond it the distance less the reach
        (-8.0, 5, 3.0),
    ],
)
def test_normal_search_by_hand(off_px, reach, cost):
    # A circle of 60 px, and a model that projects to one that much larger or smaller, in a 1024-pixel image.
    view = circles_plane(60.0, side=1024)
    found = normal_search_cost(frontal_ring(60.0 + off_px, side=1024), IDENTITY[None], view, reach)
    assert found.shape == (1,)
    assert found[0] == pytest.approx(cost, abs=0.4)  # bilinear between pixels, |distance| does not reach 0


def test_reach_scales_with_the_image():
    # ± 5 px at 1024 pixels are ± 2.5 px at 512.
    found = normal_search_cost(frontal_ring(38.0), IDENTITY[None], circles_plane(30.0), 5)
    assert found[0] == pytest.approx(8.0 - 2.5, abs=0.1)


def test_search_is_along_the_normal_only():
    # Distance to one point far to the right: at the circle's top and bottom the normal is at right angles to it.
    side = 1024
    middle = (side - 1) / 2.0
    x = np.mgrid[:side, :side][1]
    view = PlaneDistances(plane(0.0, side=side), DistanceMap(np.abs(x - middle - 400.0).astype(np.float32), (0, 0)))
    model = frontal_ring(60.0, side=side)
    without, within = (normal_search_cost(model, IDENTITY[None], view, reach)[0] for reach in (0, 5))
    # The gain is 5 |cos| of the normal's angle, 5 · 2/π on the mean.
    assert without == pytest.approx(400.0, abs=0.1)
    assert without - within == pytest.approx(10.0 / np.pi, abs=0.1)


def test_several_motions_at_once():
    view = circles_plane(30.0)
    motions = np.stack([rigid([0, 0, 0], [0, 0, z]) for z in (0.0, 0.001, 0.004)])
    model = frontal_ring(30.0)
    together = normal_search_cost(model, motions, view, 5)
    one_by_one = [normal_search_cost(model, motion[None], view, 5)[0] for motion in motions]
    np.testing.assert_allclose(together, one_by_one, rtol=1e-6)
    assert np.all(np.diff(together) > 0)


def quadratic(target):
    return lambda parameters: ((parameters - target) ** 2).sum(axis=1)


def test_best_neighbour_on_a_quadratic():
    target = np.array([3.3, -2.1, 5.7])
    found = best_neighbour(quadratic(target), np.zeros(3), np.ones(3), 0.01, free=3)
    # The last steps are between 0.01 and 0.02.
    np.testing.assert_allclose(found, target, atol=0.02)


def test_best_neighbour_moves_only_what_is_free():
    start = np.array([0.5, 0.5, 0.5])
    found = best_neighbour(quadratic(np.array([3.0, -2.0, 5.0])), start, np.ones(3), 0.01, free=2)
    np.testing.assert_allclose(found[:2], [3.0, -2.0], atol=0.02)
    assert found[2] == 0.5


def test_best_neighbour_takes_the_best_of_all_neighbours():
    # The first step of one goes where the cost falls most: along the second parameter.
    visited = []

    def cost(parameters):
        visited.append(parameters.copy())
        return quadratic(np.array([1.0, 10.0]))(parameters)

    best_neighbour(cost, np.zeros(2), np.ones(2), 0.9, free=2)
    np.testing.assert_array_equal(visited[1], [[1, 0], [0, 1], [-1, 0], [0, -1]])
    np.testing.assert_array_equal(visited[2].mean(axis=0), [0.0, 1.0])


def test_best_neighbour_stays_in_a_minimum():
    start = np.array([1.0, 2.0])
    np.testing.assert_array_equal(best_neighbour(quadratic(start), start, np.ones(2), 0.01, free=2), start)


def test_translation_goes_before_rotation():
    # The first stage finds a pure translation, and next to no rotation is left to the second.
    model = ring([0.3, -0.5, 0.8]).points(100)
    truth = rigid([0.0, 0.0, 0.0], [0.004, 0.0, 0.0])
    views = tuple(ideal_plane(view, apply(truth, model)) for view in VIEWS.values())
    found, _ = register(model, IDENTITY, views, EXACT)
    np.testing.assert_allclose(found[:3, 3], truth[:3, 3], atol=1e-4)
    assert np.degrees(np.arccos((np.trace(found[:3, :3]) - 1.0) / 2.0)) < 1.5


def band_plane(projection, curve, half_width_px=3.0):
    """Zero over a band about the curve, as a threshold leaves it, and the distance to the band elsewhere."""
    view = ideal_plane(projection, curve)
    values = np.maximum(view.distances.values - half_width_px, 0.0)
    return PlaneDistances(projection, DistanceMap(values, view.distances.origin))


def test_the_tie_break_finds_the_middle_of_the_level_and_not_its_rim():
    # Bands of ± 3 px with a reach of ± 2.5 px cost nothing over ± 5.5 px, that is ± 1.4 mm at the ring.
    model = ring([0.3, -0.5, 0.8]).points(100)
    truth = rigid([0.0, 0.0, 0.0], [0.001, -0.002, 0.006])
    views = tuple(band_plane(view, apply(truth, model)) for view in VIEWS.values())
    found, residuals = register(model, IDENTITY, views, RegistrationConfig(normal_search_px=5, tie_break=0.05))
    assert max(residuals) == pytest.approx(0.0, abs=1e-3)
    assert np.linalg.norm(found[:3, 3] - truth[:3, 3]) < 0.9e-3
    # As published the search stops where it first meets the level.
    published, residuals = register(model, IDENTITY, views, RegistrationConfig(normal_search_px=5))
    assert max(residuals) == pytest.approx(0.0, abs=1e-3)
    assert np.linalg.norm(published[:3, 3] - truth[:3, 3]) > np.linalg.norm(found[:3, 3] - truth[:3, 3])


def test_tie_break_adds_the_distance_without_the_search():
    view, model = circles_plane(60.0, side=1024), frontal_ring(63.0, side=1024)
    plain, searched, both = (
        normal_search_cost(model, IDENTITY[None], view, *options)[0] for options in ((0,), (5,), (5, 0.5))
    )
    assert both == pytest.approx(searched + 0.5 * plain)
