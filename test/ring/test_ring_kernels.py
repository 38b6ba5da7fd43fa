"""The compiled kernels against the plain versions, on random input and on images of a ring."""

from __future__ import annotations

import copy
from collections.abc import Callable
from itertools import pairwise
from typing import Any

import cv2
import numpy as np
import pytest
from support.breathing_lasso import ASIDE, CONFIG, pair
from support.lasso_inputs import CURVE, LOOP, VIEWS, bare, lasso_image, lasso_seed, noisy

from lasso_motion_ros.core import compiled
from lasso_motion_ros.core.compiled import has_kernels, plain
from lasso_motion_ros.geometry.frames import Frame, FramePair
from lasso_motion_ros.geometry.transforms import rotation_from_vector
from lasso_motion_ros.ring import correlation, loop_curve, search, seed_circle, slide
from lasso_motion_ros.ring import working_image as working_images
from lasso_motion_ros.ring.alignment import Alignment, RingPrior, align
from lasso_motion_ros.ring.companion_patches import CompanionGrid, CompanionPatch, PatchTuning, follow_patch
from lasso_motion_ros.ring.electrodes import likeliest_comb
from lasso_motion_ros.ring.loop_views import LoopViews
from lasso_motion_ros.ring.plane_companions import CompanionTuning, PlaneCompanions, Sighting
from lasso_motion_ros.ring.search import Peaks
from lasso_motion_ros.ring.seed_images import SeedImages
from lasso_motion_ros.ring.slide import SlideTuning
from lasso_motion_ros.ring.strip import strip_along
from lasso_motion_ros.ring.template import RingTemplate, TemplateTuning
from lasso_motion_ros.ring.temporal_filter import (
    DisplayChainTuning,
    difference,
    filter_of,
    grey_change,
    group_sums,
    sampled,
)
from lasso_motion_ros.ring.tracker import RingTracker
from lasso_motion_ros.ring.withdrawal import Withdrawal, WithdrawalTuning
from lasso_motion_ros.ring.working_image import WorkingImage, working_image

pytestmark = pytest.mark.skipif(not has_kernels(), reason="the extra `fast` is not installed")

ARMS = CURVE[::4] - LOOP.centre
SAME_M, SAME_RAD = 1e-9, 1e-7
ANGLES = np.linspace(0.0, 6.28, 120)
RAMP = np.arange(4, dtype=np.float32)[None].repeat(4, axis=0)
BESIDE = cv2.remap(RAMP, np.full((1, 1), 1.01, np.float32), np.ones((1, 1), np.float32), cv2.INTER_LINEAR)
interpolates_exactly = pytest.mark.skipif(
    abs(float(BESIDE[0, 0]) - 1.01) > 1e-4, reason="this OpenCV interpolates at 32nds of a pixel, the kernels do not"
)


def both(call: Callable[[], Any]) -> tuple[Any, Any]:
    """What the kernels and what the plain version give."""
    compiled = call()
    with plain():
        return compiled, call()


def images(generator: np.random.Generator, moved: np.ndarray, turn: np.ndarray) -> dict[str, WorkingImage]:
    curve = LOOP.centre + moved + (CURVE - LOOP.centre) @ rotation_from_vector(turn).T
    made = {}
    for plane, view in VIEWS.items():
        pixels = noisy(lasso_image(curve, view), generator.integers(1 << 30), 5.0)
        made[plane] = working_image(
            Frame(0, pixels, view),
            LOOP.centre,
            bright=False,
            shift=np.zeros(2),
            reach_mm=float(generator.uniform(14, 32)),
        )
    return made


def template(images: dict[str, WorkingImage]) -> RingTemplate:
    along = {plane: strip_along(LOOP.centre + ARMS, image.projection) for plane, image in images.items()}
    strips = {plane: along[plane].sample(image) for plane, image in images.items()}
    shown = {plane: image.evidence_at(along[plane].pixels) for plane, image in images.items()}
    return RingTemplate(strips, shown, TemplateTuning())


def same_alignment(one: Alignment, other: Alignment) -> None:
    assert (one.is_given_up, len(one.correlations)) == (other.is_given_up, len(other.correlations))
    np.testing.assert_allclose(one.correlations, other.correlations, atol=2e-6)
    np.testing.assert_allclose(one.turn, other.turn, atol=SAME_RAD)
    assert one.stretch == pytest.approx(other.stretch, abs=SAME_RAD)
    for plane, centre in one.centres.items():
        np.testing.assert_allclose(centre, other.centres[plane], rtol=0.0, atol=SAME_M)
        fit, plain_fit = one.planes[plane], other.planes[plane]
        np.testing.assert_allclose(fit.covariance, plain_fit.covariance, rtol=1e-4, atol=1e-14)
        np.testing.assert_allclose(fit.strip, plain_fit.strip, atol=1e-4)
        for name in ("contrast", "correlation", "evidence", "coverage", "visible", "residual_mm"):
            assert getattr(fit, name) == pytest.approx(getattr(plain_fit, name), rel=1e-4, abs=1e-5), name


@interpolates_exactly
@pytest.mark.parametrize("seed", range(8))
def test_an_alignment_ends_in_the_same_place(seed: int) -> None:
    generator = np.random.default_rng(seed)
    pattern = template(images(generator, np.zeros(3), np.zeros(3)))
    seen = images(generator, generator.normal(size=3) * 3e-4, generator.normal(size=3) * 0.03)
    planes = (["a", "b"], ["a"], ["b"])[seed % 4 % 3]
    # The fourth, and every fourth after it, begins where there is no ring.
    start = LOOP.centre + (np.array([0.004, 0.004, -0.005]) if seed % 4 == 3 else 0.0)
    compiled, plainly = both(
        lambda: align(
            {plane: seen[plane] for plane in planes},
            pattern,
            ARMS,
            dict.fromkeys(planes, start),
            RingPrior(float(np.radians(2.5)), 0.02),
            generator.normal(size=3) * 0.0,
        )
    )
    same_alignment(compiled, plainly)


@interpolates_exactly
def test_an_alignment_at_the_border_ends_in_the_same_place() -> None:
    """The loop hangs half out of the image, where what lies beyond it is zero."""
    generator = np.random.default_rng(1)
    whole = images(generator, np.zeros(3), np.zeros(3))
    pattern = template(whole)
    part = {plane: image.about(LOOP.centre + ARMS, -1.0) for plane, image in whole.items()}
    prior = RingPrior(float(np.radians(2.5)), 0.02)
    compiled, plainly = both(lambda: align(part, pattern, ARMS, dict.fromkeys("ab", LOOP.centre), prior))
    assert all(0.3 < fit.coverage < 0.99 for fit in compiled.planes.values())
    same_alignment(compiled, plainly)


@interpolates_exactly
@pytest.mark.parametrize("bright", [False, True])
@pytest.mark.parametrize("dtype", [np.uint8, np.uint16])
def test_a_working_image_is_the_same(dtype: type, bright: bool) -> None:
    generator = np.random.default_rng(2)
    most = np.iinfo(dtype).max
    pixels = np.clip(generator.normal(0.4, 0.1, (512, 512)) * most, 0, most).astype(dtype)
    pixels[:60, :200] = most // 2  # a collimator: without noise
    frame = Frame(0, pixels, VIEWS["a"])
    compiled, plainly = both(lambda: working_image(frame, LOOP.centre, bright=bright, shift=np.zeros(2)))
    np.testing.assert_allclose(compiled.noise, plainly.noise, rtol=1e-4)
    # Where there is no noise, rounding is divided by the noise's floor: 0.002 of 32,767 by 0.26, 1e-6 of a logarithm by
    # 1e-4.
    same = {"rtol": 0.0, "atol": 0.02}
    np.testing.assert_allclose(compiled.values[:60, :200], plainly.values[:60, :200], **same)
    np.testing.assert_allclose(compiled.values[60:], plainly.values[60:], atol=4e-5)
    np.testing.assert_allclose(compiled.values[:60, 200:], plainly.values[:60, 200:], atol=4e-5)
    height, width = plainly.values.shape
    for place in ((250.0, 200.0), (5.0, 8.0), (width - 4.0, height - 9.0), (-20.0, 100.0), (1e4, 1e4), (np.nan, 0.0)):
        around = np.array(place) + 40.0 * np.column_stack([np.cos(ANGLES), np.sin(ANGLES)])
        shown, plainly_shown = both(lambda around=around: plainly.evidence_at(around))
        np.testing.assert_allclose(shown, plainly_shown, **same)
        if np.isfinite(around).all():
            (evidence, _), (plain_evidence, _) = both(lambda around=around: plainly.evidence_about(around))
            np.testing.assert_allclose(evidence, plain_evidence, **same)


@pytest.mark.parametrize("most", [3, 4095, 65535])
@pytest.mark.parametrize("at", [(0, 0, 512, 512), (6, 250, 111, 37), (1023 - 9, 1022, 4, 1)])
def test_a_part_of_an_image_is_reduced_to_half_alike(most: int, at: tuple[int, int, int, int]) -> None:
    pixels = np.random.default_rng(most).integers(0, most + 1, (1024, 1024)).astype(np.uint16)
    made, plainly = both(lambda: working_images._reduced(pixels, *at, 2))
    np.testing.assert_array_equal(made, plainly)
    # An image of which only some columns are read is not one piece of memory.
    apart, plainly = both(lambda: working_images._reduced(np.repeat(pixels, 2, axis=1)[:, ::2], *at, 2))
    np.testing.assert_array_equal(apart, plainly)
    np.testing.assert_array_equal(apart, made)


@pytest.mark.parametrize("seed", range(20))
def test_a_template_is_laid_back_alike(seed: int) -> None:
    generator = np.random.default_rng(seed)
    count = int(generator.integers(5, 150))
    angle = np.linspace(0.0, generator.uniform(1.0, 7.0), count)
    arms = 0.01 * np.column_stack([np.cos(angle), generator.uniform(0.0, 1.0) * np.sin(angle), 0.1 * np.sin(angle)])
    arms = arms @ rotation_from_vector(generator.normal(size=3)).T
    arms[3] = arms[2]  # points that coincide
    values = generator.normal(size=(count, 13)).astype(np.float32)
    view = VIEWS["ab"[seed % 2]].binned(2, 2)
    (kernel, first), (plain_kernel, plain_first) = both(lambda: search._laid_out(values, view, LOOP.centre, arms))
    np.testing.assert_array_equal(first, plain_first)
    np.testing.assert_allclose(kernel, plain_kernel, atol=2e-5)


@pytest.mark.parametrize("shape", [(8, 10), (9, 10), (8, 15), (9, 15), (1, 6), (6, 1)])
def test_transforms_are_multiplied_alike(shape: tuple[int, int]) -> None:
    generator = np.random.default_rng(4)
    one, other = (cv2.dft(generator.normal(size=shape).astype(np.float32)) for _ in range(2))
    compiled, plainly = both(lambda: correlation._product(one.copy(), other))
    np.testing.assert_allclose(compiled, plainly, rtol=1e-6)


@pytest.mark.parametrize("seed", range(20))
def test_the_same_peaks_are_found(seed: int) -> None:
    generator = np.random.default_rng(seed)
    shape = generator.integers(1, 90, 2)
    scores = generator.normal(size=shape).astype(np.float32)
    if seed % 3 == 0:  # many that are alike
        scores = np.round(scores)
    width, height = (int(generator.integers(1, side + 1)) for side in shape[::-1])
    (found, places), (plain_found, plain_places) = both(lambda: search._highest(scores, width, height))
    np.testing.assert_allclose(found, plain_found, rtol=1e-5)
    np.testing.assert_allclose(places, plain_places, atol=1e-5)


@pytest.mark.parametrize("seed", range(20))
def test_the_same_peaks_are_joined(seed: int) -> None:
    generator = np.random.default_rng(seed)
    counts = generator.integers(0, 25, 2)
    points = LOOP.centre + generator.normal(size=(max(counts), 3)) * 0.02
    peaks, sources = [], []
    for view, count in zip(VIEWS.values(), counts, strict=True):
        off = generator.normal(size=(count, 3)) * generator.choice([1e-4, 5e-3])
        image = bare(np.zeros((view.height, view.width), np.float32), view)
        peaks.append(Peaks(generator.uniform(2.0, 30.0, count), view.project(points[:count] + off), image))
        sources.append(view.source)
    axes = generator.normal(size=(3, 3)) * generator.uniform(3e-3, 3e-2, 3)
    covariance = axes @ axes.T
    wanted = int(generator.integers(1, 12))
    compiled, plainly = both(lambda: search._joined(*peaks, *sources, LOOP.centre, covariance, 0.002, wanted))
    for one, other in zip(compiled, plainly, strict=True):
        np.testing.assert_allclose(one, other, rtol=1e-9, atol=1e-12)


def places(generator: np.random.Generator) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    count = int(generator.integers(4, 60))
    times = np.cumsum(generator.uniform(0.25, generator.choice([0.4, 1.2]), count))
    axis = generator.normal(size=3)
    axis /= np.linalg.norm(axis)
    breath = 0.006 * generator.uniform() * np.sin(1.5 * times)
    points = breath[:, None] * axis + generator.normal(size=(count, 3)) * 3e-4 * generator.uniform(0.1, 1.0)
    slid = np.maximum(times - generator.choice(times), 0.0) if generator.random() < 0.7 else np.zeros(count)
    return points + slid[:, None] * generator.normal(size=3) * 4e-4, times, generator.random(count) < 0.9, axis


def test_a_slide_is_told_alike() -> None:
    generator = np.random.default_rng(0)
    told = 0
    for _ in range(300):
        case = places(generator)
        compiled, plainly = both(lambda case=case: slide._change_point(*case, SlideTuning()))
        assert compiled.across == pytest.approx(plainly.across, rel=1e-9, abs=1e-12)
        assert compiled.log_odds == pytest.approx(plainly.log_odds, rel=1e-9, abs=1e-9)
        told += plainly.log_odds > 0.0
    assert 100 < told < 250


def test_arcs_are_told_alike() -> None:
    generator, withdrawal = np.random.default_rng(0), Withdrawal.first(WithdrawalTuning())
    usual = {plane: generator.uniform(-0.2, 2.0, 120).astype(np.float32) for plane in VIEWS}
    for _ in range(30):
        shown = {plane: (usual[plane] + generator.normal(0.0, 0.4, 120)).astype(np.float32) for plane in VIEWS}
        first, length = generator.integers(120, size=2)
        for values in shown.values():
            values[first : first + length] = generator.choice([0.0, 0.1])  # outside the image, or nothing of the ring
        compiled, plainly = both(lambda shown=shown, before=withdrawal: before.after(shown, usual))
        np.testing.assert_allclose(compiled.told, plainly.told, rtol=1e-9, atol=1e-9)
        np.testing.assert_allclose(compiled.variances, plainly.variances, rtol=1e-9)
        assert compiled.share == plainly.share
        withdrawal = plainly


@pytest.mark.parametrize(
    ("shape", "dtype"),
    [((512, 512), np.uint8), ((1024, 1000), np.uint16), ((100, 301), np.uint16), ((20, 16), np.uint8)],
)
def test_a_display_filter_is_seen_alike(shape: tuple[int, int], dtype: type) -> None:
    generator, tuning = np.random.default_rng(shape[0]), DisplayChainTuning()
    film = [generator.normal(120.0, 9.0, shape) for _ in range(3)]
    for before, after in pairwise(film):
        after += 0.4 * (before - after)

    def sums() -> tuple[Any, ...]:
        samples = [sampled(pixels.astype(dtype), tuning) for pixels in film]
        changes = [difference(after, before, tuning) for before, after in pairwise(samples)]
        return samples[0], changes[1], group_sums(changes[1], changes[0], tuning), grey_change(samples[0], samples[1])

    (sample, change, groups, grey), (plain_sample, plain_change, plain_groups, plain_grey) = both(sums)
    assert grey == pytest.approx(plain_grey, rel=1e-5)
    np.testing.assert_array_equal(sample.values, plain_sample.values)
    np.testing.assert_allclose(sample.grey, plain_sample.grey, rtol=1e-6)
    np.testing.assert_allclose(change.fine, plain_change.fine, atol=2e-5)
    np.testing.assert_allclose(change.energy, plain_change.energy, rtol=1e-5)
    np.testing.assert_allclose(change.moved, plain_change.moved, rtol=1e-4, atol=1e-5)
    if plain_groups is None:
        assert groups is None
        return
    np.testing.assert_allclose(groups, plain_groups, rtol=1e-4, atol=1e-3)
    compiled, plainly = both(lambda: filter_of(plain_groups))
    assert compiled == pytest.approx(plainly, rel=1e-9)


@pytest.mark.parametrize("seed", range(5))
def test_clicks_are_as_far_from_a_circle(seed: int) -> None:
    generator = np.random.default_rng(seed)
    circles = generator.normal(size=(30, 6)) * [5.0, 5.0, 5.0, 8.0, 8.0, 8.0]
    clicks = {plane: view.project(CURVE[:: 20 + seed]) for plane, view in VIEWS.items()}
    seen = images(generator, np.zeros(3), np.zeros(3))
    views = seed_circle._Views(
        [seed_circle._View.of(clicks[plane], view, seen[plane], LOOP.centre) for plane, view in VIEWS.items()]
    )
    around = circles + np.r_[1e3 * LOOP.centre, np.zeros(3)]
    (beside, shown), (plain_beside, plain_shown) = both(lambda: views.both(around))
    np.testing.assert_allclose(beside, plain_beside, rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose(shown, plain_shown, atol=1e-6)
    np.testing.assert_allclose(beside, views.beside(around), rtol=1e-12)


@pytest.mark.parametrize("turns", [0.9, 1.0])  # open, and closed
@pytest.mark.parametrize("seed", range(2))
def test_combs_are_as_likely(seed: int, turns: float) -> None:
    random = np.random.default_rng(seed)
    turn = 2.0 * np.pi * np.linspace(0.0, turns, 120)
    points = 0.01 * np.column_stack([np.cos(turn), np.sin(turn), 0.1 * random.normal(size=120)])
    shown = {plane: random.normal(size=120).astype(np.float32) for plane in ("a", "b")}
    compiled, plainly = both(lambda: likeliest_comb(points, shown))
    assert compiled.places_mm == pytest.approx(plainly.places_mm, rel=1e-12)
    assert (compiled.period_mm, compiled.share, compiled.length_mm) == (
        plainly.period_mm,
        plainly.share,
        plainly.length_mm,
    )
    for told in ("score", "probability", "paired"):
        assert getattr(compiled, told) == pytest.approx(getattr(plainly, told), rel=1e-9), told


@pytest.mark.parametrize("is_cut", [False, True])
@pytest.mark.parametrize("is_fine", [False, True])
@pytest.mark.parametrize("seed", range(3))
def test_a_curve_is_as_probable(seed: int, is_fine: bool, is_cut: bool) -> None:
    generator = np.random.default_rng(seed)
    frames = {p: Frame(0, noisy(lasso_image(CURVE, view), [seed, ord(p)], 5.0), view) for p, view in VIEWS.items()}
    if is_cut:  # half of the loop lies outside the picture
        for plane, frame in frames.items():
            x = round(float(frame.projection.project(LOOP.centre)[0]))
            height, width = frame.pixels.shape
            projection = frame.projection.cropped(x, 0, width - x, height)
            frames[plane] = Frame(0, np.ascontiguousarray(frame.pixels[:, x:]), projection)
    clicks = lasso_seed()
    start = CURVE[::4] + generator.normal(0.0, 3e-4, 3)
    fit = loop_curve._Fit(
        start, SeedImages(FramePair(0, **frames), bright=False), dict.fromkeys("ab", np.zeros(2)), clicks
    )
    fit.look(1.0, fine=is_fine)
    parameters = fit._parameters + generator.normal(0.0, 0.1, len(fit._parameters))
    for one, other in zip(*both(lambda: fit._probability(parameters)), strict=True):
        np.testing.assert_allclose(one, other, rtol=1e-9, atol=1e-9 * np.abs(other).max())


def test_the_likeliest_curve_is_the_same() -> None:
    frames = {p: Frame(0, noisy(lasso_image(CURVE, view), [3, ord(p)], 5.0), view) for p, view in VIEWS.items()}
    images = SeedImages(FramePair(0, **frames), bright=False)
    start, shifts = CURVE[::4] + 3e-4, dict.fromkeys("ab", np.zeros(2))
    compiled, plainly = both(lambda: loop_curve.likeliest_curve(start, images, shifts, lasso_seed()))
    assert np.linalg.norm(compiled.points - start, axis=1).max() > 2e-4
    np.testing.assert_allclose(compiled.points, plainly.points, atol=1e-8)
    assert compiled.log_odds == pytest.approx(plainly.log_odds, abs=1e-3)


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16])
@pytest.mark.parametrize("factor", [1, 2, 3])
@pytest.mark.parametrize("place", ["inside", "at the border", "outside"])
def test_a_companion_is_followed_alike(dtype: type, factor: int, place: str) -> None:
    generator = np.random.default_rng(factor)
    grid, tuning = CompanionGrid(factor, float(generator.uniform(0.4, 0.7)), bright=factor == 2), PatchTuning()
    cell, half = grid.cell_px, round(tuning.half_mm / grid.cell_mm)
    rough = np.kron(generator.uniform(0.3, 0.7, (40, 50)), np.ones((4 * cell, 4 * cell)))
    spots = cv2.GaussianBlur(rough, (0, 0), 2.0 * cell) + generator.normal(0.0, 0.01, rough.shape)
    pixels = np.clip(spots * np.iinfo(dtype).max, 0, np.iinfo(dtype).max).astype(dtype)
    pixels[: 70 * cell, 115 * cell :] = 0  # a collimator
    # A part of it that begins within a row, and ends within a cell.
    frame = Frame(0, pixels[: 1 - cell, cell:], VIEWS["a"])
    home = np.array({"inside": [100, 80], "at the border": [half + 2, half + 1], "outside": [100, -200]}[place])
    about = np.array([100, 80]) if place == "outside" else home
    x, y = (about * cell).tolist()
    values = cv2.resize(
        frame.pixels[y - half * cell :, x - half * cell :].astype(np.float32), None, fx=1 / cell, fy=1 / cell
    )
    values = values[: 2 * half + 1, : 2 * half + 1].copy()
    patch = CompanionPatch(home, values, lowest=float(generator.uniform(-0.1, 0.0)))
    likely = np.array([[0.3, -0.7], [2.0, 3.0], [30.0, 0.0]])
    (moved, likeness), (plain_moved, plain_likeness) = both(lambda: follow_patch(patch, frame, grid, likely, tuning))
    np.testing.assert_allclose(moved, plain_moved, rtol=0.0, atol=1e-4)
    assert likeness == pytest.approx(plain_likeness, abs=1e-5)
    assert (likeness == 0.0) == (place == "outside")


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16])
def test_a_companion_is_not_found_where_all_is_even(dtype: type) -> None:
    frame, grid = Frame(0, np.full((300, 400), 77, dtype), VIEWS["a"]), CompanionGrid(1, 0.5, bright=False)
    values = np.random.default_rng(0).normal(size=(29, 29)).astype(np.float32)
    patch = CompanionPatch(np.array([100, 80]), values, lowest=-1.0)
    for _, likeness in both(lambda: follow_patch(patch, frame, grid, np.zeros((1, 2)), PatchTuning())):
        assert likeness == 0.0


@pytest.mark.parametrize("seed", range(4))
def test_companions_tell_the_same(seed: int) -> None:
    generator = np.random.default_rng(seed)
    grid, view, tuning = CompanionGrid(1, 0.5, bright=False), VIEWS["a"], CompanionTuning(kept_after=100)
    patch = CompanionPatch(np.array([50, 50]), np.zeros((29, 29), np.float32), lowest=0.0)
    there = PlaneCompanions([patch] * 4, grid, LOOP.centre, view, tuning)
    for time_s in range(12):
        index = np.flatnonzero(generator.random(4) < 0.7)
        places, ring = generator.normal(size=(len(index), 2)) * 3.0, generator.normal(size=2) * 3.0
        # Some see it where it is, others anywhere.
        places[: seed % 3] = ring + generator.normal(size=(min(seed % 3, len(index)), 2)) * 0.3
        told, plainly = both(lambda index=index, places=places, ring=ring: there._told(index, places, ring))
        for one, other in zip(told, plainly, strict=True):
            np.testing.assert_allclose(one, other, rtol=1e-9, atol=1e-12)
        off, variance, _, odds = told
        sighting = Sighting(index, places, ring, off, variance, odds, None)
        # What is learned of it, too.
        other = copy.deepcopy(there)
        learned(there, time_s, sighting)
        with plain():
            learned(other, time_s, sighting)
        for name, value in vars(there).items():
            if isinstance(value, np.ndarray):
                np.testing.assert_allclose(value, getattr(other, name), rtol=1e-9, atol=1e-12, err_msg=name)


def learned(companions: PlaneCompanions, time_s: int, sighting: Sighting) -> None:
    companions.weigh(sighting, CompanionTuning().least_step)
    companions.learn(float(time_s), sighting)


def follow() -> list[Any]:
    """A ring that breathes, hides and is moved by hand; one plane is missing now and then."""
    tracker = RingTracker(CONFIG)
    followed = [tracker.initialise(pair(0), lasso_seed())]
    followed += [tracker.track(pair(index)) for index in range(1, 10)]
    followed += [tracker.track(pair(index, planes=planes)) for index, planes in ((10, "a"), (11, "b"), (12, "ab"))]
    return followed + [tracker.track(pair(index, ASIDE)) for index in range(13, 16)]


def assert_alike(results: list[Any], others: list[Any]) -> None:
    for one, other in zip(results, others, strict=True):
        assert (one.state, one.motion is None) == (other.state, other.motion is None)
        if other.motion is not None:
            there = np.r_[LOOP.centre, 1.0]
            np.testing.assert_allclose(one.motion @ there, other.motion @ there, rtol=0.0, atol=5e-9)
            np.testing.assert_allclose(one.covariance, other.covariance, rtol=1e-3, atol=1e-12)
        if other.loop is not None:
            np.testing.assert_allclose(one.loop, other.loop, rtol=0.0, atol=5e-8)


@interpolates_exactly
def test_a_ring_that_breathes_hides_and_is_moved_is_followed_alike() -> None:
    assert_alike(*both(follow))


@interpolates_exactly
def test_it_is_followed_alike_whenever_the_kernels_come(monkeypatch: pytest.MonkeyPatch) -> None:
    """In the midst of a pair, too: at each call by chance."""
    with plain():
        plainly = follow()
    generator = np.random.default_rng(8)
    monkeypatch.setattr(compiled, "_is_plain", lambda: bool(generator.random() < 0.5))
    assert_alike(follow(), plainly)


def test_what_an_image_covers_is_the_same() -> None:
    tracker = RingTracker(CONFIG)
    tracker.initialise(pair(0), lasso_seed())
    track = tracker.known
    assert track is not None
    generator, shares = np.random.default_rng(0), []
    for frame in 20 * tuple(pair(0).frames.values()):
        centre = track.model.centre + 0.08 * generator.normal(size=3)
        shift = generator.normal(size=2)
        share, plainly = both(lambda: track.detector._covers(frame, shift, centre))  # noqa: B023
        assert share == pytest.approx(plainly, abs=1e-6)
        shares.append(share)
    assert min(shares) < 0.1
    assert 0.1 < max(shares) <= 1.0
    shown = []
    for frame in 20 * tuple(pair(0).frames.values()):
        image = working_image(frame, track.model.centre, bright=False, shift=np.zeros(2))
        centre = track.model.centre + 0.03 * generator.normal(size=3)
        one, plainly = both(lambda: track.detector._is_shown(image, centre))  # noqa: B023
        assert one == plainly
        shown.append(one)
    assert 5 < sum(shown) < 35


@pytest.mark.parametrize("place", [(250.0, 200.0), (2.0, 3.0), (-40.0, 90.0), (1e5, 1e5)])
def test_a_contrast_is_told_in_the_same_unit(place: tuple[float, float]) -> None:
    generator = np.random.default_rng(5)
    noise = generator.uniform(1.0, 9.0, (300, 400)).astype(np.float32)
    grey = generator.integers(0, 4096, (300, 400)).astype(np.uint16)
    view = VIEWS["a"]
    image = WorkingImage(noise, view, noise, grey)
    centre = view.source + view.rays(np.array(place)) * 0.7
    unit, plainly = both(lambda: image.contrast_unit(centre))
    assert unit == pytest.approx(plainly, rel=1e-12)


@pytest.mark.parametrize("seed", range(4))
def test_what_a_curve_shows_is_summed_up_alike(seed: int) -> None:
    from lasso_motion_ros.ring.compiled_views import CompiledLoopViews

    generator = np.random.default_rng(seed)
    seen = images(generator, np.zeros(3), np.zeros(3))
    pattern = template(seen)
    views = CompiledLoopViews(seen, pattern, np.array([LOOP.centre] * 2))
    pixels = generator.uniform(-60.0, 300.0, (len(pattern.weights), 2)) * (seed > 0)
    values = generator.uniform(-1.0, 2.0, len(pattern.weights)).astype(np.float32)
    sums = views._summed(values, pixels, seen["a"])
    np.testing.assert_allclose(sums, LoopViews._summed(views, values, pixels, seen["a"]), rtol=1e-9, atol=1e-12)
