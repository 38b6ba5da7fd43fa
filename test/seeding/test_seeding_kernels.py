"""The compiled paths and ways of a seed against the plain versions: the same to the last bit."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from lasso_motion_ros.core.compiled import has_kernels, plain
from lasso_motion_ros.seeding import loop_outline, minimal_path

pytestmark = pytest.mark.skipif(not has_kernels(), reason="the extra `fast` is not installed")


@pytest.mark.parametrize("slack", [0.4, 1.0, 3.0])
@pytest.mark.parametrize("seed", range(20))
def test_a_way_is_the_same(seed: int, slack: float, monkeypatch: pytest.MonkeyPatch) -> None:
    """Also where the front has not come far enough by its latest time, and goes on."""
    monkeypatch.setattr(minimal_path, "TUNING", replace(minimal_path.TUNING, slack=slack, beyond_px=2.0 * slack))
    generator = np.random.default_rng(seed)
    shape = tuple(generator.integers(12, 70, 2))
    cost = np.full(shape, 1.0)
    if seed % 4:  # else there are many pixels to which the front comes at once
        cost = 0.05 + 0.95 * generator.random(shape) ** generator.choice([0.3, 4.0])
    start, end = generator.uniform(0.0, 1.0, (2, 2)) * (np.array(shape[::-1]) - 1.0)
    if seed % 5 == 0:  # right in the middle of a pixel, and on the border
        start, end = np.round(start), np.array([shape[1] - 1.0, end[1]])
    compiled = minimal_path._way_down(cost, start, end)
    with plain():
        plainly = minimal_path._way_down(cost, start, end)
    assert (compiled is None) == (plainly is None)
    if plainly is not None:
        np.testing.assert_array_equal(compiled, plainly)


@pytest.mark.parametrize("seed", range(5))
def test_a_path_through_clicks_is_the_same(seed: int) -> None:
    generator = np.random.default_rng(seed)
    angle = np.linspace(0.0, 6.0, 300)
    curve = 120.0 + np.column_stack([80.0 * np.cos(angle), 45.0 * np.sin(angle)])
    image = generator.normal(120.0, 10.0, (240, 250))
    for shift in (-1, 0, 1):
        column, row = np.rint(curve + 0.7 * shift).astype(int).T
        image[row, column] -= 35.0
    clicks = curve[:: 20 + 8 * seed] + generator.normal(0.0, 1.0, curve[:: 20 + 8 * seed].shape)
    options = {"bright": False, "sigma_px": 1.5, "cost_floor": 0.03}
    compiled = minimal_path.path_through_clicks(image.astype(np.uint8), clicks, **options)
    with plain():
        np.testing.assert_array_equal(
            compiled, minimal_path.path_through_clicks(image.astype(np.uint8), clicks, **options)
        )


@pytest.mark.parametrize("seed", range(20))
def test_outlines_go_round_their_ellipse_alike(seed: int) -> None:
    generator = np.random.default_rng(seed)
    cost = generator.random((int(generator.integers(2, 40)), 1 + seed % 2, 2, 48))
    if seed % 3 == 0:  # many that are alike
        cost = np.round(4.0 * cost)
    compiled = loop_outline._cheapest_ways(cost, 6)
    with plain():
        np.testing.assert_array_equal(compiled, loop_outline._cheapest_ways(cost, 6))
