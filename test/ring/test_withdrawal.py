"""A ring of which a part is gone, in both planes the same."""

import dataclasses

import numpy as np
import pytest

from lasso_motion_ros.core.errors import ConfigurationError
from lasso_motion_ros.ring.ring_options import RingOptions
from lasso_motion_ros.ring.withdrawal import SEGMENTS, Withdrawal, WithdrawalTuning

TUNING = WithdrawalTuning()
POINTS = 120
USUAL = {"a": np.full(POINTS, 1.0, dtype=np.float32), "b": np.full(POINTS, 0.8, dtype=np.float32)}
WHOLE = Withdrawal.first(TUNING)


def seen(gone_a=(), gone_b=(), *, gain=1.0, noise=0.0, seed=0):
    """The evidence of both planes with points of the curve gone: ranges (first, last) of POINTS, the curve closed."""
    random = np.random.default_rng(seed)
    shown = {}
    for plane, gone in (("a", gone_a), ("b", gone_b)):
        values = gain * USUAL[plane] + noise * random.standard_normal(POINTS)
        if gone:
            at = np.arange(*gone) % POINTS
            values[at] = 0.02 + noise * random.standard_normal(len(at))
        shown[plane] = values.astype(np.float32)
    return shown


def after(*pairs):
    withdrawal = WHOLE
    for shown in pairs:
        withdrawal = withdrawal.after(shown, USUAL)
    return withdrawal


def test_one_pair_is_weighed_arc_by_arc():
    # By hand, of the arc that is just what is missing: 7 of 24 segments show 0 where 1 and 0.8 are usual, both with a
    # variance of 0.2; and of that on the other side, where both show as much as is usual.
    shown = {plane: values.copy() for plane, values in USUAL.items()}
    for values in shown.values():
        values[:35] = 1e-6
    tuning = dataclasses.replace(TUNING, gone=50.0, there=50.0)
    told = Withdrawal.first(tuning).after(shown, USUAL).told
    missing, opposite = 2 * SEGMENTS, 2 * SEGMENTS + 12  # arcs of seven segments, from the first and the 13th on
    for plane, usual in enumerate((1.0, 0.8)):
        odds = 7.0 * usual**2 / (2.0 * TUNING.variance)
        assert told[plane][missing] == pytest.approx(-0.8 * 50.0 + odds, abs=1e-3)
        gain = 10.0 / 17.0  # of the rest of the ring, of which 7 segments show nothing
        odds = 7.0 * usual**2 * (gain**2 - 2.0 * gain) / (2.0 * TUNING.variance)
        assert told[plane][opposite] == pytest.approx(max(-0.8 * 50.0 + odds, -50.0), abs=1e-3)


def test_what_a_plane_tells_is_bounded_and_both_have_to():
    missing = {plane: values.copy() for plane, values in USUAL.items()}
    for values in missing.values():
        values[:] = 1e-6
        values[60:] = 0.9
    told = after(*[missing] * 5)
    both = 7 * SEGMENTS  # twelve segments from the first on
    assert told.told[0, both] == told.told[1, both] == TUNING.gone
    odds = TUNING.prior * np.exp(told.told.sum(axis=0)).mean()
    assert told.probability == pytest.approx(odds / (1.0 + odds))
    assert told.share == pytest.approx(0.5, abs=0.06)


@pytest.mark.parametrize("first", [0, 37, 110])
@pytest.mark.parametrize("share", [0.25, 0.35, 0.5])
def test_an_arc_that_is_gone_in_both_planes_is_noticed_wherever_the_curve_begins(first, share):
    gone = (first, first + round(share * POINTS))
    told = after(seen(noise=0.3, seed=1), seen(gone, gone, noise=0.3, seed=2), seen(gone, gone, noise=0.3, seed=3))
    assert told.probability > 0.5
    assert told.share == pytest.approx(share, abs=0.08)
    assert told.text == f"both planes show nothing on {100 * told.share:.0f} % of the lasso: drawn into its sheath?"


def test_an_arc_that_grows_is_noticed():
    pairs = [seen((0, last), (0, last), noise=0.35, seed=last) for last in (12, 25, 40, 55)]
    assert after(*pairs[:1]).probability < 0.1
    assert after(*pairs).probability > 0.5


def test_what_lies_over_the_ring_in_one_plane_is_no_withdrawal():
    assert after(*[seen((20, 60), (), noise=0.3, seed=n) for n in range(20)]).probability < 0.1
    assert after(*[seen((20, 60), (75, 115), noise=0.3, seed=n) for n in range(20)]).probability < 0.1


def test_what_a_tip_showed_of_the_ring_and_no_longer_does_is_no_withdrawal():
    usual = {plane: values.copy() for plane, values in USUAL.items()}
    usual["a"][20:60] = 2.0  # in one plane on the ring while its looks were learned
    withdrawal = WHOLE
    for number in range(10):
        shown = seen((35, 45), (), noise=0.3, seed=number)
        withdrawal = withdrawal.after(shown, usual)
    assert withdrawal.probability < 0.1


def test_a_ring_that_fades_as_a_whole_is_all_there():
    assert after(*[seen(gain=0.5, noise=0.3, seed=n) for n in range(20)]).probability < 0.1


def test_a_noisy_ring_is_all_there_once_its_noise_is_known():
    told = after(*[seen(noise=0.9, seed=n) for n in range(30)])
    assert told.probability < 0.1
    # Of the mean of five points, and of a gain that is kept from the noise's own.
    assert told.variances[0] == pytest.approx(0.9**2 / 5.0, rel=0.4)


def test_a_ring_comes_out_again():
    gone = [seen((0, 40), (0, 40), noise=0.2, seed=n) for n in range(10)]
    assert after(*gone).probability > 0.9
    assert after(*gone, *[seen(noise=0.2, seed=n) for n in range(2)]).probability < 0.1


def test_what_lies_outside_the_image_tells_nothing():
    cut = seen(noise=0.2)
    for values in cut.values():
        values[: POINTS // 3 + 2] = 0.0  # as outside the image, a segment in part
        values[POINTS // 3 + 2 : POINTS // 3 + 5] = 1e-3
    assert after(*[cut] * 10).probability < 0.05


def test_the_noise_is_not_learned_from_what_is_missing():
    gone = [seen((0, 50), (0, 50), noise=0.2, seed=n) for n in range(10)]
    np.testing.assert_array_equal(after(*gone).variances, WHOLE.variances)


def test_a_curve_of_fewer_points_than_segments_is_refused():
    assert RingOptions(points=SEGMENTS).points == SEGMENTS
    with pytest.raises(ConfigurationError, match="points must be 24 or more, found 23"):
        RingOptions(points=SEGMENTS - 1)
