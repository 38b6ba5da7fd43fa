"""Parameters of our method (`method: appearance`)."""

from __future__ import annotations

from dataclasses import dataclass

from lasso_motion_ros.config.parameters import parameter, tuning


@dataclass(frozen=True)
class RingConfig:
    """How far the ring may move by itself, beside its translation (standard deviations)."""

    turn_deg: float = parameter(2.5, "tilt about any axis, and spin", unit="deg", minimum=0.1, maximum=20.0)
    stretch: float = parameter(0.02, "relative change of size", minimum=0.001, maximum=0.2)


@dataclass(frozen=True)
class SearchConfig:
    """Where the loop is looked for."""

    near_mm: float = tuning(
        12.0, "about the prediction, beyond its own uncertainty; where this fails, everywhere", unit="mm", minimum=2.0
    )
    candidates: int = tuning(4, "places aligned and judged before giving up", minimum=1, maximum=20)


@dataclass(frozen=True)
class JudgementConfig:
    """When a fit is believed."""

    smallest_likeness: float = tuning(
        0.65, "correlation with the loop's appearance, relative to what this dose allows", minimum=0.0, maximum=1.0
    )
    smallest_visible: float = tuning(0.6, "share of the loop that looks as expected", minimum=0.0, maximum=1.0)
    full_visible: float = tuning(0.8, "share below which the state is DEGRADED", minimum=0.0, maximum=1.0)
    faint_likeness: float = tuning(
        0.3, "likeness that is enough where the other plane and the motion agree", minimum=0.0, maximum=1.0
    )
    clear_likeness: float = tuning(0.8, "likeness for a pose that rests on one plane", minimum=0.0, maximum=1.0)
    one_plane_s: float = tuning(3.0, "longest time that one plane alone carries a pose", unit="s", minimum=0.0)
    degraded_gap_mm: float = tuning(0.8, "disagreement of the planes: DEGRADED", unit="mm", minimum=0.05)
    lost_gap_mm: float = tuning(1.6, "disagreement of the planes: LOST", unit="mm", minimum=0.1)
    degraded_turn_deg: float = parameter(
        6.0,
        "turn of the ring since the seed, as a C-arm that moved unsaid makes it: DEGRADED",
        unit="deg",
        minimum=1.0,
    )
    lost_turn_deg: float = parameter(8.0, "likewise: LOST", unit="deg", minimum=1.0)
    largest_speed_mm_s: float = tuning(65.0, "faster is a jump, not a breath", unit="mm/s", minimum=1.0)
    jump_allowance_mm: float = tuning(2.0, "moved at once without being a jump", unit="mm", minimum=0.0)
    longest_jump_interval_s: float = tuning(1.5, "pause after which speed tells nothing", unit="s", minimum=0.0)
    displaced_mm: float = tuning(8.0, "off the breathing curve: DISPLACED", unit="mm", minimum=1.0)
    repeatable_mm: float = tuning(
        4.0,
        "off the curve and across its axis: DISPLACED, once breaths have repeated within a quarter of it",
        unit="mm",
        minimum=1.0,
    )
    deeper_breath_mm: float = tuning(
        20.0, "a breath may go this far beyond the ones before, if foreseeable", unit="mm", minimum=0.0
    )
    longest_breath_s: float = tuning(9.0, "by then a whole breath has been seen", unit="s", minimum=1.0, maximum=30.0)
