"""What the tracker node says on /diagnostics of the heartbeat, and of a filter over time in the images."""

from __future__ import annotations

import dataclasses
from typing import Any

import pytest
from support.message_inputs import FakeTracker

from lasso_motion_ros.config.parameters import configuration_from_values
from lasso_motion_ros.config.stream import StreamConfig
from lasso_motion_ros.nodes.diagnostics import OK, WARN, heartbeat_status, tracker_status
from lasso_motion_ros.stream.heartbeat_separation import HeartbeatStatus
from lasso_motion_ros.stream.outputs import PipelineStatistics
from lasso_motion_ros.stream.pipeline import TrackingPipeline
from lasso_motion_ros.tracking.tracker import TrackerState


def statistics(**values: Any) -> PipelineStatistics:
    return TrackingPipeline(configuration_from_values(StreamConfig, values), FakeTracker()).statistics()


def test_nothing_is_said_of_a_heartbeat_that_is_left_in() -> None:
    assert heartbeat_status("/lasso_tracker", statistics()) == []


@pytest.mark.parametrize(("works", "level"), [(True, OK), (False, WARN)])
def test_a_heartbeat_that_cannot_be_told_is_a_warning_with_its_reason(works: bool, level: bytes) -> None:
    told = HeartbeatStatus(works, "2.0 pairs/s are too few", {"R peaks": "3"})
    (status,) = heartbeat_status("/lasso_tracker", dataclasses.replace(statistics(), heartbeat=told))
    assert status["name"] == "/lasso_tracker: heartbeat"
    assert status["level"] == level
    assert status["message"] == "2.0 pairs/s are too few"
    assert status["values"] == [{"key": "R peaks", "value": "3"}]


def test_a_filter_over_time_is_told_of_the_plane_that_has_it() -> None:
    told = dataclasses.replace(statistics(), temporal_filter={"a": 0.3456})
    values = tracker_status("/lasso_tracker", TrackerState.TRACKING, told)["values"]
    assert [one for one in values if "temporal" in one["key"]] == [{"key": "temporal filter, plane A", "value": "0.35"}]


def test_what_the_images_show_of_the_catheter_is_told_in_one_line() -> None:
    @dataclasses.dataclass(frozen=True)
    class Told:
        known: str | None

    told = dataclasses.replace(statistics(), catheter=Told(None))
    values = tracker_status("/lasso_tracker", TrackerState.TRACKING, told)["values"]
    assert {"key": "catheter", "value": "being looked at"} in values
    told = dataclasses.replace(statistics(), catheter=Told("like achieve_20, 8 poles, 7.2 mm apart, 18 mm across"))
    values = tracker_status("/lasso_tracker", TrackerState.TRACKING, told)["values"]
    assert {"key": "catheter", "value": "like achieve_20, 8 poles, 7.2 mm apart, 18 mm across"} in values
    assert not [
        one for one in tracker_status("/x", TrackerState.LOST, statistics())["values"] if one["key"] == "catheter"
    ]
