"""The heart's phase at a pair is the one known when the pair was complete."""

from __future__ import annotations

from lasso_motion_ros.stream.heart_phases import HeartPhases

S = 1_000_000_000


def beating(peaks_s: list[float], remembered: int = 10) -> HeartPhases:
    phases = HeartPhases(remembered)
    for peak_s in peaks_s:
        phases.add_r_peak(round(peak_s * S))
    return phases


def test_a_peak_that_comes_later_changes_no_phase() -> None:
    phases = beating([0.0, 1.0])
    phases.add_pair(round(1.6 * S), new_run=False)
    known = phases.at(round(1.6 * S))
    assert known is not None
    phases.add_r_peak(round(1.5 * S))
    assert phases.at(round(1.6 * S)) is known
    assert phases.peaks_received == 3


def test_a_pair_without_peaks_is_remembered_without_a_phase() -> None:
    phases = beating([])
    phases.add_pair(5 * S, new_run=False)
    assert phases.at(5 * S) is None
    assert phases.is_remembered(5 * S)
    assert not phases.is_remembered(6 * S)


def test_only_the_last_pairs_are_remembered() -> None:
    phases = beating([0.0, 1.0], remembered=3)
    for number in range(5):
        phases.add_pair(number, new_run=False)
    assert [phases.is_remembered(number) for number in range(5)] == [False, False, True, True, True]


def test_peaks_of_the_run_before_say_nothing() -> None:
    phases = beating([100.0, 101.0])
    phases.add_pair(round(1.5 * S), new_run=True)
    assert phases.at(round(1.5 * S)) is None
