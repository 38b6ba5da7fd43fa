import dataclasses

import numpy as np
import pytest
from support.method_inputs import biplane, closed, plane
from support.tracking_inputs import LOOP, VIEWS, pair, seed

from lasso_motion_ros.config.tracker import TrackerConfig
from lasso_motion_ros.core.errors import SeedError
from lasso_motion_ros.geometry.curves import distance_to_curve
from lasso_motion_ros.geometry.frames import Seed
from lasso_motion_ros.seeding.outlines import (
    curves_through_clicks,
    is_bright,
    line_sigma_px,
    outlines,
    require_both_planes,
)

CONFIG = TrackerConfig()


def test_both_planes_are_needed():
    assert set(require_both_planes(pair(0))) == {"a", "b"}
    with pytest.raises(SeedError, match="lacks plane B; both planes are needed"):
        require_both_planes(pair(0, planes="a"))
    with pytest.raises(SeedError, match="lacks plane A and B"):
        require_both_planes(pair(0, planes=""))


def test_line_scale_by_hand():
    # 0.2 mm pixels at 1.2 m are 0.2 · 0.785 / 1.2 = 0.1308 mm at the iso-centre.
    assert line_sigma_px(plane(0.0), 0.2616667) == pytest.approx(2.0, abs=1e-4)
    assert line_sigma_px(plane(0.0, side=512), 0.5233333) == pytest.approx(2.0, abs=1e-4)
    assert line_sigma_px(plane(0.0), 0.01) == 0.8  # the filter cannot be narrower


@pytest.mark.parametrize("bright", [False, True])
def test_clicks_show_the_polarity(bright):
    assert is_bright(pair(0, bright=bright), seed(), CONFIG) == bright


@pytest.mark.parametrize("polarity", ["dark", "bright"])
@pytest.mark.parametrize("bright", [False, True])
def test_a_configured_polarity_is_taken(polarity, bright):
    config = dataclasses.replace(CONFIG, polarity=polarity)
    assert is_bright(pair(0, bright=bright), seed(), config) == (polarity == "bright")


def test_polarity_of_a_click_outside_is_not_asked():
    # The click is refused later, by its plane and place.
    clicks = Seed(np.full((6, 2), -100.0), np.full((6, 2), 5000.0))
    assert not is_bright(pair(0), clicks, CONFIG)
    assert not is_bright(pair(0, bright=True), clicks, CONFIG)


def test_clicks_on_one_spot_are_no_loop():
    good = seed()
    spot = np.tile(good.points_a[0], (len(good.points_a), 1))
    with pytest.raises(SeedError, match=r"plane A: the clicks span 0\.0 mm, expected at least 6 mm"):
        outlines(pair(0), Seed(spot, good.points_b), CONFIG, bright=False)
    near = good.points_b.mean(axis=0) + np.random.default_rng(2).uniform(-8.0, 8.0, good.points_b.shape)
    with pytest.raises(SeedError, match="plane B: the clicks span"):
        outlines(pair(0), Seed(good.points_a, near), CONFIG, bright=False)


def test_outlines_follow_the_ring_in_each_plane():
    found = outlines(pair(0), seed(), CONFIG, bright=False)
    assert set(found) == {"a", "b"}
    for name, path in found.items():
        truth = VIEWS[name].project(LOOP.points(400))
        assert distance_to_curve(path, np.vstack([truth, truth[:1]])).mean() < 0.4
        np.testing.assert_allclose(path[0], seed().points(name)[0], atol=1e-9)


@pytest.mark.parametrize(
    ("points_a", "points_b", "text"),
    [
        (seed().points_a[:5], seed().points_b, "plane A: 5 clicks, expected at least 6"),
        (seed().points_a, np.zeros((0, 2)), "plane B: 0 clicks, expected at least 6"),
        (seed().points_a, seed().points_b + 600.0, r"plane B: click \(\d+, \d+\) lies outside the image of 512×512"),
    ],
)
def test_refused_clicks_name_the_plane(points_a, points_b, text):
    with pytest.raises(SeedError, match=text):
        outlines(pair(0), Seed(points_a, points_b), CONFIG, bright=False)


def test_outlines_need_both_planes():
    with pytest.raises(SeedError, match="lacks plane A"):
        outlines(pair(0, planes="b"), seed(), CONFIG, bright=False)


NOISE_PX = 1.0  # a quarter of a millimetre each way, as people click


def clicks_on_the_ring(count, noise_px, number=0, views=VIEWS):
    """Clicks once round the ring and back to the first, each with noise of its own."""
    random = np.random.default_rng(number)
    exact = {name: closed(views[name].project(LOOP.points(count))) for name in "ab"}
    return Seed(*(exact[name] + random.normal(scale=noise_px, size=exact[name].shape) for name in "ab"))


def from_the_ring_px(points, name):
    """Mean distance of points (N, 2) to the true ring."""
    return distance_to_curve(points, closed(VIEWS[name].project(LOOP.points(400)))).mean()


@pytest.mark.parametrize(("count", "bound_px"), [(12, 0.95), (30, 0.6)])
def test_a_curve_through_noisy_clicks_is_nearer_to_the_ring_than_they_scatter(count, bound_px):
    curves, scattered = [], []
    for number in range(10):
        seed = clicks_on_the_ring(count, NOISE_PX, number)
        for name, curve in curves_through_clicks(seed, VIEWS).items():
            curves.append(from_the_ring_px(curve, name))
            scattered.append(from_the_ring_px(seed.points(name), name))
    # The more clicks, the more of their noise is averaged; by themselves they are √(2/π) · 1 px off.
    assert np.mean(curves) < bound_px * NOISE_PX
    assert np.mean(scattered) == pytest.approx(np.sqrt(2.0 / np.pi), abs=0.1)


@pytest.mark.parametrize("noise_px", [0.0, NOISE_PX])
def test_a_curve_through_clicks_goes_from_the_first_to_the_last(noise_px):
    for number in range(5):
        seed = clicks_on_the_ring(12, noise_px, number)
        # As an arc of three quarters, so that the ends are apart.
        seed = Seed(seed.points_a[:10], seed.points_b[:10])
        for name, curve in curves_through_clicks(seed, VIEWS).items():
            assert np.linalg.norm(curve[0] - seed.points(name)[0]) < 1.0
            assert np.linalg.norm(curve[-1] - seed.points(name)[-1]) < 1.0


def test_what_is_smoothed_is_in_millimetres():
    small, large = VIEWS, biplane(side=1024)
    seed = clicks_on_the_ring(12, NOISE_PX)
    # The same clicks where pixels are half as wide; their centres lie between the others'.
    there = curves_through_clicks(Seed(2.0 * seed.points_a + 0.5, 2.0 * seed.points_b + 0.5), large)
    for name, curve in curves_through_clicks(seed, small).items():
        np.testing.assert_allclose(there[name], 2.0 * curve + 0.5, atol=0.02)


@pytest.mark.parametrize(
    "double", [lambda clicks: np.repeat(clicks, 2, axis=0), lambda clicks: np.r_[clicks[:1], clicks]]
)
def test_a_double_click_counts_once(double):
    few = seed(6)
    once = curves_through_clicks(few, VIEWS)
    twice = curves_through_clicks(Seed(double(few.points_a), double(few.points_b)), VIEWS)
    for name in "ab":
        np.testing.assert_array_equal(twice[name], once[name])


def test_clicks_on_few_places_still_give_a_curve():
    clicks = np.repeat(np.array([[100.0, 100.0], [160.0, 120.0], [120.0, 170.0]]), 2, axis=0)
    curve = curves_through_clicks(Seed(clicks, clicks), VIEWS)["a"]
    assert np.isfinite(curve).all()
    assert np.linalg.norm(curve[[0, -1]] - clicks[[0, -1]], axis=1).max() < 3.0
