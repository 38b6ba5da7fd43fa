"""What is known of a ring: what it takes note of, and what it forgets when the ring is said to belong elsewhere."""

from types import SimpleNamespace

import numpy as np
import pytest
from support.ring_fits import detection_of, plane_fit

from lasso_motion_ros.motion.motion_model import ORIGIN_B
from lasso_motion_ros.motion.outcome import Outcome
from lasso_motion_ros.motion.respiration import RespiratoryMotion
from lasso_motion_ros.ring.association import Hypothesis
from lasso_motion_ros.ring.breathing_curve import BreathingCurve, CurveTuning
from lasso_motion_ros.ring.companions import Companions
from lasso_motion_ros.ring.display_chain import DisplayChain
from lasso_motion_ros.ring.own_turn import OwnTurn
from lasso_motion_ros.ring.plane_companions import CompanionTuning
from lasso_motion_ros.ring.plane_contradiction import ContradictionTuning, PlaneContradiction
from lasso_motion_ros.ring.seed_agreement import SeedAgreement
from lasso_motion_ros.ring.temporal_filter import DisplayChainTuning
from lasso_motion_ros.ring.track import Track
from lasso_motion_ros.ring.track_state import TrackBelief
from lasso_motion_ros.ring.twins import Twin, Twins, TwinTuning
from lasso_motion_ros.ring.withdrawal import Withdrawal, WithdrawalTuning

CENTRE = np.array([0.005, -0.010, 0.020])
RAY_A, LATERAL = np.array([1.0, 0.0, 0.0]), np.array([0.8, 0.6, 0.0])
ARMS = np.column_stack([np.cos(np.arange(6.0)), np.sin(np.arange(6.0)), np.zeros(6)]) * 0.01
AXIS = np.array([0.0, 0.0, 1.0])
CURVE = CurveTuning()


def track(late_s=0.0):
    detector = SimpleNamespace(seconds=lambda stamp_ns: 1e-9 * stamp_ns)
    model = SimpleNamespace(centre=CENTRE, arms=ARMS - ARMS.mean(axis=0), depth_directions=(RAY_A, LATERAL), axis=AXIS)
    return Track(
        model=model,
        seed=None,
        template=None,
        detector=detector,
        display=DisplayChain(DisplayChainTuning()),
        motion=RespiratoryMotion(0.0, late_s),
        curve=BreathingCurve(np.zeros(3), 0.0, CURVE),
        start_ns=0,
        agreement=SeedAgreement(0.0, ""),
        companions=Companions(CompanionTuning()),
        contradiction=PlaneContradiction.first(ContradictionTuning()),
        twins=Twins(TwinTuning()),
        withdrawal=Withdrawal.first(WithdrawalTuning()),
        electrodes=None,
        own_turn=OwnTurn.expected(np.radians(2.5)),
        usual_support=2.2,
        contrast={"a": 0.2, "b": 0.2},
    )


def hypothesis(one, place, *, evidence=1.2, contrast=0.1, turn_deg=0.0, planes="ab"):
    """The ring at a displacement (3,) m, taken in at the track's last time."""
    fits = {p: plane_fit(p, CENTRE + place, evidence=evidence, contrast=contrast) for p in planes}
    detection = detection_of(fits, turn=np.radians([0.0, turn_deg, 0.0]))
    motion = one.motion.copy()
    for p in planes:
        motion.observe(one.last_s, **{p: detection.observation(p, CENTRE)})
        motion.mark_a(one.last_s)
    outcome = Outcome(0.0, motion.at_a, None, lambda: motion)
    return Hypothesis(detection, outcome, 9.0, 0.0, 0.0, probability=0.999)


def seen(one, stamp_ns, place, **of_hypothesis):
    """Take in a pair, as the tracker does."""
    time_s = one.begin(stamp_ns)
    best = hypothesis(one, place, **of_hypothesis)
    one.see(best)
    one.motion, one.displacement = best.motion, best.displacement
    one.learn_motion(best, time_s)
    one.learn_late()
    return best


def test_the_way_since_the_last_pair_is_a_share_of_that_since_it_was_seen():
    one = track()
    seen(one, 1_000_000_000, np.array([0.0, 0.0, -0.003]))
    one.begin(2_000_000_000)
    np.testing.assert_allclose(one.way(one.seen_before - np.array([0.0, 0.0, 0.004])), [0.0, 0.0, -0.004], atol=1e-12)
    one.begin(3_000_000_000)
    np.testing.assert_allclose(one.way(one.seen_before - np.array([0.0, 0.0, 0.004])), [0.0, 0.0, -0.002], atol=1e-12)


def test_a_pair_begins_with_nothing_seen():
    one = track()
    assert one.begin(300_000_000) == pytest.approx(0.3)
    assert one.begin(700_000_000) == pytest.approx(0.7)
    assert one.interval_s == pytest.approx(0.4)
    assert one.displacement is None
    np.testing.assert_array_equal(one.seen_at, 0.0)


def test_what_it_looks_like_is_noted_of_every_pair_that_is_believed():
    one = track()
    one.begin(300_000_000)
    one.see(hypothesis(one, np.zeros(3), evidence=1.2, contrast=0.1, turn_deg=3.0))
    # Support 1.3 · 1.2 = 1.56, and 2.2 in the seed pair.
    assert one.usual_support == pytest.approx(0.5 * (1.56 + 2.2))
    assert one.contrast == {"a": 0.1, "b": 0.1}
    np.testing.assert_allclose(one.last_turn, np.radians([0.0, 3.0, 0.0]))
    one.see(hypothesis(one, np.zeros(3), contrast=0.0, planes="b"))
    assert one.contrast["a"] == 0.1  # plane A was not there to tell
    assert one.contrast["b"] > 0.0  # something to divide by


def test_half_of_its_turn_is_the_best_guess_for_the_next_pair():
    one = track()
    seen(one, 300_000_000, np.array([0.0, 0.0, 0.004]), turn_deg=4.0)
    np.testing.assert_allclose(one.turn, np.radians([0.0, 2.0, 0.0]))
    np.testing.assert_allclose(one.displacement, [0.0, 0.0, 0.004], atol=1e-4)


def test_how_it_moved_is_learned_late_where_that_revises_nothing():
    one, revised = track(), track(late_s=0.1)
    for each in (one, revised):
        time_s = each.begin(300_000_000)
        best = hypothesis(each, np.array([0.0, 0.0, 0.004]), turn_deg=4.0)
        each.motion, each.displacement = best.motion, best.displacement
        each.learn_motion(best, time_s)
    # Plane B's first exposure came later: what the ring did until then is told by how it moves.
    assert revised.turn.any()
    np.testing.assert_array_equal(revised.displacement, revised.motion.at_a.displacement)
    assert not one.turn.any()
    one.displacement = None  # no pose rests on it
    one.learn_late()
    assert one.turn.any()
    assert one.displacement is None
    mean = one.motion.mean
    assert mean.any()
    one.learn_late()  # once
    np.testing.assert_array_equal(one.motion.mean, mean)


def test_the_reference_is_where_it_was_seen_last():
    one = track()
    seen(one, 300_000_000, np.array([0.0, 0.001, 0.004]))
    one.refer_to_now()
    np.testing.assert_array_equal(one.reference, one.displacement)
    assert one.reference_ns == 300_000_000
    np.testing.assert_array_equal(one.reference_covariance, one.motion.at_a.covariance)


def test_the_reference_of_one_plane_alone_is_known_as_well_as_its_place():
    one = track()
    for index in range(1, 9):
        seen(one, index * 300_000_000, np.array([0.0, 0.0, 1e-3 * (index % 4)]))
    one.begin(9 * 300_000_000)
    told = one.take_alone(hypothesis(one, np.array([0.0, 0.0, 1e-3]), planes="a"), one.last_s)
    one.refer_to_now()
    np.testing.assert_array_equal(one.reference_covariance, told)
    np.testing.assert_array_equal(one.reference, one.displacement)
    # The next pair that both planes show is known by itself.
    seen(one, 10 * 300_000_000, np.array([0.0, 0.0, 2e-3]))
    one.refer_to_now()
    np.testing.assert_array_equal(one.reference_covariance, one.motion.at_a.covariance)


def test_said_to_belong_elsewhere_it_belongs_there_as_it_lies():
    one = track()
    for index in range(1, 8):
        seen(one, index * 300_000_000, np.array([0.0, 0.0, 1e-3 * (index % 4)]))
    aside = np.array([0.020, 0.012, 0.009])
    one.begin(8 * 300_000_000)
    best = hypothesis(one, aside, turn_deg=5.0)
    one.see(best)
    one.twins = Twins(TwinTuning(), (Twin(aside, aside, CENTRE),))  # beside where it was
    one.displacement, one.belief, one.is_followed = aside, TrackBelief(0.0, 1.0, 0.0), False
    curve = BreathingCurve(aside, one.last_s, CURVE)
    one.settle(curve)
    np.testing.assert_array_equal(one.home, aside)
    np.testing.assert_allclose(one.home_turn, np.radians([0.0, 5.0, 0.0]))
    np.testing.assert_allclose(one.turn, np.radians([0.0, 2.5, 0.0]))
    assert one.belief == TrackBelief()
    assert one.curve is curve
    assert one.is_followed
    assert one.contradiction.home_mm is None
    assert one.twins.known == ()
    assert len(one.seat.times_s) == 0
    # It breathes on from there.
    np.testing.assert_allclose(one.motion.predict(one.last_s).displacement, aside, atol=1e-3)


def test_what_the_ring_moved_before_plane_b_saw_it_first_puts_the_models_depth_off():
    one = track(late_s=0.1)
    np.testing.assert_allclose(one.depth_correction, 0.0, atol=1e-9)
    state = one.motion._state.copy()
    state[ORIGIN_B] = [[0.0], [0.004], [0.0]]  # plane B's origin: 4 mm aside
    one.motion._become(state, one.motion._covariance)
    # -(0.6 · 4) / 0.8 = -3 mm along plane A's ray.
    np.testing.assert_allclose(one.depth_correction, [-0.003, 0.0, 0.0], atol=1e-9)
    np.testing.assert_allclose(one.centre - CENTRE, [-0.003, 0.0, 0.0], atol=1e-9)


def test_what_is_usual_is_the_mean_at_first_and_follows_slowly_later():
    # The seed pair shows more of a template that was made from it than any later pair does.
    one = track()
    for index in range(3):
        seen(one, (index + 1) * 10**9, np.zeros(3), evidence=1.2)
    assert one.usual_support == pytest.approx((2.2 + 3 * 1.56) / 4)
    for index in range(3, 40):
        seen(one, (index + 1) * 10**9, np.zeros(3), evidence=1.2)
    before = one.usual_support
    seen(one, 41 * 10**9, np.zeros(3), evidence=0.8)
    assert one.usual_support == pytest.approx(0.9 * before + 0.1 * 1.04)


def test_it_counts_turns_from_how_it_belongs():
    one = track()
    one.home_turn = np.radians([0.0, 3.0, 0.0])
    turned = Hypothesis(
        detection_of({"a": plane_fit("a", CENTRE)}, turn=np.radians([0.0, 5.0, 1.0])), None, 0.0, 0.0, 0.0
    )
    np.testing.assert_allclose(np.degrees(one.turn_of(turned)), [0.0, 2.0, 1.0], atol=1e-12)


def test_what_it_does_on_its_seat_is_learned_with_its_breathing():
    one = track()
    for index in range(1, 8):
        seen(one, index * 300_000_000, np.array([0.0, 0.0, 1e-3 * (index % 4)]))
    one.learn_late()
    assert len(one.seat.times_s) == 7


def test_how_it_was_turned_counts_for_later_pairs():
    one = track()
    before = one.own_turn
    one.unlearned_turn = np.radians([0.0, 9.0, 0.0])
    assert one.own_turn is before
    one.learn_late()
    assert one.own_turn.sigma_rad > before.sigma_rad
    assert one.unlearned_turn is None


@pytest.mark.parametrize(
    ("turn_deg", "stretch", "own_deg"),
    [
        ((3.0, 0.0, -7.2), 0.04, (3.0, 0.0, 0.0)),  # a turn of wire longer by 4 %: half of 360° by a twenty-fifth
        ((3.0, 0.0, 7.2), 0.04, (3.0, 0.0, 0.0)),
        ((0.0, 1.0, -7.2), -0.04, (0.0, 1.0, 0.0)),
        ((0.0, 0.0, -10.0), 0.04, (0.0, 0.0, -2.8)),
        ((8.0, 0.0, 6.0), 0.0, (8.0, 0.0, 6.0)),
    ],
)
def test_electrodes_that_a_longer_wire_draws_along_it_are_no_turn(turn_deg, stretch, own_deg):
    one = track()
    detection = detection_of({"a": plane_fit("a", CENTRE)}, turn=np.radians(turn_deg), stretch=stretch)
    np.testing.assert_allclose(np.degrees(one.turn_of(Hypothesis(detection, None, 0.0, 0.0, 0.0))), own_deg, atol=1e-9)


def test_how_wide_it_is_counts_from_how_it_belongs():
    one = track()
    wide = detection_of({"a": plane_fit("a", CENTRE)}, turn=np.radians([0.0, 0.0, -7.2]), stretch=0.04)
    one.see(Hypothesis(wide, None, 0.0, 0.0, 0.0))
    one.displacement = np.zeros(3)
    one.settle(BreathingCurve(np.zeros(3), 0.0, CURVE))
    as_before = Hypothesis(detection_of({"a": plane_fit("a", CENTRE)}), None, 0.0, 0.0, 0.0)
    np.testing.assert_allclose(one.turn_of(as_before), 0.0, atol=1e-9)
