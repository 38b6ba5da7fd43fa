"""Latencies in words."""

from __future__ import annotations

from lasso_motion_ros.nodes.latency import REMEMBERED, Latencies


def test_percentiles_of_the_last_pairs() -> None:
    latencies = Latencies()
    assert latencies.words() == {}
    for number in range(101):
        latencies.add(1e-3 * number, 2.0)
    words = latencies.words()
    assert words["latency receipt to published p50, p95, p99 (ms)"] == "50.0, 95.0, 99.0"
    assert words["latency stamp to published p50, p95, p99 (ms)"] == "2000.0, 2000.0, 2000.0"
    assert words["latency of the last pair (ms)"] == "100.0"


def test_stamps_of_another_clock_tell_no_latency_and_memory_is_bounded() -> None:
    latencies = Latencies()
    for _ in range(2 * REMEMBERED):
        latencies.add(0.01, 4e7)
        latencies.add(0.01, -3.0)
    assert not any("stamp" in key for key in latencies.words())
    assert len(latencies.receipt_s) == REMEMBERED
