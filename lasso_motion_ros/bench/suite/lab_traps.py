"""Traps of the lab: each puts one fault that an earlier tracker had, in a lab, into a moderate sequence.

Whether a pose is due is told by the ring's own displacement in all of them (`Scenario.exact_place`).
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from lasso_motion_ros.bench.suite.moderate import altered
from lasso_motion_ros.bench.suite.scenario_changes import edge_on_normal, with_incidents
from lasso_motion_ros.bench.suite.vectors import as_vector, direction, unit
from lasso_motion_ros.phantom.lab_settings import Incident
from lasso_motion_ros.phantom.settings import CalibrationSettings, Event, Scenario

Array = npt.NDArray[np.float64]


def _in_lab(scenario: Scenario, **changes: object) -> Scenario:
    return altered(scenario, exact_place=True, **changes)


def _direction(scenario: Scenario) -> Array:
    return direction(np.random.default_rng(scenario.seed))


def tip_at_ring(scenario: Scenario, number: int) -> Scenario:
    """The tip touches the ring, works beside it, or comes and goes, from the seed pair on."""
    nearest, farthest = ((0.0, 2.0), (1.0, 5.0), (0.0, 15.0))[number % 3]
    work = {"works": True, "nearest_mm": nearest, "farthest_mm": farthest, "dwell_s": 1.5, "drag_mm_s": 1.0}
    return _in_lab(scenario, pairs=24, ablation_work=work, distractors={"ablation": True})


def tip_on_line(scenario: Scenario, number: int) -> Scenario:
    """Edge-on in one plane, where the tip's electrodes continue the ring's line."""
    normal = edge_on_normal(scenario, number % 2, (0.0, 3.0, -3.0)[number % 3])
    return tip_at_ring(altered(scenario, lasso={"normal": normal}), number)


def narrow(scenario: Scenario, number: int) -> Scenario:
    """A narrow ellipse in one plane, faint, with the tip beside it: it slips by its own width."""
    normal = edge_on_normal(scenario, number % 2, (10.0, -12.0, 14.0)[number % 3])
    faint = altered(scenario, lasso={"normal": normal, "contrast": 0.5})
    return tip_at_ring(faint, 1)


def cough_apnoea_sigh(scenario: Scenario, number: int) -> Scenario:
    """A cough of 10 mm, 10 s without breath, a sigh of 29 mm."""
    del number
    breathing = {"amplitude_mm": 11.0, "period_s": 3.6, "start": 0.0, "irregularity": 0.03, "drift_mm_per_min": 0.0}
    calm = _in_lab(scenario, pairs=52, rate_hz=2.0, breathing=breathing)
    incidents = (Incident("cough", 3.2, 0.9, 10.0), Incident("apnoea", 6.0, 10.0), Incident("sigh", 19.0, amount=29.0))
    return with_incidents(calm, *incidents)


def slide(scenario: Scenario, number: int) -> Scenario:
    """From 3 s on it slides out of the vein by 0.3 to 1 mm a second."""
    sliding = Incident("slide", 3.0, 0.0, amount=(0.55, 0.3, 1.0)[number % 3])
    return with_incidents(_in_lab(scenario, pairs=(34, 44, 26)[number % 3], rate_hz=2.0), sliding)


def withdraw(scenario: Scenario, number: int) -> Scenario:
    """Drawn into its sheath over 1 to 4 s."""
    return with_incidents(_in_lab(scenario, pairs=26), Incident("withdraw", 4.0, (2.0, 1.0, 4.0)[number % 3]))


def far_jump(scenario: Scenario, number: int) -> Scenario:
    """After a breath it is put 24 mm away, where it stays."""
    move = Event("move", 12, 12 + (0, 2, 4)[number % 3], shift_mm=as_vector(24.0 * _direction(scenario)))
    return _in_lab(scenario, pairs=32, breathing={"period_s": 3.0}, events=(move,))


def patient_shift(scenario: Scenario, number: int) -> Scenario:
    """The patient moves by 6 to 14 mm within half a second: the atrium is elsewhere, and it is no breath."""
    way = _direction(scenario) * (1.0, 0.35, 1.0)
    shift = Incident("shift", 4.0, 0.5, amount=(10.0, 6.0, 14.0)[number % 3], direction=as_vector(way))
    return with_incidents(_in_lab(scenario, pairs=26), shift)


def fibrillation(scenario: Scenario, number: int) -> Scenario:
    """An irregular heart of 3 to 5 mm, and B half a frame late."""
    heart = {
        "amplitude_mm": (4.0, 5.0, 3.0)[number % 3],
        "rate_bpm": 110.0,
        "variability": 0.3,
        "strength_spread": 0.35,
    }
    return _in_lab(scenario, pairs=26, rate_hz=3.75, plane_b_offset=0.5, heart=heart)


def plane_off(scenario: Scenario, number: int) -> Scenario:
    """One plane is off for 4, 10 or 20 s, after a breath and more."""
    length = (4.0, 10.0, 20.0)[number % 3]
    off = Incident("off", 6.0, length, plane="ba"[number % 2])
    return with_incidents(_in_lab(scenario, pairs=int(2.0 * (length + 9.0)), rate_hz=2.0), off)


def drops(scenario: Scenario, number: int) -> Scenario:
    """Pictures of B, of A, or of either are lost for one or two pairs, again and again, with a heart of 2 mm."""
    order = ("b", "a", "ba")[number % 3]
    events = tuple(
        Event("drop", first, first + turn % 2, plane=order[turn % len(order)])
        for turn, first in enumerate(range(4, 24, 4))
    )
    return _in_lab(scenario, pairs=28, heart={"amplitude_mm": 2.0}, events=events)


def filtered(scenario: Scenario, number: int) -> Scenario:
    """A display filter that keeps a third to a half of the last picture, and 25 mm of breathing."""
    return _in_lab(scenario, pairs=20, imaging={"lag": (0.5, 0.4, 0.33)[number % 3]}, breathing={"amplitude_mm": 25.0})


def gross_calibration(scenario: Scenario, number: int) -> Scenario:
    """Off by a degree, 5 mm and 20 px of 1024; by 10 mm; by 2°; and A's and B's matrices swapped."""
    error = (
        CalibrationSettings(angle_deg=1.0, shift_mm=5.0, shift_px=10.0),
        CalibrationSettings(shift_mm=10.0),
        CalibrationSettings(angle_deg=2.0, shift_px=20.0),
        CalibrationSettings(swapped=True),
    )[number % 4]
    return _in_lab(scenario, calibration_error=error, lasso={"centre_mm": (22.0, 8.0, 16.0)})


def twin(scenario: Scenario, number: int) -> Scenario:
    """A twin one deep breath away, along its way; in the last variant the ring itself is hidden for a while."""
    way = unit(scenario.breathing.direction)
    events = (Event("hide", 8, 12),) if number % 3 == 2 else ()
    twins = {"twin": True, "twin_offset_mm": as_vector(-22.0 * way + 6.0 * _direction(scenario)), "twin_tilt_deg": 10.0}
    breath = {"amplitude_mm": 24.0, "period_s": 3.5}
    return _in_lab(scenario, pairs=22, breathing=breath, bystanders=twins, events=events)


def contrast(scenario: Scenario, number: int) -> Scenario:
    """Contrast fills the vein behind the ring while it is followed, or from the seed pair on."""
    injection = Incident("contrast", (2.0, 0.0)[number % 2], 2.0, amount=70.0)
    return with_incidents(_in_lab(scenario, pairs=22), injection)


def regrey(scenario: Scenario, number: int) -> Scenario:
    """From fluoroscopy to cine and back, with the grey level jumping in one plane."""
    incidents = (Incident("dose", 2.0, 2.0, (6.0, 0.5)[number % 2]), Incident("window", 3.0, 60.0, 0.7, plane="b"))
    return with_incidents(_in_lab(scenario, pairs=20, imaging={"quanta": 20.0}), *incidents)
