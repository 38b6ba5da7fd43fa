"""Coughs, pauses, sighs, shifts and slides: sizes, times, and that everything else goes on as before."""

import numpy as np
import pytest

from lasso_motion_ros.phantom.lab_settings import Incident
from lasso_motion_ros.phantom.motion import Breathing
from lasso_motion_ros.phantom.motion_incidents import (
    DisturbedBreathing,
    patient_pose,
    ring_growth,
    ring_slide,
    withdrawn_share,
)
from lasso_motion_ros.phantom.settings import BreathingSettings

REGULAR = BreathingSettings(amplitude_mm=12.0, period_s=4.0, direction=(0.0, 0.0, -1.0))
IRREGULAR = BreathingSettings(amplitude_mm=15.0, period_s=3.5, irregularity=0.3, hysteresis_mm=2.0)


def disturbed(*incidents: Incident, settings: BreathingSettings = REGULAR) -> DisturbedBreathing:
    return DisturbedBreathing(settings, np.random.default_rng(3), 60.0, incidents)


def heights_mm(breathing: Breathing, times: np.ndarray) -> np.ndarray:
    return 1e3 * np.array([breathing.displacement(float(time))[2] for time in times])


def test_without_incidents_it_is_plain_breathing() -> None:
    plain = Breathing(IRREGULAR, np.random.default_rng(3), 60.0)
    for time_s in np.arange(0.0, 40.0, 0.37):
        assert np.array_equal(disturbed(settings=IRREGULAR).displacement(time_s), plain.displacement(time_s))
        assert disturbed(settings=IRREGULAR).depth(time_s) == plain.depth(time_s)


def test_a_cough_pushes_out_and_is_back_within_a_second() -> None:
    cough = disturbed(Incident("cough", 8.0, 0.9, amount=10.0))
    plain = disturbed()
    times = np.arange(7.0, 10.0, 0.01)
    push = heights_mm(cough, times) - heights_mm(plain, times)
    # Against the direction of inspiration: up.
    assert push.max() == pytest.approx(10.0, abs=0.02)
    assert times[np.argmax(push)] == pytest.approx(8.45, abs=0.011)
    assert np.all(push[(times < 8.0) | (times > 8.9)] == 0.0)
    # At a quarter of its length it is half out: sin²(π/4).
    assert heights_mm(cough, np.array([8.225]))[0] - heights_mm(plain, np.array([8.225]))[0] == pytest.approx(5.0)


def test_an_apnoea_waits_for_the_next_end_expiration_and_breathing_goes_on_where_it_stopped() -> None:
    paused, plain = disturbed(Incident("apnoea", 5.0, 10.0)), disturbed()
    # Breaths of 4 s: the next end-expiration is at 8 s.
    assert heights_mm(paused, np.arange(8.0, 18.0, 0.5)) == pytest.approx(np.zeros(20), abs=1e-9)
    assert heights_mm(paused, np.arange(0.0, 8.0, 0.1)) == pytest.approx(heights_mm(plain, np.arange(0.0, 8.0, 0.1)))
    later = np.arange(18.0, 26.0, 0.1)
    assert heights_mm(paused, later) == pytest.approx(heights_mm(plain, later - 10.0))


def test_a_breath_is_held_at_full_inspiration() -> None:
    held = disturbed(Incident("breath_hold", 5.0, 3.0))
    assert heights_mm(held, np.arange(6.0, 9.0, 0.25)) == pytest.approx(-12.0 * np.ones(12))
    assert heights_mm(held, np.array([11.0]))[0] == pytest.approx(0.0, abs=1e-9)


def test_a_sigh_is_the_next_whole_breath() -> None:
    sigh = disturbed(Incident("sigh", 5.0, amount=29.0))
    heights = heights_mm(sigh, np.arange(0.0, 20.0, 0.02))
    assert heights.min() == pytest.approx(-29.0, abs=1e-6)
    assert heights_mm(sigh, np.array([2.0, 6.0, 10.0, 14.0])) == pytest.approx([-12.0, -12.0, -29.0, -12.0])


def test_a_sigh_after_an_apnoea_counts_from_the_end_of_the_pause() -> None:
    both = disturbed(Incident("sigh", 19.0, amount=26.0), Incident("apnoea", 5.0, 10.0))
    # The pause lasts from 8 to 18 s; the breath that begins then is on its way, the sigh is the one from 22 s on.
    assert heights_mm(both, np.array([20.0, 24.0, 28.0])) == pytest.approx([-12.0, -26.0, -12.0])


def test_jet_ventilation_is_small_and_fast() -> None:
    jet = disturbed(settings=BreathingSettings(amplitude_mm=2.0, period_s=0.25, direction=(0.0, 0.0, -1.0)))
    heights = heights_mm(jet, np.arange(0.0, 2.0, 0.005))
    assert np.ptp(heights) == pytest.approx(2.0, abs=0.01)
    falling = np.count_nonzero((heights[1:-1] < heights[:-2]) & (heights[1:-1] <= heights[2:]))
    assert falling == 8  # 4 Hz


def test_a_slide_has_its_rate_and_direction() -> None:
    out = np.array([0.0, 1.0, 0.0])
    slide = [Incident("slide", 3.0, 0.0, amount=0.5)]
    assert ring_slide(slide, out, 3.0) == pytest.approx(np.zeros(3))
    assert ring_slide(slide, out, 7.0) == pytest.approx([0.0, 2.0e-3, 0.0])
    assert ring_slide(slide, out, 23.0) == pytest.approx([0.0, 10.0e-3, 0.0])
    aside = [Incident("slide", 3.0, 2.0, amount=1.0, direction=(2.0, 0.0, 0.0))]
    assert ring_slide(aside, out, 30.0) == pytest.approx([2.0e-3, 0.0, 0.0])


def test_a_patient_shifts_and_stays() -> None:
    shift = [Incident("shift", 4.0, 0.5, amount=10.0, direction=(3.0, 0.0, 4.0))]
    assert patient_pose(shift, 4.0) == pytest.approx(np.eye(4))
    assert patient_pose(shift, 4.25)[:3, 3] == pytest.approx([3.0e-3, 0.0, 4.0e-3])
    for time_s in (4.5, 60.0):
        assert patient_pose(shift, time_s)[:3, 3] == pytest.approx([6.0e-3, 0.0, 8.0e-3])


def test_withdrawal_and_growth_arrive() -> None:
    incidents = [Incident("withdraw", 2.0, 1.0), Incident("resize", 1.0, 2.0, amount=0.8)]
    assert [withdrawn_share(incidents, time_s) for time_s in (2.0, 2.5, 3.0, 9.0)] == pytest.approx([0, 0.5, 1, 1])
    assert [ring_growth(incidents, time_s) for time_s in (1.0, 2.0, 3.0)] == pytest.approx([1.0, 0.9, 0.8])
