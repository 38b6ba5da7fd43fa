"""Traps: sequences with one difficulty each, which random sequences lack or have too rarely to show an improvement."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from itertools import count, islice

import numpy as np
import numpy.typing as npt

from lasso_motion_ros.bench.suite import lab_traps
from lasso_motion_ros.bench.suite.moderate import altered, moderate_scenarios
from lasso_motion_ros.bench.suite.random_scenarios import MOVE_MM
from lasso_motion_ros.bench.suite.scenario_changes import path_shutters
from lasso_motion_ros.bench.suite.vectors import as_vector, direction, unit
from lasso_motion_ros.geometry.frames import PLANES
from lasso_motion_ros.phantom import scenario_motion
from lasso_motion_ros.phantom.gantry import true_projection
from lasso_motion_ros.phantom.settings import ClickSettings, Event, Scenario

Array = npt.NDArray[np.float64]


@dataclass(frozen=True)
class _Tuning:
    """What the traps have in common."""

    pairs: int = 14
    event: int = 7  # the pair at which something happens, where it matters little which
    other_scenarios: int = 1000  # each trap starts so much further on in its seed: lassos and bodies of its own
    low_dose: float = 14.0  # quanta a pixel: where noise looks like a lasso, too
    sigh_depth: float = 1.4  # times the breaths before
    other_side_mm: float = 45.0  # from a left vein to a right one
    collimator_margin: float = 0.06  # share of the field, between the loop's whole path and the collimator's edges


TUNING = _Tuning()


@dataclass(frozen=True)
class Trap:
    """One difficulty.

    Attributes:
        name: as typed.
        label: what is difficult, in words.
        apply: puts it into a moderate scenario; the number of the sequence varies it.
        sequences: how many.
        pose_due: False: from the event on no pose is due, LOST is as right as DEGRADED.
        doubt_due: TRACKING is wrong, from the event on or, without an event, everywhere.
    """

    name: str
    label: str
    apply: Callable[[Scenario, int], Scenario]
    sequences: int = 3
    pose_due: bool = True
    doubt_due: bool = False


def _ghost(scenario: Scenario, number: int) -> Scenario:
    shift = as_vector(MOVE_MM * _direction(scenario))
    first = TUNING.event
    events = (Event("remove", first), Event("hide", first, first + 3), Event("move", first, shift_mm=shift))
    # In noise a ghost is no lasso anyway: the pictures are clear.
    imaging = {"lag": (0.35, 0.3, 0.35)[number % 3], "quanta": 80.0}
    return altered(scenario, imaging=imaging, events=(events[number % 3],))


def _tilt(scenario: Scenario, number: int) -> Scenario:
    tilt = float(np.random.default_rng(scenario.seed).uniform(3.5, 6.0))
    return altered(
        scenario,
        pairs=16,
        rate_hz=(2.0, 3.0, 3.75)[number % 3],
        plane_b_offset=(0.0, 0.2, 0.0)[number % 3],
        lasso={"tilt_deg": tilt, "stretch": 0.03},
    )


def _gantry(scenario: Scenario, number: int) -> Scenario:
    variant = number % 6
    # A tilt parts the planes' rays; a rotation moves the loop along the other plane's, and nothing disagrees.
    cranial, lao = ((2.0, 0.0), (4.0, 0.0), (8.0, 0.0), (0.0, 8.0), (0.0, 20.0), (0.0, 7.0))[variant]
    # Far from the iso-centre a turn is also a shift; near it, by both planes, the ring only lies otherwise.
    plane = "both" if variant == 5 else PLANES[variant % 2]
    lasso = {} if variant == 5 else {"centre_mm": (28.0, 12.0, 18.0)}
    turn = Event("gantry_turn", TUNING.event, plane=plane, lao_deg=lao, cranial_deg=cranial, calibrated=False)
    return altered(scenario, lasso=lasso, events=(turn,))


def _table(scenario: Scenario, number: int) -> Scenario:
    """Across, where no breath goes, and along, where it does, before a whole breath has been seen; across after one."""
    shift = ((20.0, 0.0, 0.0), (0.0, 0.0, 20.0))[number % 3 % 2]
    if number % 3 == 2:
        scenario = altered(scenario, pairs=18, rate_hz=3.75, breathing={"period_s": 3.0})
    first = (TUNING.event, TUNING.event, 13)[number % 3]
    return altered(scenario, events=(Event("table_pan", first, shift_mm=shift, calibrated=False),))


def _zoom(scenario: Scenario, number: int) -> Scenario:
    plane = ("both", "a")[number % 2]
    return altered(scenario, events=(Event("zoom", TUNING.event, plane=plane, factor=1.25, calibrated=False),))


def _slow_move(scenario: Scenario, number: int) -> Scenario:
    """After two breaths and more the ring is moved over 4 to 8 pairs, in steps that a breath might take, or nearly."""
    shift = as_vector(MOVE_MM * _direction(scenario))
    move = Event("move", 24, 24 + (3, 5, 7)[number % 3], shift_mm=shift)
    return altered(scenario, pairs=34, rate_hz=3.75, breathing={"period_s": 3.0}, events=(move,))


def _jump(scenario: Scenario, number: int) -> Scenario:
    """Moved at once before a breath is known: in the first pairs; then, a little later, as a fast breath would."""
    along = unit(scenario.breathing.direction)
    shift = 18.0 * along if number % 3 == 2 else MOVE_MM * _direction(scenario)
    return altered(scenario, rate_hz=3.75, events=(Event("move", (1, 2, 4)[number % 3], shift_mm=as_vector(shift)),))


def _moved_unseen(scenario: Scenario, number: int) -> Scenario:
    """Hidden while it is put elsewhere: back along the breath's way, where only how it lies tells; then far away."""
    along = unit(scenario.breathing.direction)
    shift = (6.0 * along, -6.0 * along, TUNING.other_side_mm * _direction(scenario))[number % 3]
    turn = (8.0, 12.0, 0.0)[number % 3] * _direction(scenario)
    moved = Event("move", 7, shift_mm=as_vector(shift), turn_deg=as_vector(turn))
    return altered(scenario, events=(Event("hide", 6, 8), moved))


def _hidden(scenario: Scenario, number: int) -> Scenario:
    """Five pairs hidden, near another ring and wires; it returns half a breath later."""
    return altered(
        scenario,
        pairs=16,
        rate_hz=3.0,
        breathing={"amplitude_mm": 25.0, "period_s": 4.0, "start": 0.3 * number % 1.0},
        imaging={"quanta": TUNING.low_dose},
        distractors={"second_ring": True, "sternal_wires": 5},
        events=(Event("hide", TUNING.event, TUNING.event + 4),),
    )


def _two_rings(scenario: Scenario, number: int) -> Scenario:
    """Taken out for good, halfway or right after the first pairs; the other ring stays."""
    return altered(
        scenario,
        imaging={"quanta": TUNING.low_dose},
        distractors={"second_ring": True, "sternal_wires": 5, "ecg_leads": 3},
        events=(Event("remove", (TUNING.event, 2)[number % 2]),),
    )


def _sigh(scenario: Scenario, number: int) -> Scenario:
    """Unequal breaths of 22 mm, and in the second half one that is 1.4 times as deep as all before."""
    del number
    breathing = {"amplitude_mm": 22.0, "irregularity": 0.45, "period_s": 2.6, "start": 0.2}
    unequal = altered(scenario, pairs=34, rate_hz=3.75, breathing=breathing)
    # Breaths are drawn by the simulator: the next seed that has a sigh is taken.
    seeds = (altered(unequal, seed=(scenario.seed + more) % 2**31) for more in count())
    return next(one for one in seeds if _has_sigh(one))


def _has_sigh(scenario: Scenario) -> bool:
    breathing = scenario_motion(scenario).breathing
    depths = [breathing.depth(pair / scenario.rate_hz) for pair in range(scenario.pairs)]
    half = scenario.pairs // 2
    return max(depths[half:]) > TUNING.sigh_depth * max(depths[:half])


def _bright(scenario: Scenario, number: int) -> Scenario:
    del number
    clicks = ClickSettings(noise_px=2.0, fewest=6, most=6)
    return altered(scenario, imaging={"polarity": "bright", "quanta": 10.0}, clicks=clicks)


def _edge_on(scenario: Scenario, number: int) -> Scenario:
    """Edge-on in both planes: the loop's axis is across both lines of sight, within three degrees."""
    along_a, along_b = (true_projection(scenario, plane, 0).viewing_direction for plane in PLANES)
    off = np.tan(np.radians((0.0, 1.5, 3.0)[number % 3])) * _direction(scenario)
    return altered(scenario, lasso={"normal": as_vector(unit(np.cross(along_a, along_b)) + off)})


def _overlap(scenario: Scenario, number: int) -> Scenario:
    del number
    clicks = ClickSettings(noise_px=2.0, fewest=6, most=6)
    return altered(scenario, lasso={"turns": 1.25, "helix_mm": 2.5, "tilt_deg": 3.0}, clicks=clicks)


def _rotation(scenario: Scenario, number: int) -> Scenario:
    return altered(scenario, pairs=64, rate_hz=3.75, breathing={"rotation_deg": (4.0, 2.5)[number % 2]})


def _low_dose(scenario: Scenario, number: int) -> Scenario:
    return altered(scenario, imaging={"quanta": (12.0, 11.0, 10.0)[number % 3]})


def _strong_edges(scenario: Scenario, number: int) -> Scenario:
    """Wires, leads, and the collimator as near as the loop's path allows."""
    return altered(
        scenario,
        imaging={
            "quanta": 80.0,
            "collimator": path_shutters(scenario, TUNING.collimator_margin, 0.4),
            "edge_enhancement": (1.0, 2.0, 3.0)[number % 3],
        },
        distractors={"sternal_wires": 5, "ecg_leads": 3, "oesophageal_probe": True},
    )


def _alternating(scenario: Scenario, number: int) -> Scenario:
    amplitude, rate = (30.0, 25.0, 20.0)[number % 3], (2.0, 1.5, 1.0)[number % 3]
    return altered(scenario, rate_hz=rate, plane_b_offset=0.5, breathing={"amplitude_mm": amplitude})


def _alike(scenario: Scenario, number: int) -> Scenario:
    """Edge-on in one plane, where a line among lines is all that is seen of it, with all the lines there are."""
    along = true_projection(scenario, PLANES[number % 2], 0).viewing_direction
    normal = np.array(scenario.lasso.normal)
    return altered(
        scenario,
        lasso={"normal": as_vector(normal - (normal @ along) * along)},
        breathing={"amplitude_mm": 25.0},
        imaging={"quanta": TUNING.low_dose},
        distractors={"second_ring": True, "sternal_wires": 5, "ecg_leads": 3, "oesophageal_probe": True},
    )


def _slip(scenario: Scenario, number: int) -> Scenario:
    """After two breaths and more the ring slips by less than a breath, across its way."""
    along, direction = unit(scenario.breathing.direction), _direction(scenario)
    across = unit(direction - (direction @ along) * along)
    move = Event("move", 24, shift_mm=as_vector((8.0, 7.0, 6.0, 5.0)[number % 4] * across))
    return altered(scenario, pairs=34, rate_hz=3.75, breathing={"period_s": 3.0}, events=(move,))


# A new one comes last: where each stands decides which lassos and bodies it has.
TRAPS: Mapping[str, Trap] = {
    trap.name: trap
    for trap in (
        Trap("ghost", "a filter over time keeps a third of a lasso that has gone", _ghost),
        Trap("tilt", "the ring tilts by 3.5 to 6° with the heartbeat", _tilt),
        Trap("gantry", "a plane tilts by 2 to 8° or rotates by 7 to 20° unsaid", _gantry, 6, False, True),
        Trap("table", "the table moves by 20 mm unsaid", _table, 3, False, True),
        Trap("zoom", "one or both planes magnify by a quarter unsaid", _zoom, 2, False, True),
        Trap("slow_move", "moved over 4 to 8 pairs after several breaths", _slow_move),
        Trap("jump", "moved in one of the first pairs", _jump),
        Trap("hidden", "hidden for half a breath of 25 mm beside another ring, 14 quanta", _hidden, 2),
        Trap("two_rings", "taken out at 14 quanta, another ring stays", _two_rings, 2),
        Trap("sigh", "unequal breaths, and one 1.4 times as deep as all before", _sigh, 2),
        Trap("bright", "bright on dark at 10 quanta, six clicks of 2 px", _bright),
        Trap("edge_on", "edge-on in both planes", _edge_on, doubt_due=True),
        Trap("overlap", "an overlapping loop that tilts by 3°, and six clicks of 2 px", _overlap, 2),
        Trap("rotation", "the heart rotates by 4 or 2.5° with the breath, 64 pairs", _rotation, 2),
        Trap("low_dose", "10 to 12 quanta", _low_dose),
        Trap("edges", "collimator, wires and leads beside the loop, sharpened", _strong_edges),
        Trap("alternating", "1 to 2 pairs/s, B half a frame late, 20 to 30 mm", _alternating),
        Trap("alike", "edge-on in one plane among lines, 14 quanta", _alike, 2),
        Trap("moved_unseen", "moved while hidden, along the breath's way or far", _moved_unseen),
        Trap("slip", "slipped by 8 to 5 mm across the breath's way after several breaths", _slip, 4),
        Trap("tip_at_ring", "an ablation tip at the ring, from the seed pair on", lab_traps.tip_at_ring),
        Trap("tip_on_line", "edge-on in one plane, an ablation tip continues the line", lab_traps.tip_on_line),
        Trap("narrow", "a narrow, faint ellipse beside an ablation tip", lab_traps.narrow),
        Trap("cough_apnoea_sigh", "a cough, 10 s without breath, a sigh of 29 mm", lab_traps.cough_apnoea_sigh, 2),
        Trap("slide", "slides out of the vein by 0.3 to 1 mm/s", lab_traps.slide),
        Trap("withdraw", "drawn into its sheath", lab_traps.withdraw),
        Trap("far_jump", "put 24 mm away after a breath", lab_traps.far_jump),
        Trap("patient_shift", "the patient moves by 6 to 14 mm", lab_traps.patient_shift),
        Trap("fibrillation", "an irregular heart of 3 to 5 mm, B half a frame late", lab_traps.fibrillation),
        Trap("plane_off", "one plane is off for 4 to 20 s", lab_traps.plane_off),
        Trap("drops", "pictures of either plane are lost now and then, a heart of 2 mm", lab_traps.drops),
        Trap("filtered", "a filter keeps up to half of the last picture, 25 mm", lab_traps.filtered),
        Trap("calibration", "gross errors, or A and B swapped", lab_traps.gross_calibration, 4, doubt_due=True),
        Trap("twin", "a lasso of the same kind a deep breath away", lab_traps.twin),
        Trap("contrast", "contrast in the vein behind the ring", lab_traps.contrast, 2),
        Trap("regrey", "dose and grey level change", lab_traps.regrey, 2),
    )
}


def trap_scenarios(trap: Trap, seed: int, sequences: int | None = None) -> tuple[Scenario, ...]:
    """The sequences of a trap: 512², 14 pairs at 3 a second, 30 quanta, 15 mm, no error, but for its difficulty.

    Args:
        trap: one of `TRAPS`.
        seed: of the suite that orientations, lassos and distractors are taken from.
        sequences: how many; None: as many as the trap has variants.
    """
    first = TUNING.other_scenarios * (1 + list(TRAPS).index(trap.name))
    moderate = islice(moderate_scenarios(seed, first), trap.sequences if sequences is None else sequences)
    return tuple(
        altered(trap.apply(altered(scenario, pairs=TUNING.pairs), number), name=f"{seed}/{trap.name}/{number}")
        for number, scenario in enumerate(moderate)
    )


def _direction(scenario: Scenario) -> Array:
    return direction(np.random.default_rng(scenario.seed))
