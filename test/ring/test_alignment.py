from functools import cache

import numpy as np
import pytest
from support.lasso_inputs import CURVE, LOOP, VIEWS, lasso_image, noisy
from support.method_inputs import biplane, draw_curve, flipped

from lasso_motion_ros.geometry.frames import Frame
from lasso_motion_ros.geometry.projection import Projection
from lasso_motion_ros.geometry.transforms import rotation_from_vector
from lasso_motion_ros.ring.alignment import RingPrior, align, align_from_afar
from lasso_motion_ros.ring.strip import strip_along
from lasso_motion_ros.ring.template import RingTemplate, TemplateTuning
from lasso_motion_ros.ring.working_image import working_image

ARMS = CURVE[::4] - LOOP.centre
PRIOR = RingPrior(np.radians(2.5), 0.02)
LOOSE = RingPrior(np.radians(6.0), 0.06)
UP = np.array([0.0, 0.0, 0.3e-3])
MOVED = np.array([0.3e-3, 0.2e-3, -0.35e-3])
START = {"a": LOOP.centre, "b": LOOP.centre}
NOTHING, PLAIN = 0.8, 1.5  # evidence: less than that tells of no ring, more than this of one


@cache
def clean_image(plane, side, moved):
    translation, turn, stretch = (np.array(moved[:3]), np.array(moved[3:6]), moved[6])
    arms = (CURVE - LOOP.centre) @ rotation_from_vector(turn).T * np.exp(stretch)
    return lasso_image(LOOP.centre + translation + arms, biplane(side=side)[plane])


def clean_images(translation=(0, 0, 0), turn=(0, 0, 0), stretch=0.0, side=512):
    moved = (*map(float, translation), *map(float, turn), float(stretch))
    return {name: clean_image(name, side, moved) for name in "ab"}


def working(pixels, view):
    return working_image(Frame(0, pixels, view), LOOP.centre, bright=False, shift=np.zeros(2), reach_mm=32.0)


def images(clean, seed=1, sigma=5.0, views=None):
    views = views or biplane(side=len(clean["a"]))
    return {name: working(noisy(clean[name], [seed, ord(name)], sigma), views[name]) for name in clean}


def learned(images):
    along = {name: strip_along(LOOP.centre + ARMS, image.projection) for name, image in images.items()}
    strips = {name: along[name].sample(image) for name, image in images.items()}
    shown = {name: image.evidence_at(along[name].pixels) for name, image in images.items()}
    return RingTemplate(strips, shown, TemplateTuning())


@cache
def template(side=512):
    return learned(images(clean_images(side=side), seed=999))


def across_mm(fit, truth):
    """(2,) how far a plane's fit is from a true centre, across its ray."""
    return 1e3 * (fit.across @ (fit.centre - truth))


@pytest.mark.parametrize(("side", "count"), [(512, 4), (1024, 1)])
def test_a_shift_is_recovered_to_a_tenth_of_a_pixel(side, count):
    for seed, translation in enumerate(np.random.default_rng(3).uniform(-0.4e-3, 0.4e-3, (count, 3))):
        found = align(images(clean_images(translation, side=side), seed), template(side), ARMS, START, PRIOR)
        for fit in found.planes.values():
            assert np.abs(across_mm(fit, LOOP.centre + translation)).max() < 0.025
            assert fit.visible == pytest.approx(1.0)
        assert min(found.likeness.values()) > 0.9
        assert np.degrees(np.abs(found.turn)).max() < 0.3
        assert abs(found.stretch) < 0.003


def test_each_plane_has_its_own_shift():
    # Not calibrated to each other, or not exposed together: no 3-D point explains both.
    up, down = clean_images(UP), clean_images(-UP)
    found = align(images({"a": up["a"], "b": down["b"]}), template(), ARMS, START, PRIOR)
    assert np.abs(across_mm(found.planes["a"], LOOP.centre + UP)).max() < 0.025
    assert np.abs(across_mm(found.planes["b"], LOOP.centre - UP)).max() < 0.025


def test_the_start_is_refined_from_either_side():
    found = [
        align(images(clean_images()), template(), ARMS, dict.fromkeys("ab", LOOP.centre + start), PRIOR)
        for start in (np.array([0.4e-3, -0.3e-3, 0.4e-3]), np.array([-0.4e-3, 0.3e-3, -0.4e-3]))
    ]
    for plane in "ab":
        fits = [f.planes[plane] for f in found]
        assert np.abs(across_mm(fits[0], fits[1].centre)).max() < 0.01
        # Only across the ray does a plane say anything: along it, the start's depth is kept.
        ray = LOOP.centre - VIEWS[plane].source
        ray /= np.linalg.norm(ray)
        depth = [1e3 * ray @ (fit.centre - LOOP.centre) for fit in fits]
        assert depth[0] == pytest.approx(-depth[1], abs=0.01)


def test_directions_are_across_the_ray_and_perpendicular():
    found = align(images(clean_images()), template(), ARMS, START, PRIOR)
    for plane, fit in found.planes.items():
        ray = fit.centre - VIEWS[plane].source
        np.testing.assert_allclose(fit.across @ fit.across.T, np.eye(2), atol=1e-12)
        np.testing.assert_allclose(fit.across @ (ray / np.linalg.norm(ray)), 0.0, atol=1e-3)
        assert fit.strip.shape == template().values.shape


def test_the_evidence_is_the_weighted_mean_of_what_is_shown_along_the_curve():
    for name, fit in align(images(clean_images()), template(), ARMS, START, PRIOR).planes.items():
        assert fit.shown.shape == (len(ARMS),)
        assert fit.coverage == pytest.approx(1.0)
        assert fit.evidence == pytest.approx(float(template().weights @ fit.shown), rel=1e-4)
        # Where the electrodes are there is more of it than between them.
        weights = template().weights
        assert fit.shown[weights > 0.01].mean() > fit.shown[weights == 0.0].mean() + 0.3, name


TURNS_DEG = [[3.0, 0.0, 0.0], [0.0, 3.0, 0.0], [0.0, 0.0, -3.0], [-2.0, 1.5, 2.0]]


@pytest.mark.parametrize("turn_deg", TURNS_DEG)
def test_the_rings_own_turn_is_recovered(turn_deg):
    # Tilt about any axis, and spin, which the electrodes show; where the shift is right from the start, too.
    for seed in (1, 3, 6):
        turned = images(clean_images(turn=np.radians(turn_deg)), seed)
        found = align(turned, template(), ARMS, START, LOOSE)
        np.testing.assert_allclose(np.degrees(found.turn), turn_deg, atol=0.5)
        error = found.turn - np.radians(turn_deg)
        assert error @ np.linalg.solve(found.turn_covariance, error) < 11.3  # 99 % for three
        for fit in found.planes.values():
            assert np.abs(across_mm(fit, LOOP.centre)).max() < 0.03


@pytest.mark.parametrize("stretch", [-0.03, 0.03])
def test_the_rings_stretch_is_recovered(stretch):
    found = align(images(clean_images(stretch=stretch)), template(), ARMS, START, LOOSE)
    assert found.stretch == pytest.approx(stretch, abs=0.004)
    for fit in found.planes.values():
        assert np.abs(across_mm(fit, LOOP.centre)).max() < 0.03


def test_priors_hold_turn_and_stretch():
    turned = images(clean_images(turn=np.radians([3.0, 0.0, 0.0]), stretch=0.02))
    held = align(turned, template(), ARMS, START, RingPrior(1e-6, 1e-6))
    np.testing.assert_allclose(held.turn, 0.0, atol=1e-6)
    assert held.stretch == pytest.approx(0.0, abs=1e-6)
    np.testing.assert_allclose(np.sqrt(np.diag(held.turn_covariance)), 1e-6, rtol=1e-3)


def test_priors_pull_back_what_started_elsewhere():
    turn = np.radians([3.0, 0.0, 0.0])
    found = align(images(clean_images(turn=turn)), template(), ARMS, START, RingPrior(1e-4, 1e-4), turn=turn)
    np.testing.assert_allclose(np.degrees(found.turn), 0.0, atol=0.05)


def test_the_ring_can_start_from_where_it_was():
    turn = np.radians([14.0, -11.0, 8.0])
    turned = images(clean_images(turn=turn, stretch=0.02))
    found = align(turned, template(), ARMS, START, RingPrior(0.2, 0.1), turn=turn, stretch=0.02)
    np.testing.assert_allclose(np.degrees(found.turn), np.degrees(turn), atol=0.5)
    assert found.stretch == pytest.approx(0.02, abs=0.004)


def test_the_covariance_grows_with_the_noise_and_is_about_right():
    sizes = []
    for sigma in (8.0, 16.0, 30.0):
        pattern = learned(images(clean_images(), 999, sigma))
        normalised, covariances = [], []
        for seed in range(12):
            for fit in align(images(clean_images(), seed, sigma), pattern, ARMS, START, PRIOR).planes.values():
                error = fit.across @ (fit.centre - LOOP.centre)
                normalised.append(error @ np.linalg.solve(fit.covariance, error) / 2.0)
                covariances.append(np.trace(fit.covariance))
                assert (np.linalg.eigvalsh(fit.covariance) > 0.0).all()
        # The segments' scatter holds what the shared profile leaves out of each plane: 0.02 mm, whatever the noise.
        assert 0.05 < np.mean(normalised) < 1.6
        sizes.append(1e3 * np.sqrt(np.mean(covariances) / 2.0))
    assert sizes[0] < sizes[1] < sizes[2]
    assert sizes[2] > 1.4 * sizes[0]
    assert 0.005 < sizes[1] < 0.06


@pytest.mark.parametrize("plane", ["a", "b"])
def test_a_wire_across_the_loop_does_not_pull(plane):
    clean = clean_images()
    moved = clean_images(MOVED)
    x, y = VIEWS[plane].project(LOOP.centre)
    crossing = np.array([[x - 60.0, y + 5.0], [x + 60.0, y + 20.0]])
    along = VIEWS[plane].project(CURVE[40:90]) + np.array([3.0, 2.0])  # another one, 1 mm beside an eighth of the loop
    for wire in (crossing, along):
        wired = dict(moved)
        wired[plane] = draw_curve(wire, clean[plane].shape, sigma_px=1.5, background=moved[plane], depth=60.0)
        found = align(images(wired), template(), ARMS, START, PRIOR)
        for fit in found.planes.values():
            assert np.abs(across_mm(fit, LOOP.centre + MOVED)).max() < 0.06


def test_what_is_covered_is_not_visible():
    clean = clean_images()
    covered = {name: image.copy() for name, image in clean.items()}
    x, _ = np.rint(VIEWS["a"].project(LOOP.centre)).astype(int)
    covered["a"][:, x:] = 150
    found = align(images(covered), template(), ARMS, START, PRIOR)
    assert 0.25 < found.planes["a"].visible < 0.75
    assert found.planes["b"].visible == pytest.approx(1.0)


def test_a_faint_loop_is_seen_as_faint():
    # A quarter of the contrast in the same noise; the division by the local spread hides some of that.
    clean, empty = clean_images(), {n: lasso_image(CURVE + 10.0, VIEWS[n]) for n in "ab"}
    faint = {n: np.rint(0.25 * clean[n] + 0.75 * empty[n]).astype(np.uint8) for n in "ab"}
    pattern = learned(images(clean, 999, 12.0))
    weak, strong = (align(images(seen, 1, 12.0), pattern, ARMS, START, PRIOR) for seen in (faint, clean))
    for plane in "ab":
        assert weak.planes[plane].contrast < 0.5 * strong.planes[plane].contrast
        assert weak.planes[plane].correlation < strong.planes[plane].correlation


def test_contrast_is_the_loops_whatever_the_brightness():
    clean, empty = clean_images(), {n: lasso_image(CURVE + 10.0, VIEWS[n]) for n in "ab"}

    def contrast(share, level):
        shown = {n: (empty[n] + share * (clean[n].astype(float) - empty[n])) * level for n in "ab"}
        seen = {n: working(shown[n].astype(np.uint16), VIEWS[n]) for n in "ab"}
        return align(seen, template(), ARMS, START, PRIOR).planes

    full, half, dim = contrast(1.0, 20.0), contrast(0.5, 20.0), contrast(1.0, 8.0)
    for plane in "ab":
        assert half[plane].contrast == pytest.approx(0.5 * full[plane].contrast, rel=0.1)
        assert dim[plane].contrast == pytest.approx(full[plane].contrast, rel=0.05)


def test_a_place_without_the_loop_is_given_up():
    empty = {n: np.full((512, 512), 150, np.uint8) for n in "ab"}
    fits = []
    for seed in range(4):
        found = align(images(empty, seed), template(), ARMS, START, RingPrior(1.0, 0.02))
        for plane, fit in found.planes.items():
            assert fit.evidence < NOTHING
            assert fit.correlation < 0.4
            fits.append(np.linalg.norm(across_mm(fit, START[plane])))
        # After two steps, of at most 0.4 mm and 0.03 rad in each direction, it is left where it is.
        assert np.abs(found.turn).max() <= 0.06 + 1e-9
    assert max(fits) <= 2.0 * 0.4 * np.sqrt(2.0) + 1e-6


def test_likeness_is_correlation_by_what_is_usual():
    seen = images(clean_images(MOVED))
    found = align(seen, template(), ARMS, START, PRIOR)
    for plane, fit in found.planes.items():
        assert 0.8 < found.likeness[plane] < 1.3
        assert found.likeness[plane] == pytest.approx(fit.correlation / template().usual[plane])


def test_a_plane_without_the_loop_does_not_stop_the_other():
    clean = clean_images(MOVED)
    half = images({"a": np.full((512, 512), 150, np.uint8), "b": clean["b"]})
    found = align(half, template(), ARMS, START, PRIOR)
    assert np.abs(across_mm(found.planes["b"], LOOP.centre + MOVED)).max() < 0.03
    assert found.planes["a"].evidence < NOTHING < PLAIN < found.planes["b"].evidence


@pytest.mark.parametrize("seed", range(4))
def test_a_plane_that_shows_a_tenth_of_the_loop_is_not_waited_for(seed):
    clean = clean_images(MOVED)
    rows = biplane(side=512)["a"].project(CURVE + MOVED)[:, 1]
    covered = clean["a"].copy()
    covered[int(np.quantile(rows, 0.1)) :] = 150
    shown = images({"a": covered, "b": clean["b"]}, seed)
    found = align(shown, template(), ARMS, START, PRIOR)
    alone = align({"b": shown["b"]}, template(), ARMS, START, PRIOR)
    assert not found.is_given_up
    assert len(found.correlations) <= len(alone.correlations) + 1  # of eight


@pytest.mark.parametrize("plane", ["a", "b"])
def test_one_plane_alone(plane):
    clean = clean_images(MOVED)
    found = align(images({plane: clean[plane]}, views=VIEWS), template(), ARMS, {plane: LOOP.centre}, PRIOR)
    assert set(found.planes) == {plane}
    assert np.abs(across_mm(found.planes[plane], LOOP.centre + MOVED)).max() < 0.03


def test_nothing_at_all_gives_finite_numbers():
    blank = {n: working(np.zeros((512, 512), np.uint8), VIEWS[n]) for n in "ab"}
    found = align(blank, template(), ARMS, START, PRIOR)
    for fit in found.planes.values():
        assert np.isfinite(fit.centre).all()
        assert np.isfinite(fit.covariance).all()
        assert fit.contrast == pytest.approx(0.0, abs=1e-6)
        assert fit.evidence == pytest.approx(0.0, abs=1e-6)


def variant(kind, clean):
    """The same scene in another description: (views, pixels), by plane."""
    pixels = {name: noisy(clean[name], [1, ord(name)]) for name in "ab"}
    if kind == "swapped":
        return {"a": VIEWS["b"], "b": VIEWS["a"]}, {"a": pixels["b"], "b": pixels["a"]}
    if kind == "mirrored":
        return (
            {"a": flipped(VIEWS["a"]), "b": VIEWS["b"]},
            {"a": np.ascontiguousarray(pixels["a"][:, ::-1]), "b": pixels["b"]},
        )
    if kind == "scaled":
        factors = {"a": -2.5, "b": 1e-3}
        return {n: Projection(factors[n] * v.matrix, v.width, v.height) for n, v in VIEWS.items()}, pixels
    return dict(VIEWS), pixels


@pytest.mark.parametrize("kind", ["swapped", "mirrored", "scaled"])
def test_the_description_of_the_planes_means_nothing(kind):
    turn = np.radians([1.0, -1.0, 0.5])
    results = []
    for description in ("plain", kind):
        views, first = variant(description, clean_images())
        _, second = variant(description, clean_images(MOVED, turn))
        pattern = learned({n: working(first[n], views[n]) for n in "ab"})
        results.append(align({n: working(second[n], views[n]) for n in "ab"}, pattern, ARMS, START, PRIOR))
    here, there = results
    for name in "ab":
        other = {"a": "b", "b": "a"}[name] if kind == "swapped" else name
        fit = there.planes[other]
        np.testing.assert_allclose(fit.centre, here.planes[name].centre, atol=5e-6)
        assert fit.correlation == pytest.approx(here.planes[name].correlation, abs=0.01)
    np.testing.assert_allclose(there.turn, here.turn, atol=np.radians(0.1))
    assert there.stretch == pytest.approx(here.stretch, abs=5e-4)
    np.testing.assert_allclose(there.turn_covariance, here.turn_covariance, rtol=0.15, atol=1e-6)


def test_the_starts_are_not_changed():
    starts = {name: LOOP.centre.copy() for name in "ab"}
    align(images(clean_images((0.3e-3, 0, 0))), template(), ARMS, starts, PRIOR)
    for start in starts.values():
        np.testing.assert_array_equal(start, LOOP.centre)


@pytest.mark.parametrize(("axis", "turn_deg"), [(1, 9.0), (2, 7.0), (2, 9.0)])
def test_from_afar_a_ring_is_found_that_lies_otherwise_and_elsewhere(axis, turn_deg):
    turn = np.zeros(3)
    turn[axis] = np.radians(turn_deg)
    off = dict.fromkeys(START, LOOP.centre + np.array([0.0, 0.0, 0.8e-3]))
    looked = images(clean_images(turn=turn))
    near = align(looked, template(), ARMS, off, PRIOR)
    assert min(near.likeness.values()) < 0.5  # it loses its way
    found = align_from_afar(looked, template(), ARMS, off, PRIOR, np.zeros(3), 0.0)
    assert min(found.likeness.values()) > 0.85
    for fit in found.planes.values():
        assert np.abs(across_mm(fit, LOOP.centre)).max() < 0.1
    np.testing.assert_allclose(np.degrees(found.turn), np.degrees(turn), atol=0.7)


def test_from_afar_nothing_is_found_where_nothing_is():
    for seed in range(4):
        nothing = images({n: np.full((512, 512), 150, np.uint8) for n in "ab"}, seed)
        assert align_from_afar(nothing, template(), ARMS, START, PRIOR, np.zeros(3), 0.0) is None
