"""The rule that says which B belongs to which A, and that all who need it apply the same one."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from lasso_motion_ros.config.overlay import OverlayConfig
from lasso_motion_ros.config.stream import SyncConfig
from lasso_motion_ros.overlay.motion_history import MotionHistory
from msg_adapters.sync.pairing import PairSynchroniser
from msg_adapters.sync.partner import FrameIntervals, PartnerRule

MS = 1_000_000


def test_without_a_known_offset_half_a_period_and_the_jitter_count() -> None:
    rule = PartnerRule(jitter_ns=5)
    assert rule.window_ns(100, 40) == (-5, 55)
    assert rule.window_ns(None, None) == (-5, 5)


def test_a_known_offset_reaches_four_tenths_of_the_shortest_interval() -> None:
    rule = PartnerRule(jitter_ns=5, offset_ns=30)
    assert rule.window_ns(100, 50) == (10, 50)
    assert rule.window_ns(None, None) == (25, 35)


def test_what_is_not_configured_is_the_configuration_s_default() -> None:
    sync = SyncConfig()
    assert PartnerRule.from_seconds(sync.jitter_s, sync.plane_b_offset_s) == PartnerRule()
    assert PartnerRule.from_seconds(0.002, 0.0) == PartnerRule(2 * MS, 0)


def test_intervals_outlive_lost_frames_pauses_and_new_runs() -> None:
    intervals = FrameIntervals()
    assert (intervals.last_ns, intervals.period_ns, intervals.shortest_ns) == (None, None, None)
    for stamp_ms in (0, 67, 134, 134, 100, 268, 335):  # a repeated stamp, one that is late, one lost frame
        intervals.add(stamp_ms * MS)
    assert (intervals.last_ns, intervals.period_ns, intervals.shortest_ns) == (67 * MS, 67 * MS, 67 * MS)
    intervals.add(9_000 * MS)
    assert (intervals.last_ns, intervals.period_ns) == (1_000 * MS, 67 * MS)
    intervals.add(0)
    assert intervals.period_ns is None


@pytest.mark.parametrize("offset_s", [-1.0, 0.0, 0.1, 0.25])
@pytest.mark.parametrize("exposed_ms", range(0, 300, 4))
def test_the_overlay_draws_a_b_with_the_motion_of_the_pair_that_the_tracker_got(
    offset_s: float, exposed_ms: int
) -> None:
    """Pairs of A every 300 ms and B some time later; the tracker answers each of A's stamps."""
    sync = SyncConfig(plane_b_offset_s=offset_s)
    pairing: PairSynchroniser[int] = PairSynchroniser(PartnerRule.from_seconds(sync.jitter_s, offset_s))
    history = MotionHistory(dataclasses.replace(OverlayConfig(), sync=sync))
    history.add_state("TRACKING")
    count = 8
    frames = [("a", 300 * i) for i in range(count)] + [("b", 300 * i + exposed_ms) for i in range(count)]
    pairs = []
    for plane, stamp_ms in sorted(frames, key=lambda frame: frame[1]):
        pairs += pairing.add(plane, stamp_ms * MS, stamp_ms * MS)  # type: ignore[arg-type]
        history.add_image(plane, stamp_ms * MS)  # type: ignore[arg-type]
    for number in range(count):
        motion = np.eye(4)
        motion[0, 3] = number
        history.add_motion(300 * number * MS, motion)
    settled = [pair for pair in pairs if pair.b is not None][2:]
    assert settled
    for pair in settled:
        assert pair.b is not None
        assert history.answered("b", pair.b) is pair.is_whole
        if pair.is_whole:
            assert history.choose("b", pair.b).motion[0, 3] == pair.stamp_ns / (300 * MS)
