"""The curve is the likeliest one: of what both images show, what was clicked, and what a lasso is like."""

import dataclasses

import numpy as np
import pytest
from support.lasso_inputs import CURVE, LOOP, VIEWS, lasso_image, lasso_seed, noisy

from lasso_motion_ros.geometry.curves import distance_to_curve
from lasso_motion_ros.geometry.frames import Frame, FramePair, Seed
from lasso_motion_ros.ring import loop_curve
from lasso_motion_ros.ring.loop_curve import likeliest_curve
from lasso_motion_ros.ring.loop_model import epipolar_directions
from lasso_motion_ros.ring.seed_images import SeedImages

NO_SHIFT = {plane: np.zeros(2) for plane in "ab"}
TURN = 2.0 * np.pi


def images_of(curves, sigma=5.0, seed=0):
    """Both planes, each with its own curve; None: nothing."""
    drawn = {
        plane: lasso_image(CURVE + 10.0 if curve is None else curve, VIEWS[plane]) for plane, curve in curves.items()
    }
    frames = {plane: Frame(0, noisy(image, [seed, ord(plane)], sigma), VIEWS[plane]) for plane, image in drawn.items()}
    return SeedImages(FramePair(0, frames["a"], frames["b"]), bright=False)


def start_beside(offset_mm=0.0, waves_mm=0.0):
    """(96, 3) about the drawn loop: larger by an offset, and two waves a turn."""
    angles = np.linspace(0.0, 1.05 * TURN, 96)[:, None]
    outward = np.cos(angles) * LOOP.semi_major + np.sin(angles) * LOOP.semi_minor
    radius = np.linalg.norm(outward, axis=1, keepdims=True)
    return LOOP.centre + outward + 1e-3 * (offset_mm + waves_mm * np.cos(2.0 * angles)) * outward / radius


def off_mm(points):
    """Mean distance of a curve's points from the drawn one."""
    return 1e3 * float(distance_to_curve(points, CURVE).mean())


@pytest.mark.parametrize("fine", [True, False])
def test_the_gradient_is_that_of_the_probability(fine):
    fit = loop_curve._Fit(start_beside(0.3), images_of(dict.fromkeys("ab", CURVE)), NO_SHIFT, lasso_seed())
    fit.look(1.0, fine=fine)
    parameters = fit._parameters + np.random.default_rng(2).normal(0.0, 0.05, len(fit._parameters))
    _, gradient, normal = fit._probability(parameters)
    step = 1e-3
    steps = step * np.eye(len(parameters))
    numeric = [
        (fit._probability(parameters + one)[0] - fit._probability(parameters - one)[0]) / (2.0 * step) for one in steps
    ]
    # Slopes of the image are those of a 3 × 3 neighbourhood, values those of its four pixels.
    assert np.corrcoef(gradient, numeric)[0, 1] > 0.98
    assert np.linalg.norm(gradient - numeric) < 0.2 * np.linalg.norm(numeric)
    assert (np.linalg.eigvalsh(normal) > 0.0).all()


@pytest.mark.parametrize("sigma", [5.0, 40.0])
@pytest.mark.parametrize(("offset_mm", "waves_mm"), [(0.8, 0.0), (-0.8, 0.0), (0.0, 0.6)])
def test_from_beside_the_wire_it_is_found(offset_mm, waves_mm, sigma):
    start = start_beside(offset_mm, waves_mm)
    found = likeliest_curve(start, images_of(dict.fromkeys("ab", CURVE), sigma), NO_SHIFT, lasso_seed())
    assert off_mm(found.points) < (0.12 if sigma < 10.0 else 0.2) < off_mm(start) - 0.1
    assert found.log_odds > 20.0


def test_noise_alone_is_no_ring():
    for seed in range(8):
        found = likeliest_curve(start_beside(), images_of(dict.fromkeys("ab"), seed=seed), NO_SHIFT, lasso_seed())
        assert found.log_odds < 6.0
        assert distance_to_curve(found.points, start_beside()).mean() < 0.7e-3


def test_what_one_plane_alone_shows_pulls_it_less_than_what_both_show():
    larger = LOOP.centre + (CURVE - LOOP.centre) * 1.06  # 0.7 mm aside
    with_one = likeliest_curve(start_beside(), images_of({"a": larger, "b": None}), NO_SHIFT, lasso_seed())
    with_both = likeliest_curve(start_beside(), images_of(dict.fromkeys("ab", larger)), NO_SHIFT, lasso_seed())

    def aside_mm(found):
        return 1e3 * float(
            np.linalg.norm(found.points - LOOP.centre, axis=1).mean()
            - np.linalg.norm(start_beside() - LOOP.centre, axis=1).mean()
        )

    assert aside_mm(with_both) > 0.5
    assert aside_mm(with_one) < 0.7 * aside_mm(with_both)
    assert with_one.log_odds < 0.5 * with_both.log_odds


def test_planes_that_are_off_to_each_other_are_brought_together():
    # Plane B's images lie 1 mm off along the normal of the epipolar plane; each plane takes half of it.
    images = images_of(dict.fromkeys("ab", CURVE))
    normal = epipolar_directions(images.projections, LOOP.centre)[2]
    lifted = images_of({"a": CURVE, "b": CURVE + 1e-3 * normal})
    found = likeliest_curve(start_beside(), lifted, NO_SHIFT, lasso_seed())
    expected = {"a": -0.5, "b": 0.5}
    for plane, share in expected.items():
        view = VIEWS[plane]
        moved_mm = (
            found.shifts[plane]
            @ (view.jacobian(LOOP.centre) @ normal)
            / np.sum((view.jacobian(LOOP.centre) @ normal) ** 2)
        )
        assert 1e3 * moved_mm == pytest.approx(share, abs=0.12)  # the clicks say none


def test_a_click_far_off_changes_next_to_nothing():
    images, seed = images_of(dict.fromkeys("ab", CURVE), 40.0), lasso_seed()
    points = seed.points_a.copy()
    points[3] += [25.0, 10.0]
    plain, off = (
        likeliest_curve(start_beside(), images, NO_SHIFT, clicks) for clicks in (seed, Seed(points, seed.points_b))
    )
    assert 1e3 * np.linalg.norm(plain.points - off.points, axis=1).max() < 0.25  # 10 mm off it is


def test_places_that_are_known_vaguely_hold_it_less():
    images, start = images_of(dict.fromkeys("ab", CURVE), 40.0), start_beside(1.2)
    places = start[::5]
    beside = Seed(*(view.project(places) for view in VIEWS.values()))
    held, loose = (likeliest_curve(start, images, NO_SHIFT, beside, sigma_mm) for sigma_mm in (0.3, 2.0))
    assert off_mm(loose.points) < 0.7 * off_mm(held.points)


def test_a_loop_that_reaches_out_of_the_picture_raises_nothing():
    images = images_of(dict.fromkeys("ab", CURVE))
    frames = {
        plane: dataclasses.replace(frame, pixels=np.ascontiguousarray(frame.pixels[: frame.pixels.shape[0] // 2]))
        for plane, frame in images.frames.items()
    }
    cut = {
        plane: dataclasses.replace(
            frame, projection=frame.projection.cropped(0, 0, frame.pixels.shape[1], frame.pixels.shape[0])
        )
        for plane, frame in frames.items()
    }
    halves = SeedImages(FramePair(0, cut["a"], cut["b"]), bright=False)
    found = likeliest_curve(start_beside(), halves, NO_SHIFT, lasso_seed())
    assert np.isfinite(found.points).all()
    assert np.isfinite(found.log_odds)


def test_what_the_blur_leaves_of_the_noise_is_no_more_than_one_standard_deviation():
    fit = loop_curve._Fit(start_beside(), images_of(dict.fromkeys("ab")), NO_SHIFT, lasso_seed())
    sharp, blurred = (np.std(fit._views[0].coarse(px).sampled[0]) for px in (0.0, loop_curve.TUNING.blurs_px[0]))
    assert 0.8 * sharp < blurred < sharp
