"""The compiled slide from companions against the plain one."""

from __future__ import annotations

import numpy as np
import pytest

from lasso_motion_ros.core.compiled import has_kernels, plain
from lasso_motion_ros.ring.companion_slide import CompanionSlide, CompanionSlideTuning, SlideSight

pytestmark = pytest.mark.skipif(not has_kernels(), reason="the extra `fast` is not installed")

SAME = {"rtol": 1e-9, "atol": 1e-15}


@pytest.mark.parametrize("seed", range(12))
def test_a_slide_is_told_alike(seed: int) -> None:
    """Pairs that one plane shows, or both; a slide that begins; a ring that a hand puts elsewhere."""
    generator = np.random.default_rng(seed)
    compiled = plainly = CompanionSlide.first(CompanionSlideTuning())
    offset, put = np.zeros(3), 0
    for number in range(40):
        offset = offset + (number > 12) * generator.normal(size=3) * 2e-4
        if number == 25:
            offset = offset + np.array([0.02, -0.01, 0.015])
        sights = []
        for _ in range(int(generator.integers(0, 3)) if seed % 3 else 2):
            across = np.linalg.qr(generator.normal(size=(3, 3)))[0][:2]
            noise, learned = generator.uniform(1e-8, 1e-6, 2)
            sights.append(SlideSight(across, across @ offset + generator.normal(size=2) * 3e-4, noise, learned))
        interval_s = float(generator.uniform(0.05, 1.0))
        compiled = compiled.after(interval_s, sights)
        with plain():
            plainly = plainly.after(interval_s, sights)
        assert compiled.was_unlike == plainly.was_unlike
        put += plainly.was_unlike
        assert compiled.log_odds_of_slide == pytest.approx(plainly.log_odds_of_slide, rel=1e-9, abs=1e-9)
        np.testing.assert_allclose(compiled.states, plainly.states, **SAME)
        np.testing.assert_allclose(compiled.covariances, plainly.covariances, **SAME)
    assert put >= 1
