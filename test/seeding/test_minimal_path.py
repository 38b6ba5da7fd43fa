import numpy as np
import pytest
import skfmm
from support.method_inputs import draw_curve

from lasso_motion_ros.core.compiled import plain
from lasso_motion_ros.core.errors import SeedError
from lasso_motion_ros.geometry.curves import arc_length, distance_to_curve
from lasso_motion_ros.seeding.minimal_path import path_through_clicks

CENTRE, RADIUS = np.array([100.3, 90.7]), 50.0
SHAPE = (200, 220)


def on_circle(turns):
    angle = 2.0 * np.pi * np.asarray(turns)
    return CENTRE + RADIUS * np.column_stack([np.cos(angle), np.sin(angle)])


CURVE = on_circle(np.linspace(0.0, 1.0, 400))
CLICKS = on_circle(np.linspace(0.0, 1.0, 9))


def path(image, clicks, *, bright=False, cost_floor=0.05):
    return path_through_clicks(image, clicks, bright=bright, sigma_px=1.5, cost_floor=cost_floor)


@pytest.mark.parametrize("bright", [False, True])
def test_follows_the_curve_between_clicks_on_it(bright):
    found = path(draw_curve(CURVE, SHAPE, bright=bright, background=100.0 if bright else 180.0), CLICKS, bright=bright)
    distances = distance_to_curve(found, CURVE)
    assert distances.max() < 0.5
    assert distances.mean() < 0.2
    # Straight lines between the clicks would run 50 · (1 − cos 22.5°) = 3.8 px inside.
    assert np.linalg.norm(found - CENTRE, axis=1).mean() == pytest.approx(RADIUS, abs=0.2)


def test_comes_back_to_the_curve_from_clicks_beside_it():
    random = np.random.default_rng(2)
    clicks = CLICKS + random.uniform(-2.5, 2.5, size=CLICKS.shape)
    found = path(draw_curve(CURVE, SHAPE), clicks)
    from_click = np.min(np.linalg.norm(found[:, None] - clicks[None], axis=2), axis=1)
    assert distance_to_curve(found[from_click > 8.0], CURVE).max() < 0.5


def test_every_click_is_on_the_path_and_the_ends_are_exact():
    clicks = CLICKS + np.array([0.37, -0.61])
    found = path(draw_curve(CURVE, SHAPE), clicks)
    np.testing.assert_allclose(found[0], clicks[0], atol=1e-9)
    np.testing.assert_allclose(found[-1], clicks[-1], atol=1e-9)
    assert distance_to_curve(clicks, found).max() < 1e-9


def test_points_are_half_a_pixel_apart_and_run_from_first_to_last():
    found = path(draw_curve(CURVE, SHAPE), CLICKS[:5])
    steps = np.linalg.norm(np.diff(found, axis=0), axis=1)
    assert 0.3 < steps.min() <= steps.max() < 0.51
    # Half the circle, in the order of the clicks: the angle rises from 0 to π.
    angle = np.unwrap(np.arctan2(*(found - CENTRE).T[::-1]))
    assert angle[-1] - angle[0] == pytest.approx(np.pi, abs=0.02)
    assert arc_length(found)[-1] == pytest.approx(np.pi * RADIUS, rel=0.02)


def test_clicks_past_the_start_overlap():
    # 1.25 turns: the path lies twice on the first quarter.
    clicks = on_circle(np.linspace(0.0, 1.25, 11))
    found = path(draw_curve(CURVE, SHAPE), clicks)
    assert arc_length(found)[-1] == pytest.approx(1.25 * 2.0 * np.pi * RADIUS, rel=0.02)
    assert distance_to_curve(found, CURVE).max() < 0.5


def test_the_other_direction_gives_the_same_curve():
    image = draw_curve(CURVE, SHAPE)
    forth, back = path(image, CLICKS), path(image, CLICKS[::-1])
    assert distance_to_curve(back, forth).max() < 0.3


def test_without_any_line_the_path_is_straight():
    found = path(np.full(SHAPE, 120, np.uint8), np.array([[20.0, 30.0], [80.0, 75.0]]))
    assert distance_to_curve(found, np.array([[20.0, 30.0], [80.0, 75.0]])).max() < 0.5


def test_a_loose_cost_floor_cuts_corners():
    image = draw_curve(CURVE, SHAPE)
    tight, loose = (path(image, CLICKS[::2], cost_floor=floor) for floor in (0.05, 1.0))
    assert distance_to_curve(tight, CURVE).max() < 0.5
    # With the same cost everywhere the chords of a quarter turn remain: 50 · (1 − cos 45°) = 14.6 px inside.
    assert distance_to_curve(loose, CURVE).max() == pytest.approx(14.6, abs=0.7)


def test_a_long_detour_is_not_taken():
    # A hairpin: its legs 10 px apart and 12 px long; along it the way is cheap but over three times as long.
    legs = np.array([[60.0, 60.0], [60.0, 72.0], [70.0, 72.0], [70.0, 60.0]])
    found = path_through_clicks(draw_curve(legs, SHAPE), legs[[0, 3]], bright=False, sigma_px=0.8, cost_floor=0.01)
    np.testing.assert_allclose(found, legs[[0, 3]])


def test_clicks_on_one_spot_are_joined_directly():
    clicks = np.array([[20.0, 30.0], [20.0, 30.0], [21.0, 30.5]])
    np.testing.assert_allclose(path(np.full(SHAPE, 120, np.uint8), clicks), clicks)


def test_clicks_in_the_corners():
    clicks = np.array([[0.0, 0.0], [219.0, 0.0], [219.0, 199.0]])
    found = path(draw_curve(CURVE, SHAPE), clicks)
    np.testing.assert_allclose(found[[0, -1]], clicks[[0, -1]])
    assert np.all(found >= 0.0)
    assert np.all(found <= [219.0, 199.0])


def test_deep_images():
    image = draw_curve(CURVE, SHAPE).astype(np.uint16) * 16
    assert distance_to_curve(path(image, CLICKS), CURVE).max() < 0.5


@pytest.mark.parametrize(
    ("clicks", "text"),
    [
        (np.array([[5.0, 5.0], [220.0, 5.0]]), r"click \(220, 5\) lies outside the image of 220×200 pixels"),
        (np.array([[-1.0, 5.0], [20.0, 5.0]]), r"click \(-1, 5\) lies outside"),
        (np.array([[5.0, 5.0], [np.nan, 5.0]]), r"click \(nan, 5\) lies outside"),
        (np.array([[5.0, 5.0]]), r"N ≥ 2, found shape \(1, 2\)"),
        (np.zeros((4, 3)), r"found shape \(4, 3\)"),
    ],
)
def test_refused_clicks(clicks, text):
    with pytest.raises(SeedError, match=text):
        path(np.zeros(SHAPE, np.uint8), clicks)


def test_the_front_stops_behind_the_click_and_no_sooner(monkeypatch):
    """The path is the one that a front over the whole image leads to; the image is not marched through to its end."""
    image = draw_curve(CURVE, SHAPE)
    image = np.clip(image + np.random.default_rng(1).normal(0.0, 12.0, SHAPE), 0, 255).astype(np.uint8)
    marched, limits = skfmm.travel_time, []

    def without_limit(*args, narrow=0.0, **options):
        limits.append(narrow)
        return marched(*args, **options)

    with plain():
        limited = path(image, CLICKS)
        monkeypatch.setattr(skfmm, "travel_time", without_limit)
        np.testing.assert_array_equal(path(image, CLICKS), limited)
    assert len(limits) == len(CLICKS) - 1
    assert min(limits) > 0.0
