import dataclasses
from functools import cache

import numpy as np
import pytest
from support.lasso_inputs import CURVE, LOOP, VIEWS, lasso_curve, lasso_image, lasso_pair, lasso_seed, noisy
from support.method_inputs import angle_deg, flip_pixels, flipped, ring

from lasso_motion_ros.bench.suite.sequence import RenderedSequence, render_sequence
from lasso_motion_ros.config.tracker import TrackerConfig
from lasso_motion_ros.core.errors import ReconstructionError, SeedError
from lasso_motion_ros.evaluation.measures import symmetric_mean_distance
from lasso_motion_ros.geometry.curves import arc_length, distance_to_curve
from lasso_motion_ros.geometry.frames import Frame, FramePair, Seed
from lasso_motion_ros.geometry.projection import Projection
from lasso_motion_ros.phantom.scenario import scenario_from_values
from lasso_motion_ros.ring.seed_curves import POINTS, build_loop_model
from lasso_motion_ros.seeding.cones import Ellipse3D
from lasso_motion_ros.seeding.outlines import is_bright, outlines
from lasso_motion_ros.seeding.reconstruction import reconstruct_ellipse

CONFIG = TrackerConfig()


def clicks(curve, count=12, noise_px=1.0, start=0.0, turns=1.0, direction=1, seed=1):
    """A user's clicks on a loop of about one turn: in order, from anywhere on, in either direction, once round."""
    random = np.random.default_rng(seed)
    at = np.mod(start + turns * np.arange(count) / count, 1.0)[::direction]
    index = np.rint(at * (len(curve) - 1)).astype(int)
    return Seed(*(VIEWS[p].project(curve[index]) + random.normal(scale=noise_px, size=(count, 2)) for p in "ab"))


@cache
def drawn(turns=1.0, rise_m=1e-3, bright=False):
    curve = lasso_curve(turns, rise_m)
    pixels = {p: noisy(lasso_image(curve, VIEWS[p]), ord(p)) for p in "ab"}
    return FramePair(0, *(Frame(0, 255 - pixels[p] if bright else pixels[p], VIEWS[p]) for p in "ab"))


@cache
def plain_model():
    """Of the closed loop as it is drawn; built once, so not to be changed."""
    return build_loop_model(drawn(), clicks(lasso_curve(1.0)), CONFIG)


def one_way_mm(model, curve):
    """Mean distance of the wire's points to the model's curve."""
    return 1e3 * distance_to_curve(curve, model.points).mean()


@cache
def rendered(turns: float, helix_mm: float) -> RenderedSequence:
    return render_sequence(
        scenario_from_values(
            {
                "pairs": 1,
                "geometry": {"size_px": 512},
                "lasso": {"turns": turns, "helix_mm": helix_mm, "normal": [0.27, -0.73, 0.62]},
                "clicks": {"noise_px": 1.0},
            }
        )
    )


@cache
def model_of(turns, helix_mm):
    sequence = rendered(turns, helix_mm)
    return build_loop_model(sequence.pairs[0], sequence.seed, CONFIG)


@pytest.mark.parametrize(("turns", "helix_mm"), [(0.85, 1.0), (1.0, 3.0), (1.25, 2.0)])
def test_model_error_on_the_phantom_is_under_two_tenths_of_a_millimetre(turns, helix_mm):
    # Open, helical, overlapping: the measure of the recordings, in the images at the loop's depth, both planes' mean.
    sequence = rendered(turns, helix_mm)
    model = model_of(turns, helix_mm)
    errors = []
    for name in "ab":
        view = sequence.pairs[0].frame(name).projection
        truth = sequence.truth.pairs[0].centrelines[name]
        unit = view.millimetres_per_pixel(model.centre)
        errors.append(unit * symmetric_mean_distance(view.project(model.points), truth))
    assert np.mean(errors) < 0.2
    assert 1e3 * distance_to_curve(sequence.truth.loop, model.points).mean() < 0.6


@pytest.mark.parametrize(("turns", "helix_mm"), [(0.85, 1.0), (1.0, 3.0)])
def test_an_open_loop_stays_open_and_a_closed_one_closed(turns, helix_mm):
    truth, points = rendered(turns, helix_mm).truth.loop, model_of(turns, helix_mm).points
    gaps_mm = [1e3 * np.linalg.norm(curve[0] - curve[-1]) for curve in (truth, points)]
    if turns < 1.0:
        assert gaps_mm[1] == pytest.approx(gaps_mm[0], abs=2.5)
        assert gaps_mm[1] > 5.0
    else:
        assert gaps_mm[1] < 1.0


def test_points_are_even_along_the_loop_and_the_centre_is_the_rings():
    model = plain_model()
    assert model.points.shape == (POINTS, 3)
    steps = np.diff(arc_length(model.points))
    np.testing.assert_allclose(steps, steps.mean(), rtol=0.05)
    assert arc_length(model.points)[-1] == pytest.approx(2.0 * np.pi * 0.010, rel=0.05)
    assert 1e3 * np.linalg.norm(model.centre - LOOP.centre) < 0.2
    np.testing.assert_allclose(model.arms + model.centre, model.points)
    assert model.radius_mm == pytest.approx(10.0, abs=0.6)
    assert not model.bright
    assert one_way_mm(model, lasso_curve(1.0)) < 0.2


def test_the_axis_is_across_the_ring():
    model = plain_model()
    assert np.linalg.norm(model.axis) == pytest.approx(1.0)
    assert 1e3 * np.abs(model.arms @ model.axis).mean() < 0.5  # it rises by a millimetre in all
    assert angle_deg(model.axis, LOOP.normal) < 2.0


def test_the_centre_of_a_loop_that_overlaps_is_not_drawn_to_where_it_is_double():
    # 1.25 turns, clicked from end to end: the points' mean is off by 10 mm · sin(1.25 π) / (1.25 π) = 1.8 mm.
    curve = lasso_curve(1.25)
    model = build_loop_model(drawn(1.25), lasso_seed(14, 0.7, curve), CONFIG)
    assert np.linalg.norm(model.points.mean(axis=0) - LOOP.centre) > 1.2e-3
    assert np.linalg.norm(model.centre - LOOP.centre) < 0.4e-3
    assert arc_length(model.points)[-1] == pytest.approx(1.25 * 2.0 * np.pi * 0.010, rel=0.06)
    assert 1e3 * symmetric_mean_distance(model.points, curve) < 0.35


def test_the_model_follows_the_wire_rather_than_an_ellipse():
    # Bulging thrice on its way round, and rising by 2 mm: off any ellipse by half a millimetre.
    curve = lasso_curve(1.0, 2e-3)
    angle = np.linspace(0.0, 2.0 * np.pi, len(curve))[:, None]
    curve = curve + 0.6e-3 * np.sin(3.0 * angle) * (curve - LOOP.centre) / 0.010
    pair = FramePair(0, *(Frame(0, noisy(lasso_image(curve, VIEWS[p]), 1), VIEWS[p]) for p in "ab"))
    model = build_loop_model(pair, clicks(curve, 12, 0.5), CONFIG)
    ring = np.vstack([LOOP.points(200), LOOP.points(1)])
    assert 1e3 * distance_to_curve(curve, ring).mean() > 0.45
    assert one_way_mm(model, curve) < 0.27


@pytest.mark.slow
@pytest.mark.parametrize(("start", "direction"), [(0.0, -1), (0.3, 1), (0.5, -1), (0.85, 1)])
def test_clicks_may_start_anywhere_and_go_either_way(start, direction):
    curve = lasso_curve(1.0)
    # Differently in each plane, too: the user clicks plane B from where he likes.
    there, other = clicks(curve, 10, 1.0, start, direction=direction), clicks(curve, 11, 1.0, 0.6)
    model = build_loop_model(drawn(), Seed(there.points_a, other.points_b), CONFIG)
    assert one_way_mm(model, curve) < 0.25
    assert np.linalg.norm(model.centre - LOOP.centre) < 0.25e-3


@pytest.mark.slow
@pytest.mark.parametrize(("count", "noise_px"), [(6, 1.0), (10, 2.0)])
def test_few_and_noisy_clicks_do(count, noise_px):
    # A pixel is a quarter of a millimetre here: 2 px are half a millimetre.
    curve = lasso_curve(1.0)
    errors = [
        one_way_mm(build_loop_model(drawn(), clicks(curve, count, noise_px, 0.2, seed=seed), CONFIG), curve)
        for seed in range(2)
    ]
    assert np.mean(errors) < 0.25


def test_a_shift_between_the_planes_is_absorbed():
    # Plane B's images lie 4 px (a millimetre) too low: no 3-D loop explains both as they are.
    view_b = VIEWS["b"]
    low = view_b.shifted(0.0, -4.0)
    pair = FramePair(0, drawn().a, Frame(0, drawn().b.pixels, low))
    plain = plain_model()
    model = build_loop_model(pair, clicks(lasso_curve(1.0)), CONFIG)
    # Half each; together what makes the planes meet again (up and down is across the epipolar lines here).
    apart = (model.shift("b", low) - model.shift("a", VIEWS["a"])) - (
        plain.shift("b", view_b) - plain.shift("a", VIEWS["a"])
    )
    assert abs(apart[1]) == pytest.approx(4.0, abs=0.4)
    assert model.offsets["a"] @ model.offsets["b"] < 0.0
    for name, view in (("a", VIEWS["a"]), ("b", low)):
        truth = VIEWS[name].project(lasso_curve(1.0))
        model_px = view.project(model.points) + model.shift(name, view)
        assert distance_to_curve(truth, model_px).mean() < 0.8
    # The loop keeps its shape and lies between where the two planes have it.
    assert angle_deg(np.linalg.svd(model.arms)[2][2], LOOP.normal) < 4.0
    assert 0.2e-3 < np.linalg.norm(model.centre - plain.centre) < 0.8e-3


def test_planes_exposed_one_after_the_other_leave_plane_a_where_it_is():
    late = FramePair(0, drawn().a, dataclasses.replace(drawn().b, stamp_ns=100_000_000))
    model = build_loop_model(late, clicks(lasso_curve(1.0)), CONFIG)
    np.testing.assert_array_equal(model.offsets["a"], 0.0)
    together = plain_model()
    assert np.linalg.norm(together.offsets["a"]) > 0.0


def test_depth_directions_are_as_described():
    model = plain_model()
    ray, lateral = model.depth_directions
    sight = {n: LOOP.centre - VIEWS[n].source for n in "ab"}
    assert angle_deg(ray, sight["a"]) < 0.2
    for unit in (ray, lateral):
        assert np.linalg.norm(unit) == pytest.approx(1.0)
    assert lateral @ sight["b"] / np.linalg.norm(sight["b"]) == pytest.approx(0.0, abs=2e-3)
    normal = np.cross(sight["a"], sight["b"])
    assert lateral @ normal / np.linalg.norm(normal) == pytest.approx(0.0, abs=2e-3)


def test_bright_catheters_give_the_same_model():
    dark, bright = plain_model(), build_loop_model(drawn(bright=True), clicks(lasso_curve(1.0)), CONFIG)
    assert bright.bright
    np.testing.assert_allclose(bright.points, dark.points, atol=1e-4)


@pytest.mark.slow
@pytest.mark.parametrize("bright", [False, True])
def test_a_polarity_that_the_clicks_mistake_shows_along_the_loop(bright):
    # Between the loop and a bright copy of it 2 mm higher, where the clicks are: each by itself is nearer to the copy.
    curve = lasso_curve(1.0)
    seed = clicks(curve, 10, 0.5)
    wrong = {}
    for name in "ab":
        pixels = drawn(bright=bright).frame(name).pixels.copy()
        for x, y in np.rint(seed.points(name)).astype(int):
            pixels[y - 3 : y + 4, x + 3 : x + 5] = 0 if bright else 255  # a stroke of the other polarity
        wrong[name] = Frame(0, pixels, VIEWS[name])
    pair = FramePair(0, wrong["a"], wrong["b"])
    assert is_bright(pair, seed, CONFIG) != bright
    model = build_loop_model(pair, seed, CONFIG)
    assert model.bright == bright
    assert one_way_mm(model, curve) < 0.4


@pytest.mark.slow
@pytest.mark.parametrize("polarity", ["dark", "bright"])
def test_a_configured_polarity_is_not_doubted(polarity):
    config = dataclasses.replace(CONFIG, polarity=polarity)
    seed = clicks(lasso_curve(1.0))
    assert build_loop_model(drawn(bright=polarity == "bright"), seed, config).bright == (polarity == "bright")
    with pytest.raises(SeedError, match="no catheter is seen along the clicks"):
        build_loop_model(drawn(bright=polarity == "dark"), seed, config)


@pytest.mark.parametrize("away_mm", [[20.0, 15.0, -30.0], [-30.0, 0.0, 20.0]])
def test_clicks_beside_any_catheter_are_refused(away_mm):
    away = np.array(away_mm) * 1e-3
    with pytest.raises(SeedError, match=r"odds for one is -?\d\.\d, expected at least 6"):
        build_loop_model(drawn(), clicks(lasso_curve(1.0) + away), CONFIG)


def test_a_wire_that_noise_nearly_hides_is_told_from_noise_by_what_both_planes_show():
    # Its contrast alone, 0.42 times the noise, is what the path along clicks on nothing may have.
    curve = lasso_curve(1.05)
    images = {p: noisy(lasso_image(curve, VIEWS[p], electrodes=0), [2, ord(p)], sigma=140.0) for p in "ab"}
    pair = FramePair(0, *(Frame(0, images[p], VIEWS[p]) for p in "ab"))
    assert one_way_mm(build_loop_model(pair, clicks(curve), CONFIG), curve) < 0.6
    away = np.array([20.0, 15.0, -30.0]) * 1e-3
    with pytest.raises(SeedError, match="no catheter is seen along the clicks"):
        build_loop_model(pair, clicks(curve + away), CONFIG)


@pytest.mark.slow
def test_scale_sign_and_mirror_mean_nothing():
    seed = clicks(lasso_curve(1.0))
    here = plain_model()
    scaled = FramePair(
        0,
        *(
            Frame(0, drawn().frame(p).pixels, Projection(factor * VIEWS[p].matrix, 512, 512))
            for p, factor in (("a", -3.0), ("b", 1e-4))
        ),
    )
    np.testing.assert_allclose(build_loop_model(scaled, seed, CONFIG).points, here.points, atol=1e-8)
    flipped_pair = FramePair(
        0, Frame(0, np.ascontiguousarray(drawn().a.pixels[:, ::-1]), flipped(VIEWS["a"])), drawn().b
    )
    flipped_seed = Seed(flip_pixels(seed.points_a, VIEWS["a"]), seed.points_b)
    there = build_loop_model(flipped_pair, flipped_seed, CONFIG)
    assert distance_to_curve(there.points, here.points).mean() < 5e-5
    np.testing.assert_allclose(there.centre, here.centre, atol=5e-5)


def test_the_planes_can_be_swapped():
    seed = clicks(lasso_curve(1.0))
    here = plain_model()
    there = build_loop_model(FramePair(0, drawn().b, drawn().a), Seed(seed.points_b, seed.points_a), CONFIG)
    assert distance_to_curve(there.points, here.points).mean() < 1e-4
    np.testing.assert_allclose(there.centre, here.centre, atol=1e-4)


def test_refusals():
    seed = lasso_seed()
    with pytest.raises(SeedError, match="lacks plane B"):
        build_loop_model(lasso_pair(0, planes="a"), seed, CONFIG)
    with pytest.raises(SeedError, match="plane A: 5 clicks, expected at least 6"):
        build_loop_model(lasso_pair(0), Seed(seed.points_a[:5], seed.points_b), CONFIG)
    with pytest.raises(SeedError, match=r"plane B: .*outside"):
        build_loop_model(lasso_pair(0), Seed(seed.points_a, seed.points_b + 400.0), CONFIG)
    elsewhere = Seed(seed.points_a, VIEWS["b"].project(LOOP.centre + 0.3 * (CURVE[::40] - LOOP.centre)))
    with pytest.raises(ReconstructionError, match="no 3-D ellipse explains"):
        build_loop_model(lasso_pair(0), elsewhere, CONFIG)


def test_a_loop_at_the_images_border():
    away = np.array([0.0, 0.0, 0.052])  # a click outside is refused, so the loop is just inside
    curve = lasso_curve(1.0) + away
    pair = FramePair(0, *(Frame(0, noisy(lasso_image(curve, VIEWS[p]), 3), VIEWS[p]) for p in "ab"))
    inside = {p: VIEWS[p].project(curve)[:, 1].min() for p in "ab"}
    assert 0.0 < min(inside.values()) < 12.0
    model = build_loop_model(pair, clicks(curve, 12, 0.5), CONFIG)
    assert one_way_mm(model, curve) < 0.3


def test_the_pair_shows_what_the_loop_rose_between_the_exposures():
    normal = np.cross(LOOP.centre - VIEWS["a"].source, LOOP.centre - VIEWS["b"].source)
    normal /= np.linalg.norm(normal)
    moved = 0.003 * normal + 0.001 * np.cross(normal, [0.0, 1.0, 0.0])
    b = noisy(lasso_image(lasso_curve(1.0) + moved, VIEWS["b"]), 7)
    late = FramePair(0, drawn().a, Frame(100_000_000, b, VIEWS["b"]))
    seed = Seed(clicks(lasso_curve(1.0)).points_a, clicks(lasso_curve(1.0) + moved).points_b)
    between = build_loop_model(late, seed, CONFIG).between
    assert between.value[0] * (between.across[0] @ normal) == pytest.approx(0.003, abs=2e-4)
    assert abs(between.across[0] @ normal) == pytest.approx(1.0, abs=1e-4)


def test_exposed_together_the_planes_show_no_motion():
    assert plain_model().between is None


def test_the_curve_has_as_many_points_as_asked_for() -> None:
    assert build_loop_model(drawn(), clicks(lasso_curve(1.0)), CONFIG, points=60).points.shape == (60, 3)
    assert plain_model().points.shape == (120, 3)


def flattened(normal, angle_deg_, axis_ratio):
    """An ellipse where the ring is, its major axis turned by an angle in its plane."""
    circle = ring(normal, LOOP.centre)
    cos, sin = np.cos(np.radians(angle_deg_)), np.sin(np.radians(angle_deg_))
    major, minor = circle.semi_major, circle.semi_minor
    return Ellipse3D(LOOP.centre, cos * major + sin * minor, axis_ratio * (cos * minor - sin * major))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("normal", "angle"),
    [([-0.84, -0.54, 0.012], 150.0), ([0.87, 0.494, 0.0], 30.0), ([-0.928, -0.373, -0.006], 30.0)],
)
def test_of_two_ellipses_that_fit_alike_the_one_whose_electrodes_match_is_the_loops(normal, angle):
    # Upright, both conics through the two outlines are nearly circles; the other one is a little rounder, and 50° off.
    loop = flattened(normal, angle, 0.9)
    turn = 2.0 * np.pi * np.linspace(0.0, 1.0, 400)[:, None]
    curve = loop.centre + np.cos(turn) * loop.semi_major + np.sin(turn) * loop.semi_minor
    pair = FramePair(0, *(Frame(0, noisy(lasso_image(curve, VIEWS[p]), [3, ord(p)]), VIEWS[p]) for p in "ab"))
    seed = clicks(curve, 12, 0.7)
    found = reconstruct_ellipse(dict(VIEWS), outlines(pair, seed, CONFIG, bright=False))
    assert angle_deg(found.chosen.ellipse.normal, loop.normal) > 45.0
    assert found.candidates[1].misfit - found.chosen.misfit < 1.0
    model = build_loop_model(pair, seed, CONFIG)
    assert angle_deg(np.linalg.svd(model.points - model.points.mean(axis=0))[2][2], loop.normal) < 5.0
    assert one_way_mm(model, curve) < 0.2


@pytest.mark.slow
@pytest.mark.parametrize("number", [1, 3, 7])
def test_where_minimal_paths_wander_in_noise_the_clicks_tell_the_loop(number):
    # Nearly four times the wire's depth: from one of seven clicks to the next the path goes where noise is dark.
    config = dataclasses.replace(CONFIG, polarity="dark")
    curve = lasso_curve(1.0)
    images = {p: noisy(lasso_image(curve, VIEWS[p]), [number, ord(p)], 130.0) for p in "ab"}
    pair = FramePair(0, *(Frame(0, images[p], VIEWS[p]) for p in "ab"))
    seed = lasso_seed(7, 0.7, curve)
    paths = outlines(pair, seed, config, bright=False)
    wandering = [distance_to_curve(paths[p], VIEWS[p].project(curve)).mean() for p in "ab"]
    assert np.mean(wandering) > 1.5  # pixels of a quarter of a millimetre
    model = build_loop_model(pair, seed, config)
    errors = []
    for name, view in VIEWS.items():
        shown = view.project(model.points) + model.shift(name, view)
        errors.append(view.millimetres_per_pixel(model.centre) * distance_to_curve(view.project(curve), shown).mean())
    # From the paths alone: 0.35 mm and more.
    assert np.mean(errors) < 0.3
