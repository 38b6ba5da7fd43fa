"""The electrodes: which comb both planes show along the ring, and when none is resolved."""

import dataclasses

import numpy as np
import pytest
from support.breathing_lasso import CONFIG, moved, pair
from support.lasso_inputs import lasso_pair, lasso_seed

from lasso_motion_ros.config.catheters import catalogue
from lasso_motion_ros.ring.electrodes import RingEvidence, nearest_catheter
from lasso_motion_ros.ring.tracker import RingTracker

POINTS = 120


def ring(diameter_mm, turns=0.95):
    """(POINTS, 3) metres along an open ring."""
    angle = 2.0 * np.pi * np.linspace(0.0, turns, POINTS)
    return 0.5e-3 * diameter_mm * np.column_stack([np.cos(angle), np.sin(angle), 0.0 * angle])


def shown_along(length_mm, places, *, noise, seed, length=1.0):
    """(POINTS,) evidence of electrodes at places, mm, as wide as the images show them."""
    arc = np.linspace(0.0, length_mm, POINTS)
    random = np.random.default_rng(seed)
    smooth = np.convolve(random.normal(size=POINTS + 4), [0.06, 0.24, 0.4, 0.24, 0.06], "valid") / 0.53
    wide = np.hypot(0.65, length / 3.5)
    poles = sum(np.exp(-0.5 * ((arc - place) / wide) ** 2) for place in places)
    return np.clip(1.6 * poles + noise * smooth, -1.0, 2.0).astype(np.float32)


def evidence(diameter_mm, places, *, noise=0.4, seed=0, catheter=None, tip=False):
    points = ring(diameter_mm)
    length = 1e3 * float(np.linalg.norm(np.diff(points, axis=0), axis=1).sum())
    shown = {p: shown_along(length, places, noise=noise, seed=[seed, ord(p)]) for p in "ab"}
    if tip:  # along a sixth of the curve, in plane A alone
        shown["a"][40:60] = 2.0
    return RingEvidence(points, shown, diameter_mm, catheter)


EVEN = 1.0 + 6.0 * np.arange(10)
PAIRS = np.sort(np.concatenate([1.0 + 8.0 * np.arange(9), 3.0 + 8.0 * np.arange(9)]))


@pytest.mark.parametrize("seed", range(2))
@pytest.mark.parametrize("tip", [False, True])
def test_even_poles_are_counted_placed_and_measured(seed, tip):
    comb = evidence(20.0, EVEN, seed=seed, tip=tip).comb
    assert comb.is_resolved
    assert comb.share == 0.0
    assert comb.period_mm == pytest.approx(6.0, rel=0.03)
    assert len(comb.places_mm) == 10
    np.testing.assert_allclose(comb.places_mm, EVEN, atol=0.8)


def test_it_is_worked_out_in_small_steps_to_the_same_words():
    at_once, in_steps = evidence(20.0, EVEN), evidence(20.0, EVEN)
    assert in_steps.known is None
    assert sum(1 for _ in in_steps.work()) > 50
    assert in_steps.known == at_once.text
    assert in_steps.comb == at_once.comb
    assert list(in_steps.work()) == []


@pytest.mark.parametrize("seed", range(2))
def test_pairs_are_told_from_even_poles(seed):
    comb = evidence(25.0, PAIRS, noise=0.2, seed=seed).comb
    assert comb.is_resolved
    assert comb.paired > 0.9
    assert comb.period_mm == pytest.approx(8.0, rel=0.03)
    assert len(comb.places_mm) in (17, 18, 19)


@pytest.mark.parametrize("begins", [0, 25, 75])
def test_of_a_closed_curve_the_seam_is_found_wherever_the_loop_begins(begins):
    # Ten poles 6 mm apart along a loop of 20 mm: across its ends two of them are 8.8 mm apart.
    angle = 2.0 * np.pi * np.linspace(0.0, 1.0, POINTS)
    points = 10e-3 * np.column_stack([np.cos(angle), np.sin(angle), 0.0 * angle])
    shown = {p: np.roll(shown_along(62.8, EVEN, noise=0.4, seed=[3, ord(p)])[:-1], begins) for p in "ab"}
    comb = RingEvidence(points, {p: np.append(one, one[0]) for p, one in shown.items()}, 20.0).comb
    opened = evidence(20.0, EVEN, seed=3).comb
    assert comb.is_resolved
    assert comb.period_mm == pytest.approx(6.0, rel=0.03)
    assert comb.score > 0.8 * opened.score
    places = np.sort((EVEN + begins * 62.8 / (POINTS - 1)) % 62.8)
    assert len(comb.places_mm) == 10
    np.testing.assert_allclose(comb.places_mm, places, atol=0.9)


@pytest.mark.parametrize("seed", range(5))
def test_noise_is_no_comb_along_a_closed_curve(seed):
    angle = 2.0 * np.pi * np.linspace(0.0, 1.0, POINTS)
    points = 10e-3 * np.column_stack([np.cos(angle), np.sin(angle), 0.0 * angle])
    shown = {p: shown_along(62.8, [], noise=0.4, seed=[seed, ord(p)]) for p in "ab"}
    assert not RingEvidence(points, shown, 20.0).comb.is_resolved


@pytest.mark.parametrize("seed", range(5))
def test_noise_is_no_comb(seed):
    found = evidence(20.0, [], seed=seed)
    assert not found.comb.is_resolved
    assert found.text == "not resolved, 20 mm across"


def test_what_the_planes_show_at_different_places_is_no_comb():
    points = ring(20.0)
    shown = {
        "a": shown_along(59.7, EVEN[[0, 4, 7]], noise=0.3, seed=1),
        "b": shown_along(59.7, EVEN[[2, 3]] + 2.5, noise=0.3, seed=2),
    }
    assert not RingEvidence(points, shown, 20.0).comb.is_resolved


def test_the_planes_mean_nothing_by_their_names():
    one = evidence(20.0, EVEN)
    other = dataclasses.replace(one, shown={"a": one.shown["b"], "b": one.shown["a"]})
    assert one.text == other.text


def test_the_nearest_of_the_catalogue_is_named_where_it_is_clearly_nearest():
    # Eight poles 7 mm apart on a loop of 20 mm: 6 mm and an electrode of 1 mm.
    like = evidence(20.0, 1.0 + 7.0 * np.arange(8))
    assert nearest_catheter(like.comb, 20.0) is catalogue()["achieve_20"]
    assert like.text == "like achieve_20, 8 poles, 7.1 mm apart, 20 mm across"
    assert nearest_catheter(like.comb, 33.0) is None  # another size
    other = evidence(20.0, EVEN)
    assert other.text == "unknown, 10 poles, 6.0 mm apart, 20 mm across"


def test_of_a_named_catheter_only_the_place_is_fitted():
    entry = catalogue()["achieve_20"]
    found = evidence(20.0, 1.0 + 7.0 * np.arange(8), catheter=entry)
    assert found.text == "achieve_20, 8 poles, 7.1 mm apart: 8 seen along the ring, 20 mm across"
    assert "not resolved in the images" in evidence(20.0, [], catheter=entry).text
    nowhere = evidence(20.0, EVEN, catheter=catalogue()["achieve_advance_25"])
    assert nowhere.comb is None
    assert nowhere.text == "achieve_advance_25, 10 poles (distances not in the catalogue), 20 mm across"


def test_a_flat_profile_is_borne():
    flat = dict.fromkeys("ab", np.zeros(POINTS, np.float32))
    comb = RingEvidence(ring(20.0), flat, 20.0).comb
    assert not comb.is_resolved
    assert comb.score < 1.0


def test_a_tracker_says_what_it_follows_once_it_has_seen_a_few_pairs():
    # The drawn lasso: ten poles on 1.05 turns, evenly, and so dense that the evidence is clipped: they look longer.
    tracker = RingTracker(CONFIG)
    result = tracker.initialise(lasso_pair(0, moved(0)), lasso_seed())
    for index in range(1, 10):
        result = tracker.track(lasso_pair(index, moved(index)))
    assert result.catheter.comb.period_mm == pytest.approx(6.6, rel=0.05)
    assert result.catheter.text.startswith("unknown, 10 poles or pairs, 6.")
    assert result.catheter.text.endswith(" mm apart, 20 mm across")


def test_what_the_images_show_of_it_is_fitted_anew_only_while_it_is_learned():
    tracker = RingTracker(CONFIG)
    tracker.initialise(pair(0), lasso_seed())
    known = {}
    for index in range(1, 31):
        known[index] = tracker.track(pair(index)).catheter
    assert known[1] is not known[3]
    assert known[3] is not known[7]
    # A fit takes longer than a pair: once the profile is fixed there is one, whoever asks how often.
    assert all(known[index] is known[30] for index in range(24, 31))
