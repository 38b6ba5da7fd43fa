"""The lookout in its thread: a look that clicks overtake gives up."""

from __future__ import annotations

import threading
import time

import numpy as np
from support.breathing_lasso import pair

from lasso_motion_ros.config.stream import StreamConfig
from lasso_motion_ros.initialisation.ring_finder import PAIRS, Proposal
from lasso_motion_ros.nodes.automatic_initialisation import AutomaticInitialisation

PATIENCE_S = 120.0  # a look may take long on a busy machine


def test_a_look_that_clicks_overtake_gives_up() -> None:
    asked, proposed = list[float](), list[Proposal]()

    def is_wanted() -> bool:
        if threading.current_thread().name == "lookout":
            asked.append(time.monotonic())
        return True

    automatic = AutomaticInitialisation(
        StreamConfig(polarity="dark"), is_wanted, proposed.extend, proposed.extend, lambda _: None
    )
    try:
        for index in range(PAIRS):
            automatic.add(pair(index))
        until = time.monotonic() + PATIENCE_S
        while len(asked) < 5 and time.monotonic() < until:
            time.sleep(0.01)
        automatic.overtake()
        before = len(asked)
        time.sleep(max(1.0, 2.0 * max(np.diff(asked))))  # in which it would ask again
        assert len(asked) <= before + 1
        assert not proposed
    finally:
        automatic.stop(PATIENCE_S)
