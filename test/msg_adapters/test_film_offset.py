"""How much later one film's stamps are, from what moves in both."""

from __future__ import annotations

import numpy as np
import pytest

from lasso_motion_ros.tools.recorded_examination import describe_offset
from msg_adapters.film_offset import FilmOffsetMeter

RATE_HZ = 15.0
NOISE = np.random.default_rng(4)


def depth(time_s: float) -> float:
    """Breathing and heartbeat, pixels."""
    return 9.0 * np.sin(2.0 * np.pi * time_s / 4.1) ** 4 + 2.0 * np.sin(2.0 * np.pi * 1.13 * time_s + 0.4) ** 8


def picture(shift: float, angle: float) -> np.ndarray:
    """A shadow that moves, in quanta."""
    y, x = np.mgrid[0:128, 0:128].astype(float)
    edge = (x - 64.0) * np.sin(angle) + (y - 64.0 - shift) * np.cos(angle)
    shadow = 120.0 + 60.0 * np.tanh(edge / 3.0)
    return np.clip(np.rint(NOISE.normal(shadow, 3.0)), 0, 255).astype(np.uint8)


@pytest.mark.parametrize("late_s", [0.2, 0.0, -0.467])
def test_the_later_plane_is_found(late_s: float) -> None:
    meter = FilmOffsetMeter()
    for number in range(180):
        time_s = number / RATE_HZ
        meter.add("a", round(1e9 * time_s), picture(depth(time_s), 0.1))
        at_ns = round(1e9 * (time_s + 0.5 / RATE_HZ + late_s))
        shown = picture(depth(time_s + 0.5 / RATE_HZ), 0.7)
        meter.add("b", at_ns, shown)
        meter.add("b", at_ns + 20_000_000, shown)  # shown twice, as by a grabber
    found = meter.estimate()
    assert found is not None
    assert found.seconds == pytest.approx(late_s, abs=0.5 / RATE_HZ)


def test_pictures_in_which_nothing_moves_do_not_tell() -> None:
    meter = FilmOffsetMeter()
    for number in range(60):
        for plane in ("a", "b"):
            meter.add(plane, round(1e9 * number / RATE_HZ), picture(0.0, 0.2))
    assert meter.estimate() is None
    assert FilmOffsetMeter().estimate() is None


@pytest.mark.parametrize(
    ("found", "said"),
    [
        (None, "the pictures do not tell"),
        ({"seconds": 0.02, "correlation": 0.9, "frame_s": 0.066}, "the stamps of both planes agree"),
        ({"seconds": 0.2, "correlation": 0.9, "frame_s": 0.066}, "set plane_b.stamp_offset_s to 0.200"),
        ({"seconds": -0.2, "correlation": 0.9, "frame_s": 0.066}, "set plane_a.stamp_offset_s to 0.200"),
    ],
)
def test_what_to_do_is_said(found: dict[str, float] | None, said: str) -> None:
    assert said in describe_offset({"film_offset": found})


@pytest.mark.parametrize(
    "times_ns", [[0] * 20, [10**9 * (i // 4) for i in range(20)], [10**9 * (20 - i) for i in range(20)]]
)
def test_stamps_that_are_none_or_go_back_give_no_offset(times_ns):
    meter, random = FilmOffsetMeter(), np.random.default_rng(3)
    for time_ns in times_ns:
        for plane in "ab":
            meter.add(plane, time_ns, random.integers(0, 255, (80, 80), dtype=np.uint8))
    assert meter.estimate() is None
