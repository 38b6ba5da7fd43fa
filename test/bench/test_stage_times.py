"""Stages of a pair: what each takes by itself, and that the parts add up."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from lasso_motion_ros.bench.stage_times import Clock, stages_ms


def test_a_stage_inside_another_is_not_counted_twice_by_hand() -> None:
    ticks: Iterator[float] = iter([0.0, 1.0, 3.0, 4.0, 5.0, 7.0, 9.0, 12.0])
    clock = Clock(timer=lambda: next(ticks))
    with clock("tracking"), clock("detection"):  # from 0 and 1 on
        with clock("search"):  # 3 to 4
            pass
        with clock("alignment"):  # 5 to 7
            pass
        # Detection ends at 9, tracking at 12.
    clock.keep(12.0, 0.0, 12.0)
    found = {name: spent / 1e3 for name, spent in stages_ms(clock).items()}
    expected = {"tracking": 12.0, "  search": 1.0, "  alignment": 2.0, "  detection": 5.0, "  all else": 4.0}
    assert found == pytest.approx(expected)


def test_a_stage_within_itself_counts_once() -> None:
    ticks = iter([0.0, 1.0, 3.0, 4.0, 5.0, 6.0])
    clock = Clock(timer=lambda: next(ticks))
    with clock("tracking"), clock("filter"), clock("filter"):
        pass
    clock.keep(6.0, 0.0, 6.0)
    assert stages_ms(clock)["  filter"] == pytest.approx(4e3)
