"""The dry run goes through everything that a tracked pair needs."""

from __future__ import annotations

import gc

import pytest

from lasso_motion_ros.config.stream import StreamConfig
from lasso_motion_ros.stream.warm_up import DRY_RUN, warm_up
from msg_adapters.recorded_messages import RecordedMessages
from msg_adapters.topics import MOTION, STATE


@pytest.mark.parametrize("method", ["appearance", "brost2009"])
def test_every_pair_is_tracked(method: str) -> None:
    try:
        outputs = warm_up(StreamConfig(method=method), RecordedMessages())
    finally:
        gc.unfreeze()
    assert [output.topic for output in outputs].count(MOTION) == DRY_RUN.pairs
    assert {output.fields["data"] for output in outputs if output.topic is STATE} <= {
        "WAITING_FOR_SEED",
        "TRACKING",
        "DEGRADED",
    }
