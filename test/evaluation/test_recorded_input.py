"""Truth and answers as they are read from recordings."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from support.drawn_recording import PERIOD_NS, START_NS, loop, projections, shift, stamp, write_input, write_result

from lasso_motion_ros.core.errors import MessageError, RecordingError
from lasso_motion_ros.evaluation.recorded_input import read_estimates, read_truth
from msg_adapters import topics
from msg_adapters.calibrations import encode_camera_info
from msg_adapters.markers import encode_delete, encode_line_strip
from msg_adapters.messages import header_fields
from msg_adapters.poses import encode_pose_stamped, encode_pose_with_covariance_stamped
from msg_adapters.recordings.writer import RecordingWriter
from msg_adapters.seeds import encode_polygon


def test_the_truth_is_read_whole(tmp_path: Path) -> None:
    truth = read_truth(write_input(tmp_path / "in.mcap", [0.0, 3.0, 5.0], hidden=(1,))).truth
    assert [pair.stamp_ns for pair in truth.pairs] == [stamp(0), stamp(1), stamp(2)]
    np.testing.assert_allclose(truth.pairs[2].motion, shift(5.0), atol=1e-12)
    np.testing.assert_allclose(truth.loop, loop(), atol=1e-12)
    assert [set(pair.centrelines) for pair in truth.pairs] == [{"a", "b"}, set(), {"a", "b"}]
    expected = projections()["b"].project(loop() + np.array([0, 0, 5e-3]))
    np.testing.assert_allclose(truth.pairs[2].centrelines["b"], expected, atol=1e-3)  # polygons are float32
    np.testing.assert_allclose(truth.pairs[2].projections["a"].matrix, projections()["a"].matrix, atol=1e-6)


def test_a_refused_calibration_is_named_with_file_and_topic(tmp_path: Path) -> None:
    path = tmp_path / "in.mcap"
    with RecordingWriter(path) as writer:
        info = encode_camera_info(projections()["b"], header_fields(stamp(0)))
        info["p"] = info["p"] * np.array([1, 1, 1, 1e3] * 3)
        topic = topics.camera_info_topic("b")
        writer.write(topic.recorded_name, topic.type_name, info, stamp(0))
    with pytest.raises(MessageError, match=r"in\.mcap: /plane_b/camera_info: p: .*looks like millimetres"):
        read_truth(path)


def test_a_cut_recording_is_read_as_far_as_it_goes(tmp_path: Path) -> None:
    whole = write_input(tmp_path / "in.mcap", [0.0, 3.0, 5.0])
    cut = tmp_path / "cut.mcap"
    cut.write_bytes(whole.read_bytes()[:-200])
    assert read_truth(whole).damage is None
    read = read_truth(cut)
    assert read.truth.pairs
    assert read.damage is not None


def test_no_truth_is_said(tmp_path: Path) -> None:
    with pytest.raises(RecordingError, match="no truth"):
        read_truth(write_input(tmp_path / "in.mcap", [0.0, 1.0], truth=False))


def test_a_latched_calibration_holds_and_plane_b_takes_its_own_exposure(tmp_path: Path) -> None:
    """Plane A: one calibration for all. Plane B, exposed half a period later: its own, not the pair's before."""
    matrices = projections()
    moved = {index: matrices["b"].shifted(-10.0 * index, 0.0) for index in range(3)}
    with RecordingWriter(tmp_path / "in.mcap") as writer:
        info, polygon = topics.camera_info_topic, topics.true_centreline_topic("a")
        a, b = info("a"), info("b")
        writer.write(a.recorded_name, a.type_name, encode_camera_info(matrices["a"], header_fields(0)), START_NS)
        for index, projection in moved.items():
            late = stamp(index) + PERIOD_NS // 2
            header = header_fields(stamp(index))
            drawn = encode_polygon([[0.0, 0.0], [1.0, 1.0]], header)
            writer.write(polygon.recorded_name, polygon.type_name, drawn, stamp(index))
            writer.write(b.recorded_name, b.type_name, encode_camera_info(projection, header_fields(late)), late)
    pairs = read_truth(tmp_path / "in.mcap").truth.pairs
    for index, pair in enumerate(pairs):
        np.testing.assert_allclose(pair.projections["a"].matrix, matrices["a"].matrix, atol=1e-6)
        np.testing.assert_allclose(pair.projections["b"].matrix, moved[index].matrix, atol=1e-6)


def test_state_and_reference_in_force_are_each_poses_own(tmp_path: Path) -> None:
    path = write_result(tmp_path / "out.mcap", [0.0, 2.0, None, 4.0], ["TRACKING", "DEGRADED", "LOST", "TRACKING"])
    estimates = read_estimates(path)
    assert [estimate.state for estimate in estimates] == ["TRACKING", "DEGRADED", "LOST", "TRACKING"]
    assert {estimate.reference_ns for estimate in estimates} == {stamp(0)}
    assert [estimate.motion_raw is None for estimate in estimates] == [False, False, True, False]
    assert [estimate.loop is None for estimate in estimates] == [False, False, True, False]
    np.testing.assert_allclose(estimates[3].motion, shift(4.0), atol=1e-12)
    np.testing.assert_allclose(np.diag(estimates[1].covariance), [0.25e-6] * 3 + [1e-6] * 3)


def test_a_loss_between_the_pairs_is_none_of_them(tmp_path: Path) -> None:
    """As a live tracker says it when no image comes any more."""
    path, header = tmp_path / "live.mcap", header_fields(stamp(0), "patient_table")
    with RecordingWriter(path, "none") as writer:
        for state, name, fields, at in (
            ("TRACKING", topics.CATHETER, encode_line_strip(loop(), header, "catheter"), stamp(0)),
            ("LOST", topics.CATHETER, encode_delete(header_fields(0, "patient_table"), "catheter"), stamp(9)),
        ):
            writer.write("/state", topics.STATE.type_name, {"data": state}, at)
            writer.write(name.recorded_name, name.type_name, fields, at)
    assert [(estimate.stamp_ns, estimate.state) for estimate in read_estimates(path)] == [(stamp(0), "TRACKING")]


@pytest.mark.parametrize("topic", [topics.MOTION, topics.MOTION_WITH_COVARIANCE])
def test_another_trackers_poses_are_scored_without_motion_raw(topic: topics.Topic, tmp_path: Path) -> None:
    header = header_fields(stamp(1), "patient_table")
    fields = encode_pose_stamped(shift(3.0), header)
    if topic is topics.MOTION_WITH_COVARIANCE:
        fields = encode_pose_with_covariance_stamped(shift(3.0), 1e-6 * np.eye(6), header)
    with RecordingWriter(tmp_path / "foreign.mcap") as writer:
        writer.write(topic.recorded_name, topic.type_name, fields, stamp(1))
    (estimate,) = read_estimates(tmp_path / "foreign.mcap")
    np.testing.assert_allclose(estimate.motion_raw, shift(3.0), atol=1e-12)
    np.testing.assert_allclose(estimate.motion, shift(3.0), atol=1e-12)
    assert (estimate.covariance is None) == (topic is topics.MOTION)


def test_an_input_is_no_result(tmp_path: Path) -> None:
    with pytest.raises(RecordingError, match="not a result of the tracker"):
        read_estimates(write_input(tmp_path / "in.mcap", [0.0]))
