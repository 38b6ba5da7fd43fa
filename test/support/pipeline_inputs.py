"""A pipeline with a tracker that only counts, messages put into it, and what comes out in short."""

from __future__ import annotations

from typing import Any

from support.message_inputs import FakeTracker

from lasso_motion_ros.config.parameters import configuration_from_values
from lasso_motion_ros.config.stream import StreamConfig
from lasso_motion_ros.geometry.frames import Plane
from lasso_motion_ros.stream.outputs import Output
from lasso_motion_ros.stream.pair_task import PairTask
from lasso_motion_ros.stream.pipeline import TrackingPipeline
from msg_adapters.messages import stamp_to_ns
from msg_adapters.poses import decode_pose
from msg_adapters.recorded_messages import jazzy_types


def pipeline(tracker: FakeTracker | None = None, **values: Any) -> TrackingPipeline:
    config = configuration_from_values(StreamConfig, values)
    return TrackingPipeline(config, tracker or FakeTracker())


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


def message(output: Output) -> Any:
    """What is read from the bytes that are published."""
    return jazzy_types().deserialize_cdr(output.data, output.topic.type_name)


def names(outputs: list[Output]) -> list[str]:
    return [output.topic.name for output in outputs]


def poses(outputs: list[Output]) -> dict[int, float]:
    """x of each `motion`, mm, by stamp."""
    found = [message(output) for output in outputs if output.topic.name == "motion"]
    return {stamp_to_ns(m.header.stamp): round(1e3 * float(decode_pose(m)[0, 3]), 6) for m in found}


def states(outputs: list[Output]) -> list[str]:
    return [message(output).data for output in outputs if output.topic.name == "state"]
