"""Latencies in words."""

from __future__ import annotations

from lasso_motion_ros.nodes.latency import TUNING, Latencies


def test_percentiles_of_the_last_pairs() -> None:
    latencies = Latencies()
    assert latencies.words() == {}
    for number in range(101):
        latencies.begin(number, 5.0)
        latencies.end(number, 5.0 + 1e-3 * number, 2.0)
    words = latencies.words()
    assert words["latency receipt to published p50, p95, p99 (ms)"] == "50.0, 95.0, 99.0"
    assert words["latency stamp to published p50, p95, p99 (ms)"] == "2000.0, 2000.0, 2000.0"
    assert words["latency of the last pair (ms)"] == "100.0"


def test_several_pairs_wait_at_once_and_each_has_its_own_latency() -> None:
    latencies = Latencies()
    for number in range(3):
        latencies.begin(number, 0.1 * number)
    latencies.end(2, 0.5, 0.0)  # the two before it were dropped
    latencies.end(7, 9.0, 0.0)  # never begun
    assert latencies.words()["latency of the last pair (ms)"] == "300.0"
    assert list(latencies.receipt_s) == [0.5 - 0.1 * 2]


def test_stamps_of_another_clock_tell_no_latency_and_memory_is_bounded() -> None:
    latencies = Latencies()
    for number in range(4 * TUNING.remembered):
        latencies.begin(number, 0.0)
        if number % 2:  # every other pair is dropped
            latencies.end(number, 0.01, 4e7 if number % 4 == 1 else -3.0)
    assert not any("stamp" in key for key in latencies.words())
    assert len(latencies.receipt_s) == TUNING.remembered
    assert len(latencies._received_s) <= TUNING.remembered
