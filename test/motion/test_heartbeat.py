"""Phases of the heart by hand; missing, extra, late and repeated R peaks; the gate."""

from __future__ import annotations

import pytest

from lasso_motion_ros.core.errors import ConfigurationError
from lasso_motion_ros.motion.heartbeat import Beats, CardiacGate, HeartPhase, RPeaks

S = 1_000_000_000


def peaks(*times_s: float) -> RPeaks:
    found = RPeaks()
    for time_s in times_s:
        found.add(round(time_s * S))
    return found


def phase(found: RPeaks, time_s: float) -> float | None:
    at = found.phase(round(time_s * S))
    return None if at is None else round(at.at(round(time_s * S)), 6)


def test_phases_are_parts_of_the_typical_beat() -> None:
    regular = peaks(10.0, 10.8, 11.6, 12.4)
    assert phase(regular, 12.4) == 0.0
    assert phase(regular, 12.6) == 0.25
    assert phase(regular, 13.0) == 0.75
    assert phase(regular, 13.4) == 1.25, "the next peak is overdue"
    assert phase(regular, 12.0) == 0.5, "of the beat that was running then"
    at = regular.phase(13 * S)
    assert at is not None
    assert at.frequency_hz == pytest.approx(1.25)


def test_the_typical_beat_is_a_median() -> None:
    # Intervals 0.8, 0.9, 1.0, 0.9, 1.2: the median is 0.9.
    assert phase(peaks(0.0, 0.8, 1.7, 2.7, 3.6, 4.8), 4.8 + 0.45) == 0.5


def test_the_phase_is_unknown_before_a_beat_is_complete_and_long_after_the_last() -> None:
    assert phase(peaks(), 1.0) is None
    assert phase(peaks(10.0), 10.1) is None
    assert phase(peaks(10.0, 11.0), 10.5) is None, "causal: the second peak was not known then"
    assert phase(peaks(10.0, 11.0), 13.4) == 2.4
    assert phase(peaks(10.0, 11.0), 13.6) is None


def test_a_missing_peak_changes_no_phase_after_it() -> None:
    complete, without = peaks(0, 1, 2, 3, 4, 5, 6), peaks(0, 1, 2, 4, 5, 6)
    assert phase(without, 6.3) == phase(complete, 6.3) == 0.3
    # Intervals 0.9, 1.0, 1.1 and 2.0: the last is no beat, and 1.0 is the median of the others.
    assert phase(peaks(0.0, 0.9, 1.9, 3.0, 5.0), 5.3) == 0.3


def test_an_extra_peak_is_doubted_until_the_next() -> None:
    with_t_wave = peaks(0, 1, 2, 3, 3.35)
    at = with_t_wave.phase(round(3.6 * S))
    assert at is not None
    assert (at.peak_ns, at.doubtful) == (3 * S, True)
    with_t_wave.add(4 * S)
    after = with_t_wave.phase(round(4.6 * S))
    assert after == HeartPhase(4 * S, S, doubtful=False)


def test_a_heart_that_has_become_faster_is_followed() -> None:
    faster = peaks(*range(13), *(12 + 0.5 * k for k in range(1, 9)))
    assert phase(faster, 16.25) == 0.5


def test_late_and_repeated_peaks_give_the_same_phases() -> None:
    in_order, late = peaks(0, 1, 2, 3), peaks(0, 1, 3, 2, 3, 3.01)
    assert phase(late, 2.5) == phase(in_order, 2.5) == 0.5
    assert late.phase(round(3.25 * S)) == in_order.phase(round(3.25 * S)) == HeartPhase(3 * S, S)


def test_peaks_that_go_back_are_a_new_run() -> None:
    again = peaks(100, 101, 102, 5, 6)
    assert phase(again, 6.5) == 0.5
    assert phase(again, 102.5) is None


def test_a_new_run_of_images_forgets_the_peaks_of_the_last_but_not_its_own() -> None:
    last = peaks(100, 101, 102)
    last.begin_run(5 * S)
    assert phase(last, 102.5) is None
    own = peaks(100, 101, 102, 4.2)
    own.begin_run(5 * S)
    own.add(round(5.2 * S))
    assert phase(own, 5.45) == 0.25


def gate_open(gate: CardiacGate, part: float, doubtful: bool = False) -> bool:
    return gate.is_open(HeartPhase(0, S, doubtful), round(part * S))


def test_the_gate_opens_at_its_start_and_closes_at_its_end() -> None:
    gate = CardiacGate(0.45, 0.8)
    assert [gate_open(gate, part) for part in (0.0, 0.44, 0.45, 0.6, 0.79, 0.8, 0.99)] == [
        False, False, True, True, True, False, False,
    ]  # fmt: skip


def test_a_window_over_the_r_peak() -> None:
    gate = CardiacGate(0.9, 0.1)
    assert [gate_open(gate, part) for part in (0.0, 0.09, 0.1, 0.5, 0.89, 0.9, 0.99)] == [
        True, True, False, False, False, True, True,
    ]  # fmt: skip


def test_the_gate_is_shut_where_the_phase_is_not_sure() -> None:
    gate = CardiacGate(0.45, 0.8)
    assert not gate.is_open(None, 0)
    assert not gate_open(gate, 0.6, doubtful=True)
    assert not gate_open(gate, 1.6), "a peak is missing: nobody knows where the beat is"
    assert not gate_open(gate, -0.4)
    assert not gate_open(CardiacGate(0.9, 0.1), 1.05)
    assert not gate_open(CardiacGate(0.9, 0.1), -0.05)


def test_a_window_without_width_is_refused() -> None:
    with pytest.raises(ConfigurationError, match=r"window_start and window_end must differ, both are 0\.5"):
        CardiacGate(0.5, 0.5)


def beats(*times_s: float) -> Beats:
    found = Beats.of(times_s)
    assert found is not None
    return found


def test_what_has_been_is_a_part_of_its_own_beat_and_what_goes_on_of_a_typical_one() -> None:
    found = beats(10.0, 10.8, 11.8, 12.6)  # 0.8, 1.0 and 0.8
    assert found.beat_s == pytest.approx(0.8)
    assert found.phase(10.8) == 0.0
    assert found.phase(11.3) == pytest.approx(0.5), "of the longer beat"
    assert found.phase(12.8) == pytest.approx(0.25), "how long it will be is not known yet"


def test_a_heart_whose_next_peak_is_overdue_rests_till_it_comes() -> None:
    found = beats(10.0, 10.8, 11.6, 13.2)  # a pause, or a peak that was missed
    assert found.phase(12.0) == pytest.approx(0.5)
    assert found.phase(12.9) == 1.0
    assert found.phase(14.5) == 1.0


def test_peaks_too_close_to_another_are_no_beats_and_one_peak_tells_of_none() -> None:
    assert beats(10.0, 10.8, 11.6, 11.7, 12.4).peaks_s == (10.0, 10.8, 11.6, 12.4)
    assert Beats.of([]) is None
    assert Beats.of([10.0]) is None
    assert Beats.of([10.0, 10.0, 10.0]) is None


def test_before_the_first_peak_and_where_the_next_is_overdue_no_phase_is_known() -> None:
    found = beats(10.0, 10.8, 11.6, 13.2, 14.0)  # with a pause, or a peak that was missed
    assert found.is_known(10.0)
    assert not found.is_known(9.9)
    assert found.is_known(11.6 + 1.4 * 0.8)
    assert not found.is_known(11.6 + 1.5 * 0.8)
    assert found.is_known(13.3)
    assert found.is_known(14.0 + 1.4 * 0.8)
    assert not found.is_known(14.0 + 1.5 * 0.8)


def test_all_peaks_that_are_remembered_are_told() -> None:
    assert peaks(10.0, 11.6, 10.8).stamps_ns == (10 * S, round(10.8 * S), round(11.6 * S))
