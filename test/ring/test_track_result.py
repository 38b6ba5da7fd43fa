"""From a track to a pose: what is published, and how well it is known."""

from types import SimpleNamespace

import numpy as np
import pytest
from support.lasso_inputs import LOOP, VIEWS
from support.ring_fits import detection_of, plane_fit

from lasso_motion_ros.evaluation.measures import centre_covariance
from lasso_motion_ros.geometry.frames import Frame, FramePair
from lasso_motion_ros.geometry.transforms import apply
from lasso_motion_ros.ring.association import Hypothesis
from lasso_motion_ros.ring.seat import Seat, SeatTuning
from lasso_motion_ros.ring.seed_agreement import SeedAgreement
from lasso_motion_ros.ring.track_result import covariance_since_reference, with_curve, with_pose, without_pose
from lasso_motion_ros.ring.uncertainty import CALIBRATION_SHARE, PIVOT_M
from lasso_motion_ros.tracking.tracker import TrackerState

AXIS = np.array([0.0, 0.0, 1.0])
ANGLES = np.linspace(0.0, 2.0 * np.pi, 12, endpoint=False)
ARMS = 0.01 * np.column_stack([np.cos(ANGLES), np.sin(ANGLES), np.zeros(12)])
PIXELS = np.zeros((512, 512), np.uint8)
PAIR = FramePair(7, Frame(7, PIXELS, VIEWS["a"]), Frame(7, PIXELS, VIEWS["b"]))
MOVED, REFERENCE = np.array([0.001, -0.003, -0.010]), np.array([0.0, 0.0, -0.002])
PRIOR_RAD = np.radians(2.5)


def rotation(vector=(0.0, 0.0, 0.0), sigma_rad=0.0):
    """What of the breath is a rotation: the same between any two places."""
    found = SimpleNamespace(vector=np.array(vector), covariance=sigma_rad**2 * np.eye(3))
    return SimpleNamespace(between=lambda *_: found)


def track(**changed):
    values = {
        "model": SimpleNamespace(arms=ARMS, axis=AXIS),
        "centre": LOOP.centre,
        "home": np.zeros(3),
        "seen_at": MOVED,
        "reference": REFERENCE,
        "start_ns": 3,
        "reference_ns": 3,
        "last_s": 0.0,
        "seat": Seat.first(SeatTuning()),
        "agreement": SeedAgreement(0.0, ""),
        "electrodes": None,
        "reference_covariance": np.zeros((3, 3)),
        "rotation": rotation(),
        "display": SimpleNamespace(filters={"a": 0.3}),
    }
    return SimpleNamespace(**(values | changed))


def best(turn=(0.0, 0.0, 0.0)):
    fits = {plane: plane_fit(plane, LOOP.centre + MOVED) for plane in "ab"}
    return Hypothesis(detection_of(fits, turn=np.array(turn)), None, 9.0, 0.1, 0.05, probability=0.999)


def posed(one, position=np.zeros((3, 3)), found=None):  # noqa: B008
    since = covariance_since_reference(one, position, found)
    return with_pose(without_pose(one, PAIR, TrackerState.TRACKING, ""), one, since)


def test_without_a_pose_there_is_no_pose():
    result = without_pose(track(), PAIR, TrackerState.LOST, "why")
    assert (result.state, result.reason) == (TrackerState.LOST, "why")
    assert (result.stamp_ns, result.reference_stamp_ns) == (7, 3)
    assert result.motion is result.covariance is result.loop is None
    assert result.temporal_filter == {"a": 0.3}


def test_the_pose_is_the_motion_since_the_reference():
    motion = posed(track()).motion
    np.testing.assert_array_equal(motion[:3, :3], np.eye(3))
    np.testing.assert_allclose(motion[:3, 3], MOVED - REFERENCE)


def test_the_rings_centre_goes_where_it_has_gone_whatever_turns():
    turned = track(rotation=rotation((0.02, -0.01, 0.03)))
    motion = posed(turned).motion
    np.testing.assert_allclose(apply(motion, LOOP.centre + REFERENCE), LOOP.centre + MOVED, atol=1e-12)
    np.testing.assert_allclose(motion[:3, :3] @ motion[:3, :3].T, np.eye(3), atol=1e-12)


def test_the_covariance_at_the_ring_is_the_sum_of_its_causes_by_hand():
    one = track(reference_covariance=4e-10 * np.eye(3))
    turn = np.array([0.03, 0.0, 0.0])
    result = posed(one, np.diag([1.0, 4.0, 9.0]) * 1e-10, best(turn))
    calibration = (CALIBRATION_SHARE * np.linalg.norm(MOVED - REFERENCE)) ** 2
    pivot = (PIVOT_M * 0.03) ** 2 * np.array([0.0, 1.0, 1.0])  # a turn moves nothing along its own axis
    expected = np.diag(np.array([1.0, 4.0, 9.0]) * 1e-10 + 4e-10 + calibration + pivot)
    np.testing.assert_allclose(centre_covariance(result.covariance, LOOP.centre + MOVED), expected, atol=1e-13)


def test_a_pose_is_less_sure_the_longer_the_ring_may_have_shifted_on_its_seat():
    def at_the_ring(last_s):
        posed_later = posed(track(last_s=last_s, reference=MOVED))
        return centre_covariance(posed_later.covariance, LOOP.centre + MOVED)

    later = 3.0  # s after the first pair, which is the reference
    np.testing.assert_allclose(at_the_ring(0.0), np.zeros((3, 3)), atol=1e-15)
    np.testing.assert_allclose(at_the_ring(later), Seat.first(SeatTuning()).covariance(later), atol=1e-13)


def test_an_uncertain_rotation_has_its_lever_at_the_world_origin():
    result = posed(track(rotation=rotation(sigma_rad=0.01), reference=MOVED))
    np.testing.assert_allclose(result.covariance[3:, 3:], 1e-4 * np.eye(3), atol=1e-12)
    lever = np.linalg.norm(LOOP.centre + MOVED)
    assert np.trace(result.covariance[:3, :3]) == pytest.approx(2.0 * (0.01 * lever) ** 2, rel=0.01)


def test_the_curve_is_the_model_turned_and_carried():
    quarter = np.array([0.0, 0.0, np.pi / 2.0])
    result = with_curve(track(), PAIR, TrackerState.TRACKING, "", best(quarter), PRIOR_RAD)
    expected = LOOP.centre + MOVED + np.column_stack([-ARMS[:, 1], ARMS[:, 0], ARMS[:, 2]])
    np.testing.assert_allclose(result.loop, expected, atol=1e-12)
    assert result.motion is None
    # 0.1 mm beside the curve, in each plane's own pixels.
    for plane, residual in result.residual_px.items():
        assert residual == pytest.approx(0.1 / VIEWS[plane].millimetres_per_pixel(LOOP.centre + MOVED))


def test_what_the_ring_does_by_itself_is_less_what_the_breath_turns():
    one = track(rotation=rotation((0.01, 0.0, 0.02)))
    found = best((0.04, 0.0, 0.05))
    ring = with_curve(one, PAIR, TrackerState.TRACKING, "", found, PRIOR_RAD).ring
    assert ring.tilt_rad == pytest.approx(0.03)
    assert ring.spin_rad == pytest.approx(0.03)
    assert ring.size == pytest.approx(1.0)


def test_a_spin_that_the_images_do_not_tell_is_not_told():
    # Its standard deviation here is 0.01 rad: of 0.03 a resolved third, of 0.015 no more than was known before.
    for prior_rad, is_told in ((0.03, True), (0.015, False)):
        ring = with_curve(track(), PAIR, TrackerState.TRACKING, "", best(), prior_rad).ring
        assert (ring.spin_rad is not None) == is_told
