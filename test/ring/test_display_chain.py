"""The display's filter over time: recognised by the noise, undone, and left alone where its state is not known."""

import numpy as np
import pytest
from support.lasso_inputs import PERIOD_NS, VIEWS

from lasso_motion_ros.geometry.frames import Frame, FramePair
from lasso_motion_ros.phantom.imaging import Exposure, ImagingChain
from lasso_motion_ros.phantom.settings import ImagingSettings
from lasso_motion_ros.ring import display_chain
from lasso_motion_ros.ring.display_chain import DisplayChain, PlaneChain, unfiltered
from lasso_motion_ros.ring.temporal_filter import DisplayChainTuning, filter_from, grey_change, sampled

TUNING = DisplayChainTuning()
SIDE = 256
VIEW = VIEWS["a"]


def noise_images(count, share, *, sigma=12.0, seed=0, dtype=np.uint8, level=120.0, side=SIDE):
    """x and y: images of a slope in noise, and what a filter shows of them from the first one on."""
    random = np.random.default_rng(seed)
    slope = level + np.linspace(-40.0, 40.0, side)
    images = [slope + sigma * random.standard_normal((side, side)) for _ in range(count)]
    shown = [images[0]]
    for image in images[1:]:
        shown.append((1.0 - share) * image + share * shown[-1])
    return [[np.clip(np.rint(one), 0, np.iinfo(dtype).max).astype(dtype) for one in some] for some in (images, shown)]


def frame(pixels, number, view=VIEW):
    return Frame(round(number * PERIOD_NS), pixels, view)


def fed(chain, images, numbers=None):
    """What the chain makes of images, one a period."""
    numbers = range(len(images)) if numbers is None else numbers
    return [chain.undone(frame(image, number)).pixels for image, number in zip(images, numbers, strict=True)]


def filtering(share=0.5, count=6, **of_noise):
    """A chain that knows its filter, the images before it and the next ones."""
    images, shown = noise_images(count + 6, share, **of_noise)
    chain = PlaneChain(TUNING)
    fed(chain, shown[:count])
    assert chain.is_filtered
    return chain, images[count:], shown[count:]


def test_the_filter_follows_from_the_correlation_of_differences():
    # In a filter that has run for long, E1 = E0 = 1 and C = −(1−λ)/2.
    np.testing.assert_allclose(filter_from([-0.5, -0.375, -0.25], 1.0, 1.0), [0.0, 0.25, 0.5])
    # By hand for λ = ½ and σ² = 1 from y_0 = x_0 on: d0 = ½x1 − ½x0, d1 = ½x2 − ¼x1 − ¼x0: E0 = ½, E1 = ⅜, C = 0;
    assert filter_from(0.0, 0.375, 0.5) == pytest.approx(0.5)
    # and the next three: d1 = ½x3 − ¼x2 − ⅛x1 − ⅛x0: E1 = 11/32, C = −1/16, where 1 + 2 C/E0 is ⅔.
    assert filter_from(-1.0 / 16.0, 11.0 / 32.0, 0.375) == pytest.approx(0.5)


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16])
@pytest.mark.parametrize("share", [0.12, 0.25, 0.37, 0.5, 0.63])
def test_what_a_filter_did_is_undone_up_to_the_rounding(share, dtype):
    scale = 1 if dtype is np.uint8 else 16
    images, shown = noise_images(8, share, sigma=8.0 * scale, level=120.0 * scale, dtype=dtype)
    for before, now, true in zip(shown, shown[1:], images[1:], strict=False):
        found = unfiltered(now, before, share)
        assert found.dtype == dtype
        # Both shown images are rounded by up to ½, the true one and the answer as well.
        most = 0.5 * (1.0 + share) / (1.0 - share) + 1.0
        assert np.abs(found.astype(float) - true).max() <= most


def test_what_is_undone_stays_in_the_type_s_range():
    low, high = np.full((8, 8), 10, np.uint8), np.full((8, 8), 250, np.uint8)
    assert (unfiltered(low, high, 0.5) == 0).all()
    assert (unfiltered(high, low, 0.5) == 255).all()


def body(number, *, speed_px=7.0):
    """(512, 512) optical depth: ribs, a wire and electrodes that move up and down by several pixels an image."""
    y, x = np.mgrid[0:512, 0:512].astype(np.float32)
    shift = 3.0 * speed_px * np.sin(0.45 * number)
    depth = 3.0 + 0.3 * np.sin((y + shift) / 17.0) + 0.2 * np.cos(x / 29.0 + (y + shift) / 41.0)
    ring = np.abs(np.hypot(x - 250.0, (y - 260.0 - shift) * 1.6) - 90.0)
    return depth + 0.4 * np.exp(-((ring / 2.0) ** 2))


def exposures(count, *, exposure=lambda number: None, **settings):
    chain = ImagingChain(ImagingSettings(**settings), 1.0)
    random = np.random.default_rng(4)
    return [chain.expose(body(number), 1.0, random, exposure(number)) for number in range(count)]


@pytest.mark.parametrize("bits", [8, 12])
@pytest.mark.parametrize("quanta", [15.0, 60.0])
@pytest.mark.parametrize("lag", [0.0, 0.25, 0.5])
def test_the_phantom_s_lag_is_recognised_in_moving_anatomy(lag, quanta, bits):
    chain = PlaneChain(TUNING)
    for number, image in enumerate(exposures(8, lag=lag, quanta=quanta, bits=bits)):
        chain.undone(frame(image, number))
        if number >= 2:
            assert chain.filter == pytest.approx(lag, abs=0.08)
            assert chain.is_filtered == (lag > 0.0)
    assert chain.filter == pytest.approx(lag, abs=0.04)
    assert chain.sigma < 0.03


def test_without_a_filter_the_very_images_come_back():
    _, shown = noise_images(8, 0.0)
    chain = PlaneChain(TUNING)
    for found, image in zip(fed(chain, shown), shown, strict=True):
        assert found is image
    assert not chain.is_filtered
    assert chain.error == chain.ghost == 0.0
    assert chain.filter == pytest.approx(0.0, abs=0.05)


def test_the_first_three_images_tell_and_the_third_is_undone():
    images, shown = noise_images(3, 0.5)
    chain = PlaneChain(TUNING)
    found = fed(chain, shown)
    assert found[0] is shown[0]
    assert found[1] is shown[1]
    assert np.std(found[2].astype(float) - images[2]) < 0.3 * np.std(shown[2].astype(float) - images[2])


def test_what_is_left_of_the_lag_is_lambda_s_error():
    chain, images, shown = filtering(0.5)
    (found,) = fed(chain, shown[:1], [6])
    assert chain.error == pytest.approx(chain.sigma / (1.0 - chain.filter), rel=1e-6)
    assert 0.01 < chain.error < 0.1
    assert chain.ghost == 0.0
    assert np.std(found.astype(float) - images[0]) < 3.0


@pytest.mark.parametrize(
    ("share", "sigma", "is_filtered"),
    [(0.09, 0.01, False), (0.11, 0.01, True), (0.3, 0.08, False), (0.33, 0.08, True), (0.85, 0.01, False)],
)
def test_a_filter_is_undone_if_it_is_large_and_significant(share, sigma, is_filtered):
    chain = PlaneChain(TUNING)
    chain.filter, chain.sigma = share, sigma
    assert chain.is_filtered == is_filtered


def test_the_rounding_to_grey_values_is_allowed_for():
    # Noise of one grey value; with a filter that keeps a half, 0.58.
    for share in (0.0, 0.5):
        chain = PlaneChain(TUNING)
        fed(chain, noise_images(10, share, sigma=1.0)[1])
        assert chain.filter == pytest.approx(share, abs=0.05)


def test_noise_that_is_lost_in_the_rounding_tells_nothing():
    chain = PlaneChain(TUNING)
    fed(chain, noise_images(10, 0.5, sigma=0.4)[1])
    assert chain.filter == 0.0
    assert not chain.is_filtered


def test_what_moves_evenly_is_no_filter():
    # Fine lines that go on by a fifth of their period in the upper half: d1 and d0 agree, as they do for a large λ.
    x = np.arange(SIDE)
    images, _ = noise_images(8, 0.0, sigma=3.0)
    chain = PlaneChain(TUNING)
    for number, image in enumerate(images):
        lines = 25.0 * np.sin(2.0 * np.pi * (x / 12.0 - 0.1 * number))
        moving = image.astype(float)
        moving[: SIDE // 2] += lines
        chain.undone(frame(np.clip(np.rint(moving), 0, 255).astype(np.uint8), number))
    assert chain.filter == pytest.approx(0.0, abs=0.05)


def test_when_stamps_go_back_all_is_learned_anew():
    chain, _, shown = filtering(0.5)
    found = fed(chain, shown[:2], [1, 2])
    assert all(one is image for one, image in zip(found, shown, strict=False))
    assert chain.filter == 0.0


def test_frozen_and_noiseless_images_tell_nothing():
    _, shown = noise_images(1, 0.0)
    chain = PlaneChain(TUNING)
    assert all(found is image for image, found in zip(shown * 6, fed(chain, shown * 6), strict=True))
    assert chain.filter == 0.0
    flat = [np.full((SIDE, SIDE), 90 + number, np.uint8) for number in range(6)]
    chain = PlaneChain(TUNING)
    fed(chain, flat)
    assert chain.filter == 0.0
    assert not chain.is_filtered


def test_an_image_that_comes_twice_is_no_step_of_the_filter():
    chain, images, shown = filtering(0.5)
    once, again, following = fed(chain, [shown[0], shown[0].copy(), shown[1]], [6, 6.5, 7])
    np.testing.assert_array_equal(once, again)
    assert np.std(following.astype(float) - images[1]) < 3.0


def test_only_whole_images_count_as_the_same():
    # What moves may lie between the sampled blocks.
    chain, _, shown = filtering(0.5, side=512)
    other = shown[0].copy()
    other[: TUNING.block_px, : TUNING.block_px] = 20
    assert np.array_equal(sampled(shown[0], TUNING).values, sampled(other, TUNING).values)
    once, again = fed(chain, [shown[0], other], [6, 7])
    assert not np.array_equal(once, again)


def ghost(found, image, before):
    """How much of the image before is in what was found: the regression on what it does not share with the image."""
    trace = before.astype(float) - image
    return float(((found.astype(float) - image) * trace).sum() / (trace**2).sum())


def test_of_what_did_not_come_so_much_is_undone_as_the_last_image_tells():
    chain, images, shown = filtering(0.5)
    (found,) = fed(chain, shown[1:2], [7])  # number 6 is missing
    # Of y7 = ½x7 + ¼x6 + ¼y5 a third of x6 is left and nothing of y5.
    np.testing.assert_allclose(found, (2.0 * images[1] + 1.0 * images[0]) / 3.0, atol=6.0)
    assert chain.ghost == pytest.approx(1.0 / 2.0, abs=0.05)
    (found,) = fed(chain, shown[2:3], [8])
    assert np.std(found.astype(float) - images[2]) < 3.0


def test_of_a_chain_that_stood_still_in_a_gap_less_than_before_is_left_and_nothing_inverted():
    chain, images, shown = filtering(0.5)
    fed(chain, shown[:1], [6])
    (found,) = fed(chain, shown[1:2], [8])
    assert 0.0 < ghost(found, images[1], shown[0]) < ghost(shown[1], images[1], shown[0])


@pytest.mark.parametrize("number", [6.5, 7.4, 12.0, 4.0])
def test_nothing_is_undone_at_an_unusual_interval(number):
    chain, _, shown = filtering(0.5)
    (found,) = fed(chain, shown[1:2], [number])
    assert found is shown[1]


def test_another_rate_is_learned_anew():
    chain, images, shown = filtering(0.5)
    found = fed(chain, shown[:6], 5 + 0.5 * np.arange(1, 7))
    # The second interval shows it, and the next image the filter.
    assert all(one is image for one, image in zip(found[:2], shown, strict=False))
    assert all(one is not image for one, image in zip(found[2:], shown[2:6], strict=True))
    assert np.std(found[5].astype(float) - images[5]) < 3.0


@pytest.mark.parametrize(
    "change",
    [
        lambda pixels: (pixels[:-16, :-16].copy(), VIEW),
        lambda pixels: (pixels.astype(np.uint16), VIEW),
        lambda pixels: ((0.7 * pixels).astype(np.uint8), VIEW),
        lambda pixels: (pixels, VIEW.shifted(8.0, 0.0)),
        lambda pixels: (pixels, VIEWS["b"]),
    ],
    ids=["size", "type", "window", "read-out", "gantry"],
)
def test_after_a_change_all_is_learned_anew(change):
    chain, _, shown = filtering(0.5)
    pixels, view = change(shown[0])
    assert chain.undone(frame(pixels, 6, view)).pixels is pixels
    assert chain.filter == 0.0
    pixels, view = change(shown[1])
    assert chain.undone(frame(pixels, 7, view)).pixels is pixels


@pytest.mark.parametrize("factor", [0.3, 6.0, 30.0])
def test_another_dose_at_the_same_grey_is_another_filter(factor):
    images = exposures(10, lag=0.0, quanta=30.0, exposure=lambda number: Exposure(factor if number > 5 else 1.0))
    # Fluoroscopy is filtered, what follows is not.
    shown = [images[0].astype(float)]
    for image in images[1:6]:
        shown.append(0.5 * image + 0.5 * shown[-1])
    chain = PlaneChain(TUNING)
    fed(chain, [np.rint(one).astype(np.uint16) for one in shown])
    assert chain.is_filtered
    for found, image in zip(fed(chain, images[6:], range(6, 10)), images[6:], strict=True):
        assert found is image
    assert not chain.is_filtered


def test_a_filter_that_is_switched_on_later_is_recognised():
    images, _ = noise_images(16, 0.0)
    shown = [one.astype(float) for one in images[:8]]
    for image in images[8:]:
        shown.append(0.5 * image + 0.5 * shown[-1])
    chain = PlaneChain(TUNING)
    found = fed(chain, [np.rint(one).astype(np.uint8) for one in shown])
    assert chain.is_filtered
    assert np.std(found[-1].astype(float) - images[-1]) < 3.0


def test_once_settled_without_a_filter_every_fourth_image_is_looked_at(monkeypatch):
    looked_at = []
    whole = display_chain.group_sums
    monkeypatch.setattr(display_chain, "group_sums", lambda *args: looked_at.append(1) or whole(*args))
    chain, (_, shown) = PlaneChain(TUNING), noise_images(34, 0.0)
    learned = []
    for number, image in enumerate(shown):
        looked_at.clear()
        chain.undone(frame(image, number))
        learned += [number] * len(looked_at)
    first = list(range(2, 2 + TUNING.settled_triples))
    assert learned == [*first, *range(first[-1] + 4, len(shown), 4)]
    assert not chain.is_filtered
    assert chain.filter == pytest.approx(0.0, abs=0.05)


def test_a_filter_that_sets_in_after_that_is_recognised_and_looked_at_ever_after(monkeypatch):
    (_, still), (_, filtered) = noise_images(30, 0.0), noise_images(16, 0.5, seed=1)
    chain = PlaneChain(TUNING)
    fed(chain, still)
    found = []
    for number, image in enumerate(filtered, start=len(still)):
        chain.undone(frame(image, number))
        found.append(chain.is_filtered)
    assert all(found[TUNING.rest + 5 :])
    assert chain.filter == pytest.approx(0.5, abs=0.05)
    looked_at = []
    monkeypatch.setattr(display_chain, "group_sums", lambda *args: looked_at.append(1))
    fed(chain, noise_images(4, 0.5, seed=2)[1], range(46, 50))
    assert len(looked_at) >= 3


def test_the_grey_is_told_by_what_does_not_move():
    _, (one, other) = noise_images(2, 0.0)
    other = other.copy()
    other[: SIDE // 3] = 0
    assert abs(grey_change(sampled(other, TUNING), sampled(one, TUNING))) < 0.03


def test_each_plane_has_its_own_filter_and_a_missing_one_is_borne():
    shown = {"a": noise_images(6, 0.5, seed=1)[1], "b": noise_images(6, 0.0, seed=2)[1]}
    chain = DisplayChain(TUNING)
    for number in range(5):
        a, b = (frame(shown[p][number], number, VIEWS[p]) for p in "ab")
        pair = FramePair(a.stamp_ns, a, b)
        found = chain.undone(pair)
        assert found.b is b
    assert found.a is not a
    assert chain.filters.keys() == {"a"}
    alone = FramePair(5 * PERIOD_NS, None, frame(shown["b"][5], 5, VIEWS["b"]))
    assert chain.undone(alone) is alone
    assert chain.error == chain.ghost == 0.0


def test_the_lag_that_is_left_lies_along_the_ring_s_way():
    chain = DisplayChain(TUNING)
    chain.error = 0.1
    np.testing.assert_allclose(chain.covariance(np.array([0.0, 0.0, 5e-3])), np.diag([0.0, 0.0, 0.25e-6]))
    # A ghost of a half pulls by half its distance, up to a millimetre of that.
    chain.error, chain.ghost = 0.0, 0.5
    np.testing.assert_allclose(chain.covariance(np.array([0.0, 0.0, 0.4e-3])), np.diag([0.0, 0.0, 0.04e-6]))
    np.testing.assert_allclose(chain.covariance(np.array([0.0, 0.0, 5e-3])), np.diag([0.0, 0.0, 0.25e-6]))
    assert not chain.covariance(np.zeros(3)).any()
    chain.ghost = 0.0
    assert not chain.covariance(np.ones(3)).any()


def test_an_image_too_small_to_tell_anything_comes_back():
    chain, *_ = filtering(0.5)
    small = Frame(99, np.zeros((15, SIDE), np.uint8), VIEW.cropped(0, 0, SIDE, 15))
    assert chain.undone(small) is small
    assert not chain.is_filtered


@pytest.mark.parametrize(("share", "too_strong"), [(0.5, False), (0.79, False), (0.81, True)])
def test_a_filter_too_strong_to_be_undone_is_known(share, too_strong):
    chain = PlaneChain(TUNING)
    chain.filter, chain.sigma = share, 0.02
    assert chain.is_too_strong is too_strong
    assert chain.is_filtered is not too_strong
    chain.sigma = 0.3
    assert not chain.is_too_strong
