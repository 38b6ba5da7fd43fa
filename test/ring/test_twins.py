"""What else looks like the ring, a second lasso: it keeps its distance, and tells which of the two is the ring."""

import numpy as np
import pytest
from support.breathing_lasso import CONFIG, TRACKING, centre_error_mm
from support.lasso_inputs import CURVE, VIEWS, lasso_image, lasso_seed, pair_of
from support.ring_fits import detection_at, detection_of, plane_fit

from lasso_motion_ros.ring.tracker import RingTracker
from lasso_motion_ros.ring.twins import Twin, Twins, TwinTuning

TUNING = TwinTuning()
RING = np.array([0.005, -0.010, 0.020])
AWAY = np.array([0.002, 0.009, 0.018])  # 20 mm
KNOWN = Twins(TUNING, (Twin(AWAY, AWAY, RING, 4, moves=True),))


def twins_after(*offsets):
    twins = Twins(TUNING)
    for number, offset in enumerate(offsets):
        at = RING + number * 1e-3
        ring = detection_at(at)
        twins = twins.after(ring, [detection_at(at + offset), ring])
    return twins.known


def test_its_offset_is_the_mean_of_where_both_were_seen():
    beside = np.array([0.001, 0.0, 0.0])
    known = twins_after(AWAY, AWAY + beside, AWAY - beside)
    assert len(known) == 1
    assert known[0].sightings == 3
    np.testing.assert_allclose(known[0].offset, AWAY, atol=1e-6)


def test_what_lies_elsewhere_is_another_one_and_the_oldest_is_forgotten():
    offsets = [AWAY * scale for scale in (1.0, -1.0, 2.0, -2.0, 3.0)]
    known = twins_after(*offsets)
    assert len(known) == TUNING.most
    for twin, offset in zip(known, offsets[1:], strict=True):
        np.testing.assert_allclose(twin.offset, offset, atol=1e-6)


def test_what_lies_at_the_ring_may_be_the_ring_itself():
    assert twins_after([0.007, 0.0, 0.0]) == ()
    assert len(twins_after([0.009, 0.0, 0.0])) == 1


def test_an_offset_is_known_though_each_plane_tells_nothing_of_depth():
    # The twin's centres lie anywhere along their rays.
    fits = {}
    for plane in "ab":
        fit = plane_fit(plane, RING + AWAY)
        fits[plane] = plane_fit(plane, RING + AWAY + 0.03 * fit.ray)
    (twin,) = Twins(TUNING).after(detection_at(RING), [detection_of(fits)]).known
    np.testing.assert_allclose(twin.offset, AWAY, atol=1e-5)


@pytest.mark.parametrize(
    ("at", "others", "told"),
    [
        (RING, [RING + AWAY], 1.0),  # the twin is where it belongs
        (RING + AWAY, [RING], -1.0),  # something is where the ring would be, were this the twin
        (RING, [RING + AWAY, RING - AWAY], 0.0),
        (RING, [], 0.0),  # it may be hidden, or not looked for
        (RING, [RING + AWAY + np.array([0.0, 0.004, 0.0])], 0.0),
    ],
)
def test_who_is_the_ring_follows_from_where_the_other_one_lies(at, others, told):
    one = detection_at(at)
    alike = [one, *(detection_at(other) for other in others)]
    assert KNOWN.log_odds(one, alike) == pytest.approx(told * 0.8 * TUNING.log_odds)


def test_the_oftener_it_was_seen_the_more_it_tells():
    one, alike = detection_at(RING), [detection_at(RING + AWAY)]
    told = [
        Twins(TUNING, (Twin(AWAY, AWAY, RING, sightings, moves=True),)).log_odds(one, alike) for sightings in (1, 2, 8)
    ]
    np.testing.assert_allclose(told, TUNING.log_odds * np.array([1 / 2, 2 / 3, 8 / 9]))


def with_twin(index, translation):
    """Both lassos, moved together by (3,) metres."""
    images = {}
    for plane in "ab":
        empty = lasso_image(CURVE + 10.0, VIEWS[plane]).astype(float)
        both = (lasso_image(CURVE + translation + at, VIEWS[plane]) for at in (0.0, AWAY))
        images[plane] = empty + sum(image - empty for image in both)
    return pair_of(index, images)


def test_a_twin_that_comes_to_where_the_ring_was_foretold_is_not_taken_for_it():
    # Within the first breath the two go on by nearly their distance between two pairs: nothing foretold that.
    tracker = RingTracker(CONFIG)
    tracker.initialise(with_twin(0, np.zeros(3)), lasso_seed())
    down = -AWAY / np.linalg.norm(AWAY)
    steps_mm = (0.0, 0.5, 1.0, 1.5, 17.0, 18.0)
    results = [tracker.track(with_twin(index, 1e-3 * step * down)) for index, step in enumerate(steps_mm, start=1)]
    for result, step in zip(results, steps_mm, strict=True):
        assert result.motion is None or centre_error_mm(result, 1e-3 * step * down) < 0.5
    assert results[3].state is TRACKING


def test_what_lies_still_tells_nothing_for_it_does_not_move_with_the_heart():
    still, twins = RING + AWAY, Twins(TUNING)
    for step_mm in (0.0, 2.0, 4.0):
        ring = detection_at(RING + step_mm * np.array([0.0, 0.0, -1e-3]))
        twins = twins.after(ring, [ring, detection_at(still)])
    assert all(not twin.moves for twin in twins.known)
    assert twins.log_odds(detection_at(RING), [detection_at(still)]) == 0.0
    # Nor does a twin, before the ring has gone anywhere.
    ring = detection_at(RING)
    early = Twins(TUNING).after(ring, [detection_at(still)]).after(ring, [detection_at(still)])
    assert early.log_odds(ring, [detection_at(still)]) == 0.0


def test_all_twins_together_tell_no_more_than_one_that_is_known_well():
    other = np.array([-0.015, 0.004, 0.0])
    twins = Twins(TUNING, tuple(Twin(away, away, RING, 8, moves=True) for away in (AWAY, other)))
    alike = [detection_at(RING + away) for away in (AWAY, other)]
    assert twins.log_odds(detection_at(RING), alike) == TUNING.log_odds
