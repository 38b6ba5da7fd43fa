"""`lasso-motion bench --scaling`: how the cost of a pair grows with the searched region and the model's points."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial

from lasso_motion_ros.bench.stage_times import TrackerFactory, measure, stages_ms
from lasso_motion_ros.config.parameters import Value, configuration_from_values, configuration_values
from lasso_motion_ros.config.stream import StreamConfig
from lasso_motion_ros.ring.ring_options import RingOptions
from lasso_motion_ros.ring.tracker import RingTracker
from lasso_motion_ros.stream.tracker_factory import create_tracker
from msg_adapters.recordings.reader import RawMessage

MODEL_POINTS = (60, 120, 240, 480)
ROI_PX = (200, 400, 600, 800, 1024)
NEAR_MM = (6.0, 12.0, 25.0, 50.0, 100.0)


@dataclass(frozen=True)
class Cost:
    """What a pair costs at one size, in processor time: other programs do not count.

    Attributes:
        varied: what was varied, with its unit.
        value: its value.
        pair_ms: a pair, from its messages to its answers.
        tracking_ms: of that, tracking.
        stages_ms: of that, its parts.
    """

    varied: str
    value: float
    pair_ms: float
    tracking_ms: float
    stages_ms: dict[str, float]


def measure_scaling(config: StreamConfig, messages: Sequence[RawMessage], pairs: int) -> list[Cost]:
    """Track so many pairs at every size.

    Args:
        config: the tracker's parameters; what is varied depends on its method.
        messages: undecoded inputs of a recording, in order.
        pairs: how many pairs to track at each size.

    Raises:
        RecordingError: not one pair of the recording is tracked.
    """
    costs = []
    if config.method == "brost2009":
        for side in ROI_PX:
            costs.append(
                _cost("side of the ROI (px of 1024)", side, _with(config, "features.roi_px", side), messages, pairs)
            )
        for points in MODEL_POINTS:
            costs.append(_cost("points of the model", points, _with(config, "model.points", points), messages, pairs))
        return costs
    for reach in NEAR_MM:
        costs.append(
            _cost("looked about the prediction (mm)", reach, _with(config, "search.near_mm", reach), messages, pairs)
        )
    for points in MODEL_POINTS:
        # No user has a reason to change it: it is no parameter.
        make_tracker = partial(RingTracker, options=RingOptions(points=points))
        costs.append(_cost("points of the model", points, config, messages, pairs, make_tracker))
    return costs


def format_scaling(costs: Sequence[Cost]) -> str:
    """The costs as text."""
    lines = []
    varied = ""
    for cost in costs:
        names = list(cost.stages_ms)
        if cost.varied != varied:
            varied = cost.varied
            lines += ["", f"{varied:<34}{'a pair':>12}{'tracking':>12}" + "".join(f"{name:>16}" for name in names)]
        stages = "".join(f"{spent:13.2f} ms" for spent in cost.stages_ms.values())
        lines.append(f"{cost.value:<34g}{cost.pair_ms:9.2f} ms{cost.tracking_ms:9.2f} ms{stages}")
    return "\n".join(lines[1:])


def _with(config: StreamConfig, name: str, value: Value) -> StreamConfig:
    return configuration_from_values(StreamConfig, configuration_values(config) | {name: value})


def _cost(
    varied: str,
    value: float,
    config: StreamConfig,
    messages: Sequence[RawMessage],
    pairs: int,
    make_tracker: TrackerFactory = create_tracker,
) -> Cost:
    clock, _ = measure(config, messages, pairs, timer=time.process_time, make_tracker=make_tracker)
    stages = stages_ms(clock)
    inner = {name.strip(): spent for name, spent in stages.items() if name.startswith(" ")}
    return Cost(varied, value, 1e3 * clock.processor_s / len(clock.pair_s), stages["tracking"], inner)
