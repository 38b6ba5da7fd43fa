"""A pipeline with a tracker that only counts, messages put into it, and what comes out in short."""

from __future__ import annotations

from typing import Any

from support.message_inputs import MESSAGES, FakeTracker

from lasso_motion_ros.config.parameters import configuration_from_values
from lasso_motion_ros.config.stream import StreamConfig
from lasso_motion_ros.geometry.frames import Plane
from lasso_motion_ros.stream.outputs import Output
from lasso_motion_ros.stream.pair_task import PairTask
from lasso_motion_ros.stream.pipeline import TrackingPipeline
from msg_adapters.messages import stamp_to_ns
from msg_adapters.poses import decode_pose


def pipeline(tracker: FakeTracker | None = None, **values: Any) -> TrackingPipeline:
    config = configuration_from_values(StreamConfig, values)
    return TrackingPipeline(config, MESSAGES, tracker or FakeTracker())


def give(line: TrackingPipeline, topic: str, message: Any) -> list[PairTask]:
    plane: Plane = "a" if topic.startswith("/plane_a") else "b"
    add = {"image_raw": line.intake.add_image, "camera_info": line.intake.add_camera_info, "seed": line.intake.add_seed}
    return add[topic.rsplit("/", 1)[1]](plane, message)


def run(line: TrackingPipeline, messages: Any) -> list[Output]:
    outputs = []
    for topic, _, message, _ in messages:
        for task in give(line, topic, message):
            outputs += line.session.process(task)
    return outputs


def names(outputs: list[Output]) -> list[str]:
    return [output.topic.name for output in outputs]


def poses(outputs: list[Output]) -> dict[int, float]:
    """x of each `motion`, mm, by stamp."""
    found = [output.message for output in outputs if output.topic.name == "motion"]
    return {stamp_to_ns(m.header.stamp): round(1e3 * float(decode_pose(m)[0, 3]), 6) for m in found}


def states(outputs: list[Output]) -> list[str]:
    return [output.message.data for output in outputs if output.topic.name == "state"]
