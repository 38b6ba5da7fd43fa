"""A small part of `make soak`, and what counts as a leak."""

from __future__ import annotations

import os

import pytest

pytest.importorskip("rclpy", reason="needs ROS 2")

from lasso_motion_ros.bench.soak import Resources, SoakFigures, SoakSetting, resources, soak


def test_what_counts_as_a_leak() -> None:
    warm = Resources(100.0, 12, 30)
    assert SoakFigures(9, 9, warm, Resources(104.9, 12, 30)).leaks == []
    assert SoakFigures(9, 9, warm, Resources(90.0, 11, 29)).leaks == []
    assert SoakFigures(9, 9, warm, Resources(105.5, 13, 31)).leaks == [
        "memory grew by 5.5 MB",
        "threads grew from 12 to 13",
        "files grew from 30 to 31",
    ]


def test_resources_of_this_process() -> None:
    before = resources(os.getpid())
    reader, writer = os.pipe()
    after = resources(os.getpid())
    os.close(reader)
    os.close(writer)
    assert after.files == before.files + 2
    assert before.threads >= 1
    assert 1.0 < before.memory_mb < 10_000.0


@pytest.mark.ros
def test_a_few_hundred_pairs_leave_nothing_behind() -> None:
    figures = soak(SoakSetting(pairs=120, warm_pairs=80, rate=25.0))
    assert figures.leaks == []
    assert figures.answered == 121  # a lazy or forgetful tracker leaks nothing either
    assert figures.poses >= figures.answered - 1
