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

    degraded_gap_mm: float = tuning(
        0.8, "DEGRADED where the planes disagree by more than this", unit="mm", minimum=0.05
    )
    lost_gap_mm: float = tuning(1.6, "LOST where the planes disagree by more than this", unit="mm", minimum=0.1)
    seed_degraded_gap_mm: float = parameter(
        2.0,
        "DEGRADED where the planes disagree by more than this at the seed; a plane B that is exposed later may disagree"
        " by a breath's motion besides",
        unit="mm",
        minimum=0.1,
    )
    seed_refused_gap_mm: float = parameter(
        8.0, "clicks are refused where the planes disagree by more than this", unit="mm", minimum=0.1
    )
    degraded_turn_deg: float = parameter(
        6.0,
        "DEGRADED where the ring is turned by this since the seed, as when a C-arm moves and its calibration does not;"
        " in proportion by more where it turns by itself more than ring.turn_deg",
        unit="deg",
        minimum=1.0,
    )
    lost_turn_deg: float = parameter(8.0, "LOST where the ring is turned by this, likewise", unit="deg", minimum=1.0)
