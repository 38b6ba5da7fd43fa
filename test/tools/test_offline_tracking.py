"""The summary of offline tracking says what the images show of the catheter."""

from __future__ import annotations

import dataclasses

from support.message_inputs import FakeTracker

from lasso_motion_ros.config.stream import StreamConfig
from lasso_motion_ros.stream.pipeline import TrackingPipeline
from lasso_motion_ros.tools.offline_tracking import TrackSummary, counts, describe


@dataclasses.dataclass(frozen=True)
class Told:
    text: str


def test_the_catheter_stands_in_the_line_and_among_the_counts() -> None:
    plain = TrackingPipeline(StreamConfig(), FakeTracker()).statistics()
    told = dataclasses.replace(plain, catheter=Told("unknown, 10 poles, 6.1 mm apart, 19 mm across"))
    assert describe(told).endswith("; catheter: unknown, 10 poles, 6.1 mm apart, 19 mm across")
    assert counts(TrackSummary(told, {}, None))["catheter"] == told.catheter.text
    assert "catheter" not in describe(plain)
    assert counts(TrackSummary(plain, {}, None))["catheter"] is None
