import dataclasses

import numpy as np
import pytest
from support.lasso_inputs import CURVE, LOOP, VIEWS, bare, lasso_image, noisy
from support.method_inputs import flipped

from lasso_motion_ros.geometry.frames import Frame
from lasso_motion_ros.ring.search import TUNING, Peaks, SearchCandidate, find_electrodes, find_peaks, join_peaks
from lasso_motion_ros.ring.strip import strip_along
from lasso_motion_ros.ring.template import RingTemplate, TemplateTuning
from lasso_motion_ros.ring.working_image import CELL_PX, working_image

ARMS = CURVE - LOOP.centre
WIDE = 0.01**2 * np.eye(3)


def image_of(curve, name, seed=0, view=None):
    view = view or VIEWS[name]
    frame = Frame(0, noisy(lasso_image(curve, view), [seed, ord(name)]), view)
    return working_image(frame, LOOP.centre, bright=False, shift=np.zeros(2))


def template(images):
    """What the ring looks like in some images (by plane) that show it at the reference."""
    strips = {name: strip_along(CURVE, image.projection).sample(image) for name, image in images.items()}
    shown = {name: np.ones(len(strip), np.float32) for name, strip in strips.items()}
    return RingTemplate(strips, shown, TemplateTuning()).values


TEMPLATE = template({name: image_of(CURVE, name) for name in "ab"})


def searched(translation, *, expected=LOOP.centre, seed=5):
    images = {name: image_of(CURVE + translation, name, seed) for name in "ab"}
    return {name: find_peaks(images[name], TEMPLATE, expected, ARMS) for name in "ab"}


@pytest.mark.parametrize(
    "translation_mm",
    [
        [0.0, 0.0, 0.0],
        [1.3, -2.2, 4.7],
        [-25.0, 10.0, -40.0],
        [20.0, 25.0, 30.0],
        [0.0, 0.0, 55.0],  # the upper border cuts off a third
        [30.0, 0.0, -72.0],  # the lower one nearly half
    ],
)
@pytest.mark.parametrize("expected_mm", [[0.0, 0.0, 0.0], [12.0, -8.0, 20.0]])
def test_the_loop_is_found_wherever_it_is(translation_mm, expected_mm):
    translation = np.array(translation_mm) * 1e-3
    expected = LOOP.centre + np.array(expected_mm) * 1e-3
    peaks = searched(translation, expected=expected)
    for name, found in peaks.items():
        truth = found.image.projection.project(LOOP.centre + translation)
        # The pattern is that of another depth by up to 6 %, and cells are two pixels wide.
        assert np.linalg.norm(found.pixels[0] - truth) < 4.0, name
        assert found.scores[0] > 1.3 * found.scores[1]
    best = join_peaks(peaks, {"a": expected, "b": expected}, WIDE, 0.0, 4)[0]
    for name, centre in best.centres.items():
        assert np.linalg.norm(centre - (LOOP.centre + translation)) < 1e-3, name


@pytest.mark.parametrize("name", ["a", "b"])
def test_peaks_are_found_to_a_fraction_of_a_cell(name):
    errors = []
    for seed, translation in enumerate(np.random.default_rng(4).uniform(-2e-3, 2e-3, (8, 3))):
        found = find_peaks(image_of(CURVE + translation, name, seed), TEMPLATE, LOOP.centre, ARMS)
        errors.append(found.pixels[0] - found.image.projection.project(LOOP.centre + translation))
    # A peak taken to the whole cell would be off by 0.58 pixels (root mean square), with a bias of half a pixel.
    # The electrodes that the planes share are fewer samples than all that one of them shows.
    assert np.sqrt(np.mean(np.square(errors))) < 0.45
    assert np.abs(np.mean(errors, axis=0)).max() < 0.25


def test_scores_are_in_units_of_the_maps_spread_and_sorted():
    found = searched(np.zeros(3))["a"]
    assert len(found.scores) == len(found.pixels) == TUNING.peaks
    assert (np.diff(found.scores) <= 0.0).all()
    assert 10.0 < found.scores[0] < 60.0
    assert found.scores[5] < 6.0


def test_peaks_are_apart_from_each_other():
    # By more than three cells of two pixels in one direction at least, less half a cell at either end.
    for seed in range(4):
        noise = np.random.default_rng(seed).normal(size=(256, 256)).astype(np.float32)
        image = bare(noise, VIEWS["a"].cropped(128, 128, 256, 256))
        found = find_peaks(image, TEMPLATE, LOOP.centre, ARMS)
        apart = np.abs(found.pixels[:, None] - found.pixels[None]).max(axis=-1) + 100.0 * np.eye(TUNING.peaks)
        assert apart.min() > 6.0


def test_both_of_two_loops_are_among_the_peaks():
    other = np.array([0.030, 0.020, -0.025])
    view = VIEWS["a"]
    pixels = np.minimum(lasso_image(CURVE, view), lasso_image(CURVE + other, view))
    image = working_image(Frame(0, noisy(pixels, 1), view), LOOP.centre, bright=False, shift=np.zeros(2))
    found = find_peaks(image, TEMPLATE, LOOP.centre, ARMS)
    for truth in (LOOP.centre, LOOP.centre + other):
        assert np.linalg.norm(found.pixels[:2] - image.projection.project(truth), axis=1).min() < 3.0


def test_an_empty_image_speaks_for_no_place():
    blank = bare(np.zeros((512, 512), np.float32), VIEWS["a"])
    found = find_peaks(blank, TEMPLATE, LOOP.centre, ARMS)
    assert (found.scores == 0.0).all()
    assert np.isfinite(found.pixels).all()


def test_mirrored_displays_give_the_same_places():
    translation = np.array([0.004, -0.003, 0.006])
    view, mirrored = VIEWS["a"], flipped(VIEWS["a"])
    pixels = noisy(lasso_image(CURVE + translation, view), 2)
    first = noisy(lasso_image(CURVE, view), 3)
    places = []
    for projection, flip in ((view, 1), (mirrored, -1)):
        learned, image = (
            working_image(
                Frame(0, np.ascontiguousarray(p[:, ::flip]), projection),
                LOOP.centre,
                bright=False,
                shift=np.zeros(2),
            )
            for p in (first, pixels)
        )
        found = find_peaks(image, template({"a": learned, "b": learned}), LOOP.centre, ARMS)
        places.append(join_peaks({"a": found}, {"a": LOOP.centre}, WIDE, 0.0, 1)[0].centres["a"])
    np.testing.assert_allclose(places[0], places[1], atol=1e-4)


# From here on, peaks by hand.
BLANK = {name: bare(np.zeros((8, 8), np.float32), VIEWS[name]) for name in "ab"}
FIRST, SECOND = np.array([0.005, 0.010, 0.020]), np.array([-0.010, 0.004, -0.015])


def peaks_at(points, scores, off_mm=0.0):
    """Peaks of both planes at world points, plane B's being too high by some millimetres."""
    points = np.array(points)
    lift = np.array([0.0, 0.0, 1e-3 * off_mm])
    places = {"a": points, "b": points + lift}
    return {
        name: Peaks(np.array(scores[name], dtype=float), VIEWS[name].project(places[name]), BLANK[name])
        for name in "ab"
    }


def joined(peaks, *, expected=(0.0, 0.0, 0.0), later=None, covariance=WIDE, slack_m=0.0, count=10):
    """Candidates where the loop is expected at one place, or in plane B `later`, elsewhere."""
    places = {"a": np.array(expected), "b": np.array(expected if later is None else later)}
    return join_peaks(peaks, places, covariance, slack_m, count)


def test_peaks_are_joined_along_their_rays():
    peaks = peaks_at([FIRST, SECOND], {"a": [9.0, 8.0], "b": [7.0, 6.0]})
    found = joined(peaks)
    # A's first with B's second misses by far: only the true pairs remain, the stronger first.
    assert len(found) == 2
    for candidate, truth in zip(found, (FIRST, SECOND), strict=True):
        np.testing.assert_allclose(candidate.centres["a"], truth, atol=1e-9)
        np.testing.assert_allclose(candidate.centres["b"], truth, atol=1e-9)
    assert found[0].score > found[1].score


def test_the_number_of_candidates_is_limited():
    peaks = peaks_at([FIRST, SECOND], {"a": [9.0, 8.0], "b": [7.0, 6.0]})
    assert len(joined(peaks, count=1)) == 1
    np.testing.assert_allclose(joined(peaks, count=1)[0].centres["a"], FIRST, atol=1e-9)


def test_rays_may_miss_each_other_by_the_tolerance_and_the_slack():
    peaks = peaks_at([FIRST], {"a": [9.0], "b": [9.0]}, off_mm=4.0)
    found = joined(peaks, slack_m=0.0025)
    assert len(found) == 1
    # Beyond it planes that disagree come last: 6 off the score, and one more for every 5 mm.
    assert joined(peaks)[0].score == pytest.approx(found[0].score - 6.0 - 2.0 / 5.0, abs=0.02)
    assert joined(peaks, slack_m=0.0015)[0].score == pytest.approx(found[0].score - 6.0 - 0.5 / 5.0, abs=0.02)
    assert joined(peaks_at([FIRST], {"a": [9.0], "b": [9.0]}, off_mm=40.0)) == []
    # Each plane keeps the place on its own ray, 4 mm from the other's.
    assert np.linalg.norm(found[0].centres["a"] - found[0].centres["b"]) == pytest.approx(0.004, rel=0.02)
    for name in "ab":
        np.testing.assert_allclose(VIEWS[name].project(found[0].centres[name]), peaks[name].pixels[0], atol=1e-6)


def test_motion_between_the_exposures_is_allowed_for():
    # Plane B sees the loop 9 mm on, as expected: the rays are brought together by that motion.
    motion = np.array([0.001, -0.002, -0.009])
    peaks = {
        "a": Peaks(np.array([9.0]), VIEWS["a"].project(FIRST[None]), BLANK["a"]),
        "b": Peaks(np.array([9.0]), VIEWS["b"].project((FIRST + motion)[None]), BLANK["b"]),
    }
    assert joined(peaks, expected=FIRST)[0].score < 12.0
    found = joined(peaks, expected=FIRST + 0.002, later=FIRST + 0.002 + motion)
    np.testing.assert_allclose(found[0].centres["a"], FIRST, atol=1e-9)
    np.testing.assert_allclose(found[0].centres["b"], FIRST + motion, atol=1e-9)


def test_the_expectation_decides_among_equals_and_is_never_a_gate():
    covariance = 0.002**2 * np.eye(3)
    equal = peaks_at([FIRST, SECOND], {"a": [8.0, 8.0], "b": [8.0, 8.0]})
    for near in (FIRST, SECOND):
        np.testing.assert_allclose(joined(equal, expected=near, covariance=covariance)[0].centres["a"], near, atol=1e-9)
    # At most two: what is better by more wins from wherever it is.
    better = peaks_at([FIRST, SECOND], {"a": [9.1, 8.0], "b": [9.1, 8.0]})
    np.testing.assert_allclose(joined(better, expected=SECOND, covariance=covariance)[0].centres["a"], FIRST, atol=1e-9)
    # By hand: two standard deviations away in one direction, 0.1 · 2² off the sum.
    aside = joined(equal, expected=FIRST + np.array([0.004, 0.0, 0.0]), covariance=covariance)[0]
    assert aside.score == pytest.approx(16.0 - 0.4, abs=1e-6)


def test_no_plane_can_drown_the_other():
    # 100 + 2 is a bright thing in one plane only; 20 + 20 is seen in both.
    peaks = peaks_at([FIRST, SECOND], {"a": [100.0, 20.0], "b": [2.0, 20.0]})
    np.testing.assert_allclose(joined(peaks)[0].centres["a"], SECOND, atol=1e-9)


@pytest.mark.parametrize("name", ["a", "b"])
def test_one_plane_alone_gives_places_at_the_expected_depth(name):
    both = peaks_at([FIRST, SECOND], {"a": [9.0, 8.0], "b": [9.0, 8.0]})
    expected = np.array([0.002, -0.030, 0.001])
    found = joined({name: both[name]}, expected=expected)
    assert [set(c.centres) for c in found] == [{name}, {name}]
    view = VIEWS[name]
    for candidate, truth in zip(found, (FIRST, SECOND), strict=True):
        centre = candidate.centres[name]
        np.testing.assert_allclose(view.project(centre), view.project(truth), atol=1e-6)
        assert view.depth(centre) == pytest.approx(float(view.depth(expected)), abs=1e-9)
    assert len(joined({name: both[name]}, count=1)) == 1


def test_planes_can_be_swapped():
    peaks = peaks_at([FIRST, SECOND], {"a": [9.0, 8.0], "b": [7.0, 6.0]}, off_mm=1.0)
    swapped = {"a": peaks["b"], "b": peaks["a"]}
    for here, there in zip(joined(peaks), joined(swapped), strict=True):
        assert here.score == pytest.approx(there.score)
        np.testing.assert_allclose(here.centres["a"], there.centres["b"], atol=1e-9)
        np.testing.assert_allclose(here.centres["b"], there.centres["a"], atol=1e-9)


def test_parallel_rays_do_not_upset_the_rest():
    # The same view twice: the depth is unknown, but what is returned is finite or nothing.
    same = Peaks(np.array([9.0]), VIEWS["a"].project(FIRST[None]), BLANK["a"])
    for candidate in joined({"a": same, "b": dataclasses.replace(same)}):
        assert np.isfinite(candidate.centres["a"]).all()


def test_nothing_found_gives_no_candidates():
    empty = {name: Peaks(np.zeros(0), np.zeros((0, 2)), BLANK[name]) for name in "ab"}
    assert joined(empty) == []
    assert joined({"a": empty["a"]}) == []
    assert joined({}) == []


def test_candidates_are_alike_where_both_planes_are():
    here = SearchCandidate(9.0, {"a": np.zeros(3), "b": np.zeros(3)})
    assert here.is_like(SearchCandidate(5.0, {"a": np.full(3, 1e-4), "b": np.full(3, -1e-4)}))
    assert not here.is_like(SearchCandidate(9.0, {"a": np.zeros(3), "b": np.array([0.0, 0.0, 4e-4])}))
    one = SearchCandidate(9.0, {"b": np.zeros(3)})  # plane A does not reach the ring there
    assert not here.is_like(one)
    assert not one.is_like(here)


def test_a_reach_holds_the_peaks_near_what_is_expected():
    translation, reach_mm = np.array([4.0e-3, -3.0e-3, 6.0e-3]), 12.0
    for name in "ab":
        image = image_of(CURVE + translation, name, 5)
        anywhere = find_peaks(image, TEMPLATE, LOOP.centre, ARMS)
        near = find_peaks(image, TEMPLATE, LOOP.centre, ARMS, reach_mm=reach_mm)
        np.testing.assert_allclose(near.pixels[0], anywhere.pixels[0], atol=1e-3)
        off = np.abs(near.pixels - image.projection.project(LOOP.centre)).max(axis=1)
        reach_px = reach_mm / image.projection.millimetres_per_pixel(LOOP.centre)
        assert off.max() < reach_px + 2 * CELL_PX
        # What is further away than that is among the others.
        off = np.abs(anywhere.pixels - image.projection.project(LOOP.centre)).max(axis=1)
        assert off.max() > reach_px + 2 * CELL_PX


def test_nothing_is_found_where_the_reach_is_outside_the_image():
    image = image_of(CURVE, "a")
    outside = LOOP.centre + np.array([0.0, 0.0, 0.5])
    assert find_peaks(image, TEMPLATE, outside, ARMS, reach_mm=10.0).scores.size == 0
    assert find_peaks(image, TEMPLATE, outside, ARMS).scores.size > 0


def spots_image(curve, name, sigma, seed=0):
    """A working image of electrodes 1.4 mm wide, ten along a curve, and no wire."""
    view = VIEWS[name]
    rows, columns = np.mgrid[: view.height, : view.width]
    grey = np.full((view.height, view.width), 170.0)
    for x, y in view.project(curve[::12]):
        grey -= 40.0 * np.exp(-0.5 * ((columns - x) ** 2 + (rows - y) ** 2) / 2.2**2)
    frame = Frame(0, noisy(grey, [seed, ord(name)], sigma), view)
    return working_image(frame, LOOP.centre, bright=False, shift=np.zeros(2))


ELECTRODES = np.where(np.arange(len(CURVE)) % 12 == 0, 0.1, 0.0).astype(np.float32)


@pytest.mark.parametrize("sigma", [5.0, 80.0], ids=["clear", "noise of twice their depth"])
@pytest.mark.parametrize("translation_mm", [[0.0, 0.0, 0.0], [3.0, -4.0, 5.0], [-9.0, 2.0, -11.0], [0.0, 0.0, 55.0]])
def test_electrodes_are_found_about_where_they_are_expected(translation_mm, sigma):
    translation = 1e-3 * np.array(translation_mm)
    expected = LOOP.centre + translation - np.array([1e-3, 0.0, 2e-3])
    for name in "ab":
        image = spots_image(CURVE + translation, name, sigma)
        found = find_electrodes(image, ELECTRODES, expected, ARMS, 14.0)
        assert np.linalg.norm(found.pixels[0] - image.projection.project(LOOP.centre + translation)) < 2.0, name
        assert (np.diff(found.scores) <= 0.0).all()


def test_electrodes_are_looked_for_no_further_than_asked_and_not_beside_the_image():
    image = spots_image(CURVE + np.array([0.0, 0.0, 0.02]), "a", 5.0)
    expected = image.projection.project(LOOP.centre)
    found = find_electrodes(image, ELECTRODES, LOOP.centre, ARMS, 6.0)
    assert np.abs(found.pixels - expected).max() < (6.0 + 1.0) / image.projection.millimetres_per_pixel(LOOP.centre)
    outside = find_electrodes(image, ELECTRODES, LOOP.centre + np.array([0.0, 0.0, 0.5]), ARMS, 6.0)
    assert len(outside.scores) == len(outside.pixels) == 0
