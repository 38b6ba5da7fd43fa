"""The circle that clicks and images show best: found from bad clicks, the same each time, none where there is none."""

from functools import cache

import numpy as np
import pytest
from support.lasso_inputs import LOOP, VIEWS, lasso_curve, lasso_image, lasso_seed, noisy
from support.method_inputs import angle_deg

from lasso_motion_ros.core.errors import ReconstructionError
from lasso_motion_ros.geometry.frames import Frame, Pair, Seed
from lasso_motion_ros.ring.seed_circle import seed_circles
from lasso_motion_ros.ring.seed_images import SeedImages

NO_SHIFTS = {"a": np.zeros(2), "b": np.zeros(2)}
PENALTY = 0.4


@cache
def frames():
    return {p: Frame(0, noisy(lasso_image(lasso_curve(1.0), VIEWS[p]), ord(p)), VIEWS[p]) for p in "ab"}


def clicked(frames):
    return SeedImages(Pair(0, frames["a"], frames["b"]), bright=False)


def circles(seed, count=1):
    return seed_circles(clicked(frames()), seed, NO_SHIFTS, PENALTY, count=count)


def few_clicks(noise_px, seed=0, count=6):
    """Clicks about the drawn loop, in order, that are far off."""
    random = np.random.default_rng(seed)
    curve = lasso_curve(1.0)[:: 400 // count][:count]
    return Seed(*(VIEWS[p].project(curve) + random.normal(0.0, noise_px, (count, 2)) for p in "ab"))


def radius_mm(ellipse):
    return 1e3 * np.linalg.norm(ellipse.semi_major)


@pytest.mark.parametrize("noise_px", [1.0, 4.0])
def test_it_lies_on_the_loop_however_badly_it_was_clicked(noise_px):
    loop_mm = 1e3 * np.linalg.norm(lasso_curve(1.0) - LOOP.centre, axis=1).mean()
    for number in range(3):
        (found,) = circles(few_clicks(noise_px, number))
        assert 1e3 * np.linalg.norm(found.centre - LOOP.centre) < 0.8
        assert angle_deg(found.normal, LOOP.normal) < 8.0
        assert radius_mm(found) == pytest.approx(loop_mm, abs=0.8)
        assert found.circularity == pytest.approx(1.0)


def test_the_same_clicks_give_the_same_circle():
    one, other = (circles(few_clicks(2.0))[0] for _ in range(2))
    np.testing.assert_array_equal(one.points(20), other.points(20))


def test_several_are_tilted_otherwise():
    found = circles(lasso_seed(), count=3)
    for index, one in enumerate(found):
        for other in found[:index]:
            assert angle_deg(one.normal, other.normal) > 10.0


def test_clicks_of_two_sizes_are_on_no_circle():
    seed = lasso_seed()
    small = seed.points_b.mean(axis=0) + 0.3 * (seed.points_b - seed.points_b.mean(axis=0))
    assert circles(Seed(seed.points_a, small)) == []


def test_rays_that_do_not_meet_are_refused():
    seed = lasso_seed()
    twice = {p: Frame(0, frames()["a"].pixels, VIEWS["a"]) for p in "ab"}
    with pytest.raises(ReconstructionError):
        seed_circles(clicked(twice), Seed(seed.points_a, seed.points_a), NO_SHIFTS, PENALTY, count=1)
