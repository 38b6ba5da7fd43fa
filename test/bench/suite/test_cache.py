"""What was rendered once is read back, to the last bit."""

import dataclasses
from pathlib import Path

import numpy as np
import pytest
from support.suite_inputs import EVENTFUL, eventful

from lasso_motion_ros.bench.suite.cache import SequenceCache
from lasso_motion_ros.bench.suite.sequence import RenderedSequence, run_sequence
from lasso_motion_ros.config.tracker import TrackerConfig
from lasso_motion_ros.core.errors import RecordingError
from lasso_motion_ros.geometry.frames import Frame, FramePair
from lasso_motion_ros.geometry.projection import Projection
from lasso_motion_ros.phantom.settings import Scenario
from lasso_motion_ros.stream.tracker_factory import create_tracker


@pytest.mark.slow
def test_what_was_rendered_is_read_back_to_the_last_bit(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    rendered = []

    def render(scenario: Scenario) -> RenderedSequence:
        rendered.append(scenario)
        return eventful()

    monkeypatch.setattr("lasso_motion_ros.bench.suite.cache.render_sequence", render)
    first = SequenceCache(tmp_path).sequence(EVENTFUL)
    second = SequenceCache(tmp_path).sequence(EVENTFUL)
    assert len(rendered) == 1
    fresh = eventful()
    for one in (first, second):
        assert one.pairs[2].b is None
        np.testing.assert_array_equal(one.seed.points_b, fresh.seed.points_b)
        for index, (here, there) in enumerate(zip(one.pairs, fresh.pairs, strict=True)):
            assert here.stamp_ns == there.stamp_ns
            assert one.truth.pairs[index].centrelines.keys() == fresh.truth.pairs[index].centrelines.keys()
            np.testing.assert_array_equal(one.truth.pairs[index].motion, fresh.truth.pairs[index].motion)
            if there.a is not None:
                np.testing.assert_array_equal(here.a.pixels, there.a.pixels)
                np.testing.assert_allclose(here.a.projection.matrix, there.a.projection.matrix, rtol=1e-15)
    scores = [run_sequence(one, create_tracker(TrackerConfig())).scores for one in (first, second)]
    assert [one.centre_error_mm for one in scores[0]] == [one.centre_error_mm for one in scores[1]]
    other = dataclasses.replace(EVENTFUL, seed=2)
    SequenceCache(tmp_path).sequence(other)
    assert len(rendered) == 2
    for path in tmp_path.iterdir():
        path.write_bytes(b"cut")
    with pytest.raises(RecordingError, match="not a rendered sequence"):
        SequenceCache(tmp_path).sequence(EVENTFUL)


def test_with_a_cache_and_without_one_sees_the_same_matrices(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    random = np.random.default_rng(1)
    drawn = (Projection(random.normal(size=(3, 4)), 8, 8) for _ in range(1000))
    # One that is another in its last bit when it is normalised once more.
    odd = next(one for one in drawn if not np.array_equal(Projection(one.matrix, 8, 8).matrix, one.matrix))
    frame = Frame(0, np.zeros((8, 8), np.uint8), odd)
    sequence = dataclasses.replace(
        eventful(),
        pairs=(FramePair(0, frame, None),),
        truth=dataclasses.replace(eventful().truth, pairs=eventful().truth.pairs[:1]),
    )
    monkeypatch.setattr("lasso_motion_ros.bench.suite.cache.render_sequence", lambda scenario: sequence)
    seen = [
        cache.sequence(EVENTFUL) for cache in (SequenceCache(None), SequenceCache(tmp_path), SequenceCache(tmp_path))
    ]
    matrices = [one.pairs[0].a.projection.matrix.tobytes() for one in seen]
    assert len(set(matrices)) == 1
