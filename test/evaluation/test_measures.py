"""The measures, on numbers worked out by hand."""

from __future__ import annotations

import json
from typing import Any

import numpy as np
import pytest

from lasso_motion_ros.evaluation.measures import (
    PairEstimate,
    PairTruth,
    Truth,
    centre_covariance,
    is_displaced,
    score_pairs,
    symmetric_mean_distance,
)
from lasso_motion_ros.evaluation.summary import evaluation_record, format_table, mean_row, summarise
from lasso_motion_ros.geometry.carm import carm_projection
from lasso_motion_ros.geometry.transforms import apply, rigid

PERIOD_NS = 300_000_000
START_NS = 1_760_000_000_000_000_000
# Seen straight from the front and from the side: 1 mm in the world is 1.5/0.3 = 5 px, a pixel at the loop 0.2 mm.
FRONT, SIDE = (
    carm_projection(
        angle,
        0.0,
        source_detector_m=1.2,
        source_object_m=0.8,
        pixel_size_m=0.3e-3,
        width=512,
        height=512,
        mirrored=False,
    )
    for angle in (0.0, np.pi / 2)
)
ANGLES = np.linspace(0.0, 2 * np.pi, 181)
LOOP = 0.01 * np.column_stack([np.cos(ANGLES), np.zeros_like(ANGLES), np.sin(ANGLES)])
TARGETS = np.array([[0.02, 0.0, 0.0], [-0.02, 0.0, 0.0], [0.0, 0.0, 0.03]])


def shift(x_mm: float = 0.0, y_mm: float = 0.0, z_mm: float = 0.0) -> np.ndarray:
    return rigid((0, 0, 0), np.array([x_mm, y_mm, z_mm]) * 1e-3)


def stamp(index: int) -> int:
    return START_NS + index * PERIOD_NS


def true_pair(index: int, motion: np.ndarray, *, loop: np.ndarray | None = None, planes: str = "ab") -> PairTruth:
    """A pair that shows `loop` (where the motion carries it, unless given) in some planes."""
    projections = {"a": FRONT, "b": SIDE}
    shown = apply(motion, LOOP) if loop is None else loop
    centrelines = {plane: projections[plane].project(shown) for plane in planes}
    return PairTruth(stamp(index), motion, motion, centrelines, projections)


def estimate(index: int, pose: np.ndarray | None, **more: Any) -> PairEstimate:
    values = {
        "state": "TRACKING",
        "motion_raw": pose,
        "motion": pose,
        "loop": None if pose is None else apply(pose, LOOP),
        "reference_ns": stamp(0),
    }
    return PairEstimate(stamp(index), **(values | more))


def test_parallel_lines_are_their_distance_apart() -> None:
    first = np.array([[0.0, 0.0], [10.0, 0.0]])
    assert symmetric_mean_distance(first, first + np.array([0.0, 2.0])) == pytest.approx(2.0)


def test_a_curve_that_covers_half_of_the_other_is_charged_for_the_rest() -> None:
    whole = np.array([[0.0, 0.0], [10.0, 0.0]])
    half = np.array([[0.0, 0.0], [5.0, 0.0]])
    # From half to whole 0; from whole to half 0 on one half and 0 … 5 on the other, so 1.25 on average.
    assert symmetric_mean_distance(whole, half) == pytest.approx(0.625, rel=1e-2)
    assert symmetric_mean_distance(half, whole) == pytest.approx(symmetric_mean_distance(whole, half))


def test_the_mean_is_along_the_curve_not_over_its_vertices() -> None:
    line = np.array([[0.0, 0.0], [10.0, 0.0]])
    crowded = np.array([[0.0, 0.0], *[[10.0 - i * 1e-3, 4.0] for i in range(50)][::-1]])
    sparse = np.array([[0.0, 0.0], [10.0, 4.0]])
    assert symmetric_mean_distance(line, crowded) == pytest.approx(symmetric_mean_distance(line, sparse), rel=2e-2)


def test_a_perfect_answer_has_no_error_and_removes_everything() -> None:
    motions = [shift(), shift(z_mm=6.0), shift(x_mm=3.0, z_mm=-4.0)]
    truth = Truth([true_pair(i, motion) for i, motion in enumerate(motions)], LOOP, TARGETS)
    summary = summarise(score_pairs(truth, [estimate(i, motion) for i, motion in enumerate(motions)]))
    assert (summary.pairs, summary.expected, summary.poses, summary.missing, summary.lost_in_silence) == (3, 2, 2, 0, 0)
    assert summary.error_2d_a_mm == pytest.approx(0.0, abs=1e-9)
    assert summary.centre_error_mm == pytest.approx(0.0, abs=1e-9)
    assert summary.static_error_mm == pytest.approx(5.5)  # |6| and |(3, −4)| = 5: the mean leaves pair 0 out
    assert summary.removed_share == pytest.approx(1.0)


def test_errors_of_a_shifted_answer() -> None:
    """1.5 mm too far along z: seen in both planes, at the loop and, magnified 1.2/0.8 times, on the detector."""
    truth = Truth([true_pair(0, shift()), true_pair(1, shift(z_mm=6.0))], LOOP, TARGETS)
    pairs = score_pairs(truth, [estimate(0, shift()), estimate(1, shift(z_mm=7.5))])
    np.testing.assert_allclose(pairs[1].centre_error_m, [0.0, 0.0, 1.5e-3], atol=1e-12)
    assert pairs[1].target_error_mm == pytest.approx(1.5)
    assert pairs[1].static_error_mm == pytest.approx(6.0)
    # Seen edge-on from the side the loop is a line along z: only its ends miss the other, by up to 1.5 mm.
    assert pairs[1].error_2d_mm["b"] < 0.2
    # Face-on the curves are circles: a point at angle φ is |1.5 sin φ| off to first order; its mean is 1.5 · 2/π.
    assert pairs[1].error_2d_mm["a"] == pytest.approx(1.5 * 2 / np.pi, rel=0.02)
    assert pairs[1].error_detector_mm["a"] == pytest.approx(1.5 * pairs[1].error_2d_mm["a"], rel=0.02)
    assert summarise(pairs).removed_share == pytest.approx(0.75)


def test_the_reference_pair_gives_the_model_error_only() -> None:
    truth = Truth([true_pair(0, shift()), true_pair(1, shift())], LOOP, TARGETS)
    wide = LOOP * 1.1  # a model of 11 mm radius: 1 mm off everywhere
    summary = summarise(score_pairs(truth, [estimate(0, shift(), loop=wide), estimate(1, shift())]))
    assert summary.model_error_a_mm == pytest.approx(1.0, rel=1e-2)
    assert summary.error_2d_a_mm == pytest.approx(0.0, abs=1e-9)


def test_constant_part_and_jitter_are_told_apart() -> None:
    truth = Truth([true_pair(i, shift()) for i in range(3)], LOOP, TARGETS)
    answers = [estimate(0, shift()), estimate(1, shift(x_mm=0.5, y_mm=0.3)), estimate(2, shift(x_mm=0.5, y_mm=-0.3))]
    summary = summarise(score_pairs(truth, answers))
    assert summary.centre_constant_mm == pytest.approx(0.5)
    assert summary.centre_jitter_mm == pytest.approx(0.3)
    assert summary.centre_error_mm == pytest.approx(np.hypot(0.5, 0.3))


@pytest.mark.parametrize(("off_mm", "silent"), [(1.9, 0), (2.1, 1)])
def test_a_pose_more_than_two_millimetres_off_is_lost_in_silence(off_mm: float, silent: int) -> None:
    truth = Truth([true_pair(0, shift()), true_pair(1, shift())], LOOP, TARGETS)
    summary = summarise(score_pairs(truth, [estimate(0, shift()), estimate(1, shift(x_mm=off_mm))]))
    assert summary.lost_in_silence == silent
    assert summary.false_poses == 0


def test_missing_counts_pairs_that_show_the_lasso_only() -> None:
    truth = Truth([true_pair(0, shift()), true_pair(1, shift()), true_pair(2, shift(), planes="")], LOOP, TARGETS)
    pairs = score_pairs(truth, [estimate(0, shift()), estimate(1, None, state="LOST"), estimate(2, None, state="LOST")])
    assert [pair.missing for pair in pairs] == [False, True, False]
    assert [pair.hidden for pair in pairs] == [False, False, True]
    assert summarise(pairs).expected == 1


def test_a_pose_without_a_lasso_is_false_and_in_no_mean() -> None:
    truth = Truth([true_pair(0, shift()), true_pair(1, shift(z_mm=5.0), planes="")], LOOP, TARGETS)
    pairs = score_pairs(truth, [estimate(0, shift()), estimate(1, shift(z_mm=5.0))])
    assert pairs[1].false_pose
    summary = summarise(pairs)
    assert (summary.false_poses, summary.lost_in_silence) == (1, 1)
    assert summary.centre_error_mm is None


def test_a_lasso_hidden_in_one_plane_may_be_answered_or_not() -> None:
    truth = Truth([true_pair(0, shift()), true_pair(1, shift(), planes="a")], LOOP, TARGETS)
    silent = score_pairs(truth, [estimate(0, shift())])
    assert not silent[1].missing
    answered = score_pairs(truth, [estimate(0, shift()), estimate(1, shift())])
    assert not answered[1].false_pose
    assert set(answered[1].error_2d_mm) == {"a"}


@pytest.mark.parametrize(("away_mm", "displaced"), [(2.5, False), (3.5, True), (25.0, True)])
def test_a_lasso_away_from_where_the_atrium_carries_it_is_displaced(away_mm: float, displaced: bool) -> None:
    moved = apply(shift(z_mm=8.0 + away_mm), LOOP)
    pair = true_pair(1, shift(z_mm=8.0), loop=moved)
    assert is_displaced(pair, LOOP) is displaced
    pairs = score_pairs(
        Truth([true_pair(0, shift()), pair], LOOP, TARGETS), [estimate(0, shift()), estimate(1, shift())]
    )
    assert pairs[1].false_pose is displaced
    assert pairs[1].expected is not displaced


def test_a_displacement_along_one_view_is_seen_in_the_other() -> None:
    pair = true_pair(1, shift(), loop=apply(shift(y_mm=6.0), LOOP))
    assert is_displaced(pair, LOOP)


def test_the_rings_own_tilt_is_no_displacement() -> None:
    pair = true_pair(1, shift(), loop=apply(rigid((0.2, 0.0, 0.1), (0, 0, 0)), LOOP))
    assert not is_displaced(pair, LOOP)


def test_a_later_reference_is_compared_with_the_motion_since_then() -> None:
    motions = [shift(z_mm=4.0), shift(z_mm=6.0), shift(z_mm=9.0)]
    truth = Truth([true_pair(i, motion) for i, motion in enumerate(motions)], LOOP, TARGETS)
    later = {"reference_ns": stamp(1)}
    pairs = score_pairs(truth, [estimate(1, shift(), **later), estimate(2, shift(z_mm=3.5), **later)])
    assert [pair.is_reference for pair in pairs] == [False, True, False]
    assert [pair.expected for pair in pairs] == [False, False, True]  # before the clicks nothing is due
    np.testing.assert_allclose(pairs[2].centre_error_m, [0, 0, 0.5e-3], atol=1e-12)
    assert pairs[2].static_error_mm == pytest.approx(3.0)


def test_the_covariance_of_a_moved_point() -> None:
    """1 mm in each direction, and 10 mrad about x, which moves a point at z = 0.1 m by 1 mm against y."""
    covariance = np.diag([1e-6, 1e-6, 1e-6, 1e-4, 0.0, 0.0])
    centre = np.array([0.0, 0.0, 0.1])
    np.testing.assert_allclose(centre_covariance(covariance, centre), np.diag([1e-6, 2e-6, 1e-6]), atol=1e-18)
    # Shift along y and turn about x together: half of what the turn adds is taken back, 2 · 0.1 m · 5e-6 m rad.
    covariance[1, 3] = covariance[3, 1] = 5e-6
    np.testing.assert_allclose(centre_covariance(covariance, centre), np.diag([1e-6] * 3), atol=1e-18)


def test_the_lever_arm_is_that_of_small_rigid_motions() -> None:
    centre, step = np.array([0.03, -0.05, 0.08]), 1e-6
    small = step * np.eye(6)
    columns = [(apply(rigid(change[3:], change[:3]), centre) - centre) / step for change in small]
    root = np.random.default_rng(3).normal(size=(6, 6))
    expected = np.column_stack(columns) @ root @ root.T @ np.column_stack(columns).T
    np.testing.assert_allclose(centre_covariance(root @ root.T, centre), expected, rtol=1e-5)


def test_coverage_of_the_covariance() -> None:
    truth = Truth([true_pair(i, shift()) for i in range(4)], LOOP, TARGETS)
    sigma = {"covariance": np.diag([0.25e-6] * 3 + [0.0] * 3)}  # 0.5 mm a direction
    offsets = (0.5, 1.2, 1.6)  # normalised squares 1, 5.76 and 10.24 against 3.51 (68 %) and 7.81 (95 %)
    answers = [estimate(0, shift())]
    answers += [estimate(i + 1, shift(x_mm=off), **sigma) for i, off in enumerate(offsets)]
    pairs = score_pairs(truth, answers)
    assert [pair.nees for pair in pairs[1:]] == pytest.approx([1.0, 5.76, 10.24])
    summary = summarise(pairs)
    assert summary.covariance_68_share == pytest.approx(1 / 3)
    assert summary.covariance_95_share == pytest.approx(2 / 3)
    assert summary.centre_sigma_mm == pytest.approx(0.5 * np.sqrt(3))


def test_breathing_is_compared_with_the_filtered_motion() -> None:
    beating = PairTruth(stamp(1), shift(z_mm=6.0), shift(z_mm=5.0), true_pair(1, shift(z_mm=6.0)).centrelines, {})
    truth = Truth([true_pair(0, shift()), beating], LOOP, TARGETS)
    answer = estimate(1, shift(z_mm=6.0), motion=shift(z_mm=5.2))
    pairs = score_pairs(truth, [estimate(0, shift()), answer])
    assert pairs[1].respiratory_error_mm == pytest.approx(0.2)
    assert pairs[1].centre_error_mm == pytest.approx(0.0, abs=1e-9)


def test_hand_drawn_centrelines_alone_give_the_2d_error() -> None:
    pairs = [
        PairTruth(stamp(i), None, None, true_pair(i, shift(z_mm=2.0 * i)).centrelines, {"a": FRONT, "b": SIDE})
        for i in range(2)
    ]
    summary = summarise(score_pairs(Truth(pairs), [estimate(i, shift(z_mm=2.0 * i)) for i in range(2)]))
    assert summary.error_2d_a_mm == pytest.approx(0.0, abs=1e-9)
    assert summary.model_error_b_mm == pytest.approx(0.0, abs=1e-9)
    assert summary.centre_error_mm is None
    assert summary.lost_in_silence is None
    assert summary.removed_share is None


def test_stamps_rounded_by_a_missing_plane_still_match() -> None:
    truth = Truth([true_pair(0, shift()), true_pair(1, shift())], LOOP, TARGETS)
    rounded = PairEstimate(stamp(1) + 3, "DEGRADED", shift(), reference_ns=stamp(0))
    summary = summarise(score_pairs(truth, [estimate(0, shift()), rounded]))
    assert (summary.poses, summary.missing, summary.degraded_share) == (1, 0, 1.0)


def test_nothing_published_is_all_missing() -> None:
    truth = Truth([true_pair(i, shift()) for i in range(3)], LOOP, TARGETS)
    summary = summarise(score_pairs(truth, []))
    assert (summary.poses, summary.missing, summary.error_2d_a_mm) == (0, 2, None)


def test_the_report_is_json_and_the_table_has_a_row_each() -> None:
    truth = Truth([true_pair(i, shift()) for i in range(3)], LOOP, TARGETS)
    good = score_pairs(truth, [estimate(i, shift()) for i in range(3)])
    bad = score_pairs(truth, [estimate(0, shift()), estimate(1, shift(x_mm=4.0))])
    document = json.loads(json.dumps(evaluation_record({"good": good, "bad": bad})))
    assert document["recordings"]["bad"]["summary"]["lost_in_silence"] == 1
    assert document["recordings"]["good"]["pairs"][1]["centre_error_mm"] == pytest.approx(0.0, abs=1e-9)
    assert document["mean"]["centre_error_mm"] == pytest.approx(2.0)  # of 0 and 4
    assert document["mean"]["missing"] == 1
    for block in format_table({"good": summarise(good), "bad": summarise(bad)}).split("\n\n"):
        lines = block.splitlines()
        assert [line.split()[0] for line in lines if not line.startswith("-")] == ["in", "good", "bad", "mean"]
        assert len({len(line) for line in lines}) == 1


def test_the_mean_row_leaves_out_what_is_unknown() -> None:
    truth = Truth([true_pair(0, shift()), true_pair(1, shift())], LOOP, TARGETS)
    answered = summarise(score_pairs(truth, [estimate(0, shift()), estimate(1, shift(x_mm=1.0))]))
    empty = summarise(score_pairs(truth, []))
    assert mean_row([answered, empty])["centre_error_mm"] == pytest.approx(1.0)
