"""Event classes of the clinic suite: what happens in a lab, each put into an ordinary sequence by one function."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from lasso_motion_ros.bench.suite import scenario_changes as changes
from lasso_motion_ros.bench.suite.moderate import altered
from lasso_motion_ros.bench.suite.vectors import as_vector, direction
from lasso_motion_ros.geometry.frames import PLANES
from lasso_motion_ros.phantom.lab_settings import Incident
from lasso_motion_ros.phantom.settings import Event, Scenario

Random = np.random.Generator

START = 0.0  # a class that holds from the first pair on


@dataclass(frozen=True)
class EventClass:
    """One kind of difficulty.

    Attributes:
        name: in the table.
        label: in words.
        apply: puts it into a sequence; gives that and the time from which on it holds, seconds.
        group: two classes of one group are not put into one sequence; empty: goes with everything.
    """

    name: str
    label: str
    apply: Callable[[Random, Scenario], tuple[Scenario, float]]
    group: str = ""


def _core(random: Random, scenario: Scenario) -> tuple[Scenario, float]:
    del random
    return scenario, START


def _ablation(random: Random, scenario: Scenario) -> tuple[Scenario, float]:
    nearest, farthest = [(0.0, 3.0), (0.0, 8.0), (3.0, 12.0), (8.0, 20.0)][int(random.integers(4))]
    work = {
        "works": True,
        "nearest_mm": nearest,
        "farthest_mm": farthest,
        "speed_mm_s": float(random.uniform(4.0, 20.0)),
        "dwell_s": float(random.uniform(1.0, 4.0)),
        "drag_mm_s": float(random.uniform(0.0, 2.0)),
        "bounce_mm": float(random.uniform(0.0, 2.0)),
        "tremor_mm": float(random.uniform(0.1, 0.8)),
        "tip_length_mm": float(random.uniform(3.5, 4.0)),
        "tip_diameter_mm": float(random.uniform(2.3, 2.7)),
    }
    return altered(scenario, ablation_work=work, distractors={"ablation": True}), START


def _edge_on(random: Random, scenario: Scenario) -> tuple[Scenario, float]:
    normal = changes.edge_on_normal(scenario, int(random.integers(2)), float(random.uniform(-6.0, 6.0)))
    return altered(scenario, lasso={"normal": normal}), START


def _heart(random: Random, scenario: Scenario) -> tuple[Scenario, float]:
    heart: dict[str, float] = {"amplitude_mm": float(random.uniform(2.0, 5.0))}
    if random.integers(2):
        # Fibrillation: no beat is like the one before, in length or strength.
        heart |= {"rate_bpm": float(random.uniform(80, 130)), "variability": 0.3, "strength_spread": 0.35}
    offset = 0.5 if random.integers(2) else scenario.plane_b_offset
    return altered(scenario, heart=heart, plane_b_offset=offset), START


def _b_late(random: Random, scenario: Scenario) -> tuple[Scenario, float]:
    rate = float(random.choice([2.0, 3.0, 3.75]))
    depth = {"amplitude_mm": float(random.uniform(12.0, 28.0))}
    heart = {"amplitude_mm": max(scenario.heart.amplitude_mm, float(random.uniform(0.0, 4.0)))}
    return altered(scenario, plane_b_offset=0.5, rate_hz=rate, breathing=depth, heart=heart), START


def _one_plane(random: Random, scenario: Scenario) -> tuple[Scenario, float]:
    scenario = altered(scenario, pairs=max(scenario.pairs, 24))
    events, at = [], int(random.integers(2, 6))
    first = at
    while at < scenario.pairs - 3:
        last = at + int(random.integers(0, 3))
        events.append(Event("drop", at, min(last, scenario.pairs - 2), plane=str(random.choice(PLANES))))
        at = last + int(random.integers(2, 6))
    return changes.with_events(scenario, *events), first / scenario.rate_hz


def _plane_off(random: Random, scenario: Scenario) -> tuple[Scenario, float]:
    start, length = float(random.uniform(3.0, 6.0)), float(random.uniform(3.0, 20.0))
    scenario = changes.lasting(altered(scenario, rate_hz=float(random.choice([2.0, 3.0]))), start + length + 3.0)
    off = Incident("off", start, length, plane=str(random.choice(PLANES)))
    return changes.with_incidents(scenario, off), start


def _cough(random: Random, scenario: Scenario) -> tuple[Scenario, float]:
    scenario = changes.lasting(altered(scenario, rate_hz=float(random.choice([2.0, 3.0, 3.75, 7.5]))), 8.0)
    start = float(random.uniform(2.5, 4.0))
    coughs = [
        Incident("cough", start + 1.3 * number, float(random.uniform(0.6, 1.0)), float(random.uniform(6.0, 12.0)))
        for number in range(int(random.integers(1, 3)))
    ]
    return changes.with_incidents(scenario, *coughs), start


def _sigh(random: Random, scenario: Scenario) -> tuple[Scenario, float]:
    breathing = {"amplitude_mm": float(random.uniform(8.0, 14.0)), "period_s": float(random.uniform(3.0, 4.0))}
    scenario = altered(scenario, rate_hz=2.0, breathing=breathing)
    start = float(random.uniform(3.0, 6.0))
    pause = Incident(str(random.choice(["apnoea", "breath_hold"], p=[0.75, 0.25])), start, float(random.uniform(6, 10)))
    sigh = Incident("sigh", start + pause.duration_s + 4.5, amount=float(random.uniform(25.0, 30.0)))
    return changes.with_incidents(changes.lasting(scenario, sigh.start_s + 8.5), pause, sigh), start


def _jet(random: Random, scenario: Scenario) -> tuple[Scenario, float]:
    stroke = {
        "amplitude_mm": float(random.uniform(1.0, 3.0)),
        "period_s": float(1.0 / random.uniform(1.0, 4.0)),
        "irregularity": 0.02,
        "hysteresis_mm": 0.0,
    }
    return altered(scenario, breathing=stroke), START


def _deep(random: Random, scenario: Scenario) -> tuple[Scenario, float]:
    breath = {"amplitude_mm": float(random.uniform(28.0, 40.0)), "period_s": float(random.uniform(4.0, 6.5))}
    return altered(scenario, breathing=breath), START


def _slide(random: Random, scenario: Scenario) -> tuple[Scenario, float]:
    start = float(random.uniform(3.0, 5.0))
    scenario = changes.lasting(altered(scenario, rate_hz=float(random.choice([2.0, 3.0]))), start + 11.0)
    return changes.with_incidents(scenario, Incident("slide", start, 0.0, float(random.uniform(0.3, 1.0)))), start


def _withdraw(random: Random, scenario: Scenario) -> tuple[Scenario, float]:
    start = float(random.uniform(3.0, 5.0))
    scenario = changes.lasting(scenario, start + 4.0)
    return changes.with_incidents(scenario, Incident("withdraw", start, float(random.uniform(0.8, 3.0)))), start


def _jump(random: Random, scenario: Scenario) -> tuple[Scenario, float]:
    scenario = altered(scenario, pairs=max(scenario.pairs, 22))
    first = int(random.integers(4, 14))
    turn = float(random.uniform(0.0, 25.0)) * direction(random)
    shift = float(random.uniform(14.0, 30.0)) * direction(random)
    last = first + int(random.integers(0, 4))
    move = Event("move", first, last, shift_mm=as_vector(shift), turn_deg=as_vector(turn))
    return changes.with_events(scenario, move), first / scenario.rate_hz


def _shift(random: Random, scenario: Scenario) -> tuple[Scenario, float]:
    start = float(random.uniform(3.0, 5.0))
    scenario = changes.lasting(scenario, start + 4.0)
    # A patient slides on the table rather than through it.
    way = direction(random) * np.array([1.0, 0.35, 1.0])
    amount, over = float(random.uniform(5.0, 15.0)), float(random.uniform(0.3, 1.2))
    return changes.with_incidents(scenario, Incident("shift", start, over, amount, as_vector(way))), start


def _hidden(random: Random, scenario: Scenario) -> tuple[Scenario, float]:
    scenario = altered(scenario, pairs=max(scenario.pairs, 20))
    first = int(random.integers(4, 9))
    for_good = random.integers(4) == 0
    event = Event("remove", first) if for_good else Event("hide", first, first + int(random.integers(2, 8)))
    return changes.with_events(scenario, event), first / scenario.rate_hz


def _ghost(random: Random, scenario: Scenario) -> tuple[Scenario, float]:
    return altered(scenario, imaging={"lag": float(random.uniform(0.25, 0.5))}), START


def _contrast(random: Random, scenario: Scenario) -> tuple[Scenario, float]:
    vessel = str(random.choice(["vein", "coronary"], p=[0.7, 0.3]))
    amount = float(random.uniform(30.0, 75.0) if vessel == "vein" else random.uniform(150.0, 300.0))
    start, length = float(random.uniform(1.5, 3.0)), float(random.uniform(1.0, 2.5))
    scenario, contrast = changes.lasting(scenario, 8.0), Incident("contrast", start, length, amount, vessel=vessel)
    return changes.with_incidents(scenario, contrast), start


def _twin(random: Random, scenario: Scenario) -> tuple[Scenario, float]:
    offset = float(random.uniform(20.0, 30.0)) * direction(random) * np.array([0.6, 0.6, 1.0])
    twin = {"twin": True, "twin_offset_mm": as_vector(offset), "twin_tilt_deg": float(random.uniform(0.0, 35.0))}
    return altered(scenario, bystanders=twin), START


def _star(random: Random, scenario: Scenario) -> tuple[Scenario, float]:
    offset = float(random.uniform(8.0, 24.0)) * direction(random)
    star = {"star": True, "star_offset_mm": as_vector(offset), "star_drift_mm_s": float(random.uniform(0.0, 10.0))}
    return altered(scenario, bystanders=star), START


def _tee(random: Random, scenario: Scenario) -> tuple[Scenario, float]:
    return altered(scenario, bystanders={"tee_probe": True, "tee_diameter_mm": float(random.uniform(10, 14))}), START


def _ecg(random: Random, scenario: Scenario) -> tuple[Scenario, float]:
    return altered(scenario, bystanders={"ecg_discs": int(random.integers(4, 8))}), START


def _dose(random: Random, scenario: Scenario) -> tuple[Scenario, float]:
    """Fluoroscopy to cine or back, and a jump of the grey level."""
    start = float(random.uniform(1.5, 3.0))
    scenario = changes.lasting(altered(scenario, imaging={"quanta": float(random.uniform(15.0, 30.0))}), start + 5.0)
    factor = float(random.uniform(3.0, 8.0) if random.integers(2) else random.uniform(0.4, 0.6))
    plane = str(random.choice(["a", "b", "both"]))
    window = Incident("window", start + 1.5, 100.0, float(random.choice([0.75, 1.25])), plane=plane)
    return changes.with_incidents(scenario, Incident("dose", start, 3.0, factor, plane=plane), window), start


def _shutter(random: Random, scenario: Scenario) -> tuple[Scenario, float]:
    start = float(random.uniform(1.5, 3.0))
    covered = as_vector(np.asarray(changes.path_shutters(scenario)) * random.uniform(0.7, 1.0))
    scenario = changes.lasting(scenario, start + 4.0)
    return changes.with_incidents(scenario, Incident("shutter", start, 1.5, covered=covered)), start


def _geometry(random: Random, scenario: Scenario) -> tuple[Scenario, float]:
    """The C-arm turns, the table pans or the format is switched, and the calibration says so."""
    scenario = altered(scenario, pairs=max(scenario.pairs, 22))
    first = int(random.integers(4, 12))
    last, plane = first + int(random.integers(1, 4)), str(random.choice(["a", "b", "both"]))
    kind = int(random.integers(3))
    if kind == 0:
        event = Event("zoom", first, plane=plane, factor=float(random.choice([0.8, 1.25, 1.4])))
    elif kind == 1:
        lao, cranial = (float(random.uniform(-25.0, 25.0)) for _ in range(2))
        event = Event("gantry_turn", first, last, plane=plane, lao_deg=lao, cranial_deg=0.4 * cranial)
    else:
        event = Event("table_pan", first, last, shift_mm=as_vector(random.uniform(-18.0, 18.0, 3) * (1.0, 0.2, 1.0)))
    return changes.with_events(scenario, event), first / scenario.rate_hz


def _calibration(random: Random, scenario: Scenario) -> tuple[Scenario, float]:
    error = {
        "angle_deg": float(random.uniform(0.2, 1.0)),
        "shift_mm": float(random.uniform(0.5, 5.0)),
        "shift_px": float(random.uniform(2.0, 20.0) * scenario.geometry.size_px / 1024),
    }
    return altered(scenario, calibration_error=error), START


def _loop(random: Random, scenario: Scenario) -> tuple[Scenario, float]:
    """Far from a circle, or a variable loop that is wound up or opened during the sequence."""
    shape = {
        "turns": float(random.choice([0.85, 1.25])),
        "helix_mm": float(random.uniform(3.0, 6.0)),
        "bulge": float(random.uniform(0.03, 0.1)),
        "saddle_mm": float(random.uniform(0.5, 2.0)),
        "aspect": float(random.uniform(0.8, 0.95)),
    }
    if random.integers(3):
        return altered(scenario, lasso=shape), START
    resize = Incident("resize", float(random.uniform(2.0, 4.0)), 1.5, float(random.choice([0.85, 1.12])))
    return changes.with_incidents(altered(changes.lasting(scenario, 8.0), lasso={"turns": 1.0}), resize), resize.start_s


def _low_dose(random: Random, scenario: Scenario) -> tuple[Scenario, float]:
    return altered(scenario, imaging={"quanta": float(random.uniform(7.0, 12.0))}), START


CLASSES: Mapping[str, EventClass] = {
    one.name: one
    for one in (
        EventClass("core", "nothing out of the ordinary", _core, "core"),
        EventClass("ablation", "an ablation tip works at the ring, 0 to 20 mm from it", _ablation),
        EventClass("edge_on", "edge-on in one plane", _edge_on),
        EventClass("heart", "a heart of 2 to 5 mm, regular or fibrillating, B half a frame late or not", _heart),
        EventClass("b_late", "B half a frame late, 12 to 28 mm of breathing, a heart of up to 4 mm", _b_late, "breath"),
        EventClass("one_plane", "pictures of either plane are lost now and then", _one_plane, "planes"),
        EventClass("plane_off", "a plane is off for 3 to 20 s", _plane_off, "planes"),
        EventClass("cough", "one or two coughs of 6 to 12 mm", _cough, "breath"),
        EventClass("sigh", "6 to 10 s without breath, then a sigh of 25 to 30 mm", _sigh, "breath"),
        EventClass("jet", "jet ventilation, 1 to 4 Hz, 1 to 3 mm", _jet, "breath"),
        EventClass("deep", "28 to 40 mm of breathing", _deep, "breath"),
        EventClass("slide", "slides out of the vein by 0.3 to 1 mm/s", _slide, "place"),
        EventClass("withdraw", "drawn into its sheath", _withdraw, "place"),
        EventClass("jump", "moved to another vein", _jump, "place"),
        EventClass("shift", "the patient shifts by 5 to 15 mm", _shift, "place"),
        EventClass("hidden", "out of view for a while, or for good", _hidden, "place"),
        EventClass("ghost", "a temporal filter keeps a quarter to a half of the last picture", _ghost),
        EventClass("contrast", "contrast in the ring's vein, or in a coronary artery", _contrast),
        EventClass("twin", "a lasso of the same kind in the neighbouring vein", _twin),
        EventClass("star", "a star-shaped catheter near the ring", _star),
        EventClass("tee", "an echo probe of 10 to 14 mm behind the atrium", _tee),
        EventClass("ecg", "dense electrodes on the skin", _ecg),
        EventClass("dose", "fluoroscopy to cine or back, and a jump of the grey level", _dose),
        EventClass("shutter", "shutters move in", _shutter),
        EventClass("geometry", "zoom, gantry turn or table pan, and the calibration says so", _geometry, "place"),
        EventClass("calibration", "calibration off by up to 1°, 5 mm, 20 px of 1024", _calibration),
        EventClass("loop", "open, overlapping, helical, bulging or variable loops", _loop),
        EventClass("low_dose", "7 to 12 quanta a pixel", _low_dose),
    )
}
