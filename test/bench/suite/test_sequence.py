"""A phantom sequence is rendered, tracked and scored as evaluation scores."""

import dataclasses

from support.suite_inputs import eventful

from lasso_motion_ros.bench.suite.sequence import run_sequence
from lasso_motion_ros.bench.suite.suite_measures import measures, sequence_counts
from lasso_motion_ros.config.tracker import TrackerConfig
from lasso_motion_ros.stream.tracker_factory import create_tracker


def test_a_rendered_sequence_is_tracked_and_scored() -> None:
    sequence = eventful()
    assert sequence.pairs[2].b is None
    assert sequence.pairs[2].a is not None
    found = run_sequence(sequence, create_tracker(TrackerConfig()))
    assert found.refused == ""
    assert found.halves == {2}
    assert [one.hidden for one in found.scores] == [False, False, False, True]
    assert found.scores[1].centre_error_mm is not None
    assert found.scores[1].centre_error_mm < 0.5
    assert not found.scores[3].has_pose


def test_a_refused_seed_is_told_and_every_pair_is_missing() -> None:
    sequence = eventful()
    seed = dataclasses.replace(sequence.seed, points_a=sequence.seed.points_a[:3])
    found = run_sequence(dataclasses.replace(sequence, seed=seed), create_tracker(TrackerConfig()))
    assert "clicks" in found.refused
    assert measures(found.scores).missing == 2
    assert sequence_counts([found])["refused"] == 1
