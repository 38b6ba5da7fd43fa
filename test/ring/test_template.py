"""One profile along the arc: what both planes show, and nothing that one of them shows alone."""

import dataclasses

import numpy as np
import pytest

from lasso_motion_ros.ring.strip import HALF_WIDTH
from lasso_motion_ros.ring.template import RingTemplate, TemplateTuning

COLUMNS, ROWS = 2 * HALF_WIDTH + 1, 120
ACROSS = np.exp(-0.5 * (np.arange(-HALF_WIDTH, HALF_WIDTH + 1) / 2.0) ** 2)
# Without smoothing along the arc, so that rows can be counted.
SHARP = TemplateTuning(smoothing_points=1e-3)
ELECTRODES = {20: 1.0, 60: 1.5, 100: 1.2}


def strip_of(heights):
    """A strip with an electrode of a height at each of some rows, as wide across as an electrode."""
    strip = np.zeros((ROWS, COLUMNS), np.float32)
    for row, height in heights.items():
        strip[row] = height * ACROSS
    return strip


def shown_by(strip):
    """(L,) evidence of a strip: here what it shows on the curve, an electrode of height 1 as 1."""
    return strip[:, HALF_WIDTH].copy()


def shown_by_both(strips):
    return {plane: shown_by(strip) for plane, strip in strips.items()}


def template_of(a, b, tuning=SHARP):
    strips = {"a": a, "b": b}
    return RingTemplate(strips, shown_by_both(strips), tuning)


def learn(template, strips, correlations):
    template.learn(strips, shown_by_both(strips), correlations)


# The mean of the middle three columns: what an electrode of height 1 shows on the curve itself.
ON_CURVE = ACROSS[HALF_WIDTH - 1 : HALF_WIDTH + 2].mean()


def test_the_profile_is_the_lesser_of_what_the_planes_show_by_hand():
    here = template_of(strip_of({20: 1.0, 60: 2.0}), strip_of({20: 2.0, 60: 0.5}))
    expected = np.zeros(ROWS)
    expected[20], expected[60] = 1.0 * ON_CURVE, 0.5 * ON_CURVE
    np.testing.assert_allclose(here.profile, expected, atol=1e-6)


@pytest.mark.parametrize("plane", ["a", "b"])
def test_what_one_plane_alone_shows_is_not_in_the_profile(plane):
    strips = {name: strip_of(ELECTRODES) for name in "ab"}
    plain = template_of(**strips)
    strips[plane] = strip_of(ELECTRODES | dict.fromkeys(range(75, 85), 2.0))  # an ablation tip along the clicks
    beside_a_tip = template_of(**strips)
    np.testing.assert_allclose(beside_a_tip.profile, plain.profile, atol=1e-6)
    np.testing.assert_allclose(beside_a_tip.values[75:85], 0.0, atol=1e-6)


def test_with_the_mean_of_the_planes_it_would_be():
    tip = strip_of(ELECTRODES | {80: 2.0})
    mean = template_of(tip, strip_of(ELECTRODES), dataclasses.replace(SHARP, shared=False))
    assert mean.profile[80] == pytest.approx(1.0 * ON_CURVE, rel=1e-5)


def test_a_bright_blob_in_one_plane_outweighs_nothing():
    # Ten times an electrode, on an electrode: the other plane tells what the electrode is worth.
    blob = template_of(strip_of(ELECTRODES | {60: 15.0}), strip_of(ELECTRODES))
    np.testing.assert_allclose(blob.profile, template_of(strip_of(ELECTRODES), strip_of(ELECTRODES)).profile, atol=1e-6)


def test_no_stretch_of_the_arc_outweighs_all_others_though_both_planes_show_it():
    both = strip_of({20: 1.0, 60: 15.0})
    assert template_of(both, both).profile[60] == pytest.approx(SHARP.ceiling)


def test_where_the_planes_have_nothing_in_common_all_of_the_arc_counts_alike():
    apart = template_of(strip_of({20: 1.0}), strip_of({90: 1.0}))
    np.testing.assert_allclose(apart.weights, 1.0 / ROWS, rtol=1e-5)
    assert np.isfinite(apart.values).all()
    assert apart.usual == {"a": SHARP.smallest_usual, "b": SHARP.smallest_usual}


def test_darker_than_the_background_does_not_count_against_an_electrode():
    # A gap in one plane is nothing, not a negative electrode; the profile is never below zero.
    gap = template_of(strip_of({20: 1.0, 60: -3.0}), strip_of({20: 1.0, 60: -3.0}))
    assert gap.profile.min() == 0.0
    assert gap.profile[60] == 0.0


def test_the_values_are_the_profile_times_one_cross_section_that_has_no_side():
    skew = strip_of(ELECTRODES)
    skew[:, HALF_WIDTH + 2] *= 1.5  # a wire beside the curve in plane A
    here = template_of(skew, strip_of(ELECTRODES))
    np.testing.assert_allclose(here.values, here.values[:, ::-1], atol=1e-6)
    np.testing.assert_allclose(here.values[:, HALF_WIDTH], here.profile, rtol=1e-5)
    # Rank one: every row is the same cross-section.
    assert np.linalg.matrix_rank(here.values, tol=1e-4) == 1


def test_the_strips_are_smoothed_along_the_arc_by_less_than_an_electrode():
    one = strip_of({60: 1.0})
    profile = template_of(one, one, TemplateTuning(smoothing_points=0.8)).profile
    assert profile.sum() == pytest.approx(ON_CURVE, rel=1e-4)
    # A Gaussian of 0.8 points over five: exp(-1 / (2 · 0.64)) of the peak beside it.
    assert profile[61] / profile[60] == pytest.approx(np.exp(-1.0 / 1.28), rel=1e-3)
    np.testing.assert_array_equal(np.flatnonzero(profile > 1e-6), [58, 59, 60, 61, 62])


def test_later_pairs_refine_the_profile_as_a_mean():
    here = template_of(strip_of({20: 1.0, 60: 1.0}), strip_of({20: 1.0, 60: 1.0}))
    # What was in one pair only (a passing wire, in both planes) is a third of itself after three.
    other = strip_of({20: 1.0, 60: 1.0, 90: 3.0})
    learn(here, {"a": other, "b": other}, {"a": 0.9, "b": 0.9})
    same = strip_of({20: 1.0, 60: 1.0})
    learn(here, {"a": same, "b": same}, {"a": 0.9, "b": 0.9})
    np.testing.assert_allclose(here.profile[[20, 60, 90]], np.array([1.0, 1.0, 1.0]) * ON_CURVE, rtol=1e-5)
    for _ in range(5):
        learn(here, {"a": same, "b": same}, {"a": 0.9, "b": 0.9})
    assert here.profile[90] == pytest.approx(3.0 / 8.0 * ON_CURVE, rel=1e-5)


def test_after_its_pairs_the_profile_is_fixed():
    tuning = dataclasses.replace(SHARP, pairs=3)
    here = template_of(strip_of(ELECTRODES), strip_of(ELECTRODES), tuning)
    moved = strip_of({row + 1: height for row, height in ELECTRODES.items()})
    for _ in range(2):
        learn(here, {"a": moved, "b": moved}, {"a": 0.9, "b": 0.9})
    profile, values = here.profile.copy(), here.values.copy()
    for _ in range(50):
        learn(here, {"a": moved, "b": moved}, {"a": 0.9, "b": 0.9})
    np.testing.assert_array_equal(here.profile, profile)
    np.testing.assert_array_equal(here.values, values)


def test_one_plane_alone_teaches_no_profile_but_what_correlation_is_usual():
    here = template_of(strip_of(ELECTRODES), strip_of(ELECTRODES))
    profile = here.profile.copy()
    learn(here, {"a": strip_of({30: 2.0})}, {"a": 0.6})
    np.testing.assert_array_equal(here.profile, profile)
    # From 1, an eighth of the way to 0.6; plane B's is as it was.
    assert here.usual["a"] == pytest.approx(1.0 - 0.4 / 8.0, abs=1e-4)
    assert here.usual["b"] == pytest.approx(1.0, abs=1e-4)


def test_what_is_usual_follows_the_dose_and_never_falls_to_noise():
    here = template_of(strip_of(ELECTRODES), strip_of(ELECTRODES))
    for _ in range(60):
        learn(here, {}, {"a": 0.6, "b": -0.2})
    assert here.usual["a"] == pytest.approx(0.6, abs=1e-3)
    assert here.usual["b"] == SHARP.smallest_usual


def test_what_is_usual_at_first_is_the_correlation_with_what_the_planes_share():
    # Noise of known energy: a strip correlates with its own signal by the root of the signal's share.
    signal = strip_of(dict.fromkeys(range(0, ROWS, 4), 2.0))
    for sigma in (0.2, 0.5):
        noises = [sigma * np.random.default_rng(seed).normal(size=signal.shape) for seed in (1, 2)]
        seen = [(signal + noise).astype(np.float32) for noise in noises]
        share = np.sum(signal**2) / np.sum(seen[0].astype(float) ** 2)
        assert template_of(*seen).usual["a"] == pytest.approx(np.sqrt(share), abs=0.1)


def test_the_planes_mean_nothing_by_their_names():
    one, other = strip_of({20: 1.0, 60: 0.4}), strip_of({20: 0.6, 60: 0.8})
    here, there = template_of(one, other), template_of(other, one)
    np.testing.assert_allclose(here.values, there.values, atol=1e-6)
    assert here.usual == {"a": pytest.approx(there.usual["b"]), "b": pytest.approx(there.usual["a"])}


def test_the_template_does_not_alias_its_input_nor_its_softened_self():
    strip = strip_of(ELECTRODES)
    here = template_of(strip, strip)
    before, soft = here.values.copy(), here.softened()
    assert soft.usual == {"a": SHARP.usual_softened, "b": SHARP.usual_softened}
    assert soft.values.max() < 0.5 * here.values.max()
    np.testing.assert_array_equal(here.values, before)
    assert here.usual["a"] == pytest.approx(1.0, abs=1e-4)
    strip[:] = 0.0
    learn(here, {"a": strip_of(ELECTRODES), "b": strip_of(ELECTRODES)}, {"a": 1.0, "b": 1.0})
    np.testing.assert_allclose(here.values, before, atol=1e-5)


BETWEEN = SHARP.between  # 0.4


def weights_of(a, b):
    """The weights (L,) of a template whose planes show electrodes of some evidence at some rows."""
    strips = {"a": strip_of(a), "b": strip_of(b)}
    return RingTemplate(strips, shown_by_both(strips), SHARP).weights


def test_the_weights_are_where_both_planes_show_electrodes_by_hand():
    # The lesser of the planes' evidence less 0.4: 1.0 - 0.4 and 1.2 - 0.4, of 1.4 in all; at 90 one plane shows none.
    weights = weights_of({20: 1.0, 60: 1.2, 90: 1.5}, {20: 1.4, 60: 1.2})
    expected = np.zeros(ROWS)
    expected[20], expected[60] = 0.6 / 1.4, 0.8 / 1.4
    np.testing.assert_allclose(weights, expected, atol=1e-6)


def test_what_the_wire_shows_between_the_electrodes_has_no_weight():
    # A hundred rows of wire would outweigh three electrodes.
    wire = dict.fromkeys(range(ROWS), BETWEEN - 0.01)
    electrodes = {20: 1.2, 60: 1.2, 100: 1.2}
    np.testing.assert_allclose(
        weights_of(wire | electrodes, wire | electrodes), weights_of(electrodes, electrodes), atol=1e-6
    )


def test_one_pair_tells_less_of_the_wire_than_many():
    tuning = dataclasses.replace(SHARP, usual_wire=0.3, wire_spread=0.1, wire_noise=0.2, pairs=100)
    electrodes = {20: 1.2, 60: 1.2, 100: 1.2}
    strips = {plane: strip_of(electrodes) for plane in "ab"}
    shown = {plane: np.full(ROWS, -0.1, np.float32) for plane in "ab"}
    for plane in "ab":
        shown[plane][[20, 60, 100]] = 1.2
    template = RingTemplate(strips, shown, tuning)
    # Weights 100 and 25: 0.3 · 0.8 - 0.1 · 0.2.
    assert template.wire == pytest.approx({"a": 0.22, "b": 0.22})
    for _ in range(99):
        template.learn(strips, shown, {})
    # Weights 100 and 2,500.
    assert template.wire == pytest.approx({"a": (0.3 - 0.1 * 25) / 26, "b": (0.3 - 0.1 * 25) / 26}, abs=1e-6)


@pytest.mark.parametrize("plane", ["a", "b"])
@pytest.mark.parametrize("evidence", [2.0, 50.0])
def test_something_big_in_one_plane_alone_takes_no_weight(plane, evidence):
    shown = {name: dict(ELECTRODES) for name in "ab"}
    # Beside the electrodes, and on one of them.
    shown[plane] = shown[plane] | dict.fromkeys(range(70, 90), evidence) | {60: evidence}
    np.testing.assert_allclose(weights_of(**shown), weights_of(ELECTRODES, ELECTRODES), atol=1e-6)


def test_where_neither_evidence_shows_an_electrode_the_profile_is_the_weight():
    strips = {plane: strip_of({20: 1.0, 60: 2.0}) for plane in "ab"}
    nothing = dict.fromkeys("ab", np.full(ROWS, BETWEEN, np.float32))
    np.testing.assert_allclose(RingTemplate(strips, nothing, SHARP).weights[[20, 60]], [1 / 3, 2 / 3], rtol=1e-5)


def test_the_weights_are_refined_like_the_profile():
    here = template_of(strip_of({20: 1.0, 60: 1.0}), strip_of({20: 1.0, 60: 1.0}))
    # A passing wire was in one pair of two: (0 + 2.4) / 2 - 0.4 = 0.8 beside 0.6 of each electrode; after four 0.2.
    other, same = strip_of({20: 1.0, 60: 1.0, 90: 2.4}), strip_of({20: 1.0, 60: 1.0})
    learn(here, {"a": other, "b": other}, {"a": 0.9, "b": 0.9})
    np.testing.assert_allclose(here.weights[[20, 60, 90]], np.array([0.6, 0.6, 0.8]) / 2.0, rtol=1e-5)
    for _ in range(2):
        learn(here, {"a": same, "b": same}, {"a": 0.9, "b": 0.9})
    np.testing.assert_allclose(here.weights[[20, 60, 90]], np.array([0.6, 0.6, 0.2]) / 1.4, rtol=1e-5)
    assert here.weights.sum() == pytest.approx(1.0, abs=1e-6)
