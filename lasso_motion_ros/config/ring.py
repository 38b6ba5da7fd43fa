"""Parameters of our method (`method: appearance`)."""

from __future__ import annotations

from dataclasses import dataclass

from lasso_motion_ros.config.parameters import parameter, tuning


@dataclass(frozen=True)
class RingConfig:
    """What the ring may do beside its translation: standard deviations of the prior."""

    turn_deg: float = parameter(2.5, "rotation about any axis", unit="deg", minimum=0.1, maximum=20.0)
    stretch: float = parameter(0.02, "relative change of size", minimum=0.001, maximum=0.2)


@dataclass(frozen=True)
class SearchConfig:
    """Where the ring is searched for."""

    near_mm: float = tuning(
        12.0,
        "search this far about the prediction, beyond its own uncertainty; where that fails, search the whole image",
        unit="mm",
        minimum=2.0,
    )
    candidates: int = tuning(4, "places that are aligned and judged before the pair is given up", minimum=1, maximum=20)


@dataclass(frozen=True)
class JudgementConfig:
    """Which fits are believed, and which state they get."""

    smallest_likeness: float = tuning(
        0.65, "smallest correlation with the template, relative to what this dose allows", minimum=0.0, maximum=1.0
    )
    smallest_visible: float = tuning(0.6, "smallest share of the ring that looks as expected", minimum=0.0, maximum=1.0)
    full_visible: float = tuning(
        0.8, "DEGRADED where less than this share of the ring looks as expected", minimum=0.0, maximum=1.0
    )
    faint_likeness: float = tuning(
        0.3, "likeness that is enough where the other plane and the predicted motion agree", minimum=0.0, maximum=1.0
    )
    clear_likeness: float = tuning(
        0.8, "likeness that is asked for where a pose rests on one plane", minimum=0.0, maximum=1.0
    )
    one_plane_s: float = tuning(3.0, "longest time for which poses may rest on one plane", unit="s", minimum=0.0)
    degraded_gap_mm: float = tuning(
        0.8, "DEGRADED where the planes disagree by more than this", unit="mm", minimum=0.05
    )
    lost_gap_mm: float = tuning(1.6, "LOST where the planes disagree by more than this", unit="mm", minimum=0.1)
    degraded_turn_deg: float = parameter(
        6.0,
        "DEGRADED where the ring seems turned by this since the seed, as when a C-arm moves and its calibration does"
        " not",
        unit="deg",
        minimum=1.0,
    )
    lost_turn_deg: float = parameter(8.0, "LOST where the ring seems turned by this", unit="deg", minimum=1.0)
    largest_speed_mm_s: float = tuning(65.0, "faster than this is a jump, not a breath", unit="mm/s", minimum=1.0)
    jump_allowance_mm: float = tuning(2.0, "a sudden move of up to this is no jump", unit="mm", minimum=0.0)
    longest_jump_interval_s: float = tuning(
        1.5, "after a pause longer than this, speed is not judged", unit="s", minimum=0.0
    )
    displaced_mm: float = tuning(
        8.0, "DISPLACED where the ring lies this far off the breathing curve", unit="mm", minimum=1.0
    )
    repeatable_mm: float = tuning(
        4.0,
        "DISPLACED this far off the curve across its axis, once breaths have repeated to within a quarter of it",
        unit="mm",
        minimum=1.0,
    )
    deeper_breath_mm: float = tuning(
        20.0, "a breath may go this far beyond those before it where its course predicts so", unit="mm", minimum=0.0
    )
    longest_breath_s: float = tuning(
        9.0, "time in which a whole breath is certain to have been seen", unit="s", minimum=1.0, maximum=30.0
    )
