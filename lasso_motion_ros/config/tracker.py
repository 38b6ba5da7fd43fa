"""Parameters of the tracker: which method, what both methods share, and the groups of each."""

from __future__ import annotations

from dataclasses import dataclass, field

from lasso_motion_ros.config.brost2009 import FeatureConfig, ModelConfig, RegistrationConfig
from lasso_motion_ros.config.parameters import parameter
from lasso_motion_ros.config.ring import JudgementConfig, RingConfig, SearchConfig

POSTURES = ("supine", "prone", "unknown")


@dataclass(frozen=True)
class PathConfig:
    """Minimal path between the clicks."""

    line_sigma_mm: float = parameter(
        0.25, "scale of the line filter under the path cost, at the iso-centre", unit="mm", minimum=0.05, maximum=2.0
    )
    cost_floor: float = parameter(
        0.05, "cost of a pixel on a perfect line, relative to one off any line", minimum=1e-3, maximum=1.0
    )


@dataclass(frozen=True)
class TrackerConfig:
    """All that the tracker's method depends on."""

    method: str = parameter(
        "appearance", "tracking method: ours, or the published one", choices=("appearance", "brost2009")
    )
    polarity: str = parameter("auto", "the catheter against its background", choices=("auto", "dark", "bright"))
    posture: str = parameter(
        "supine",
        "how the patient lies: the direction in which breathing is expected to move the heart until that has been seen"
        " (head at the top of the images, detectors above the patient, plane A the more frontal); unknown: none",
        choices=POSTURES,
    )
    path: PathConfig = field(default_factory=PathConfig)
    model: ModelConfig = field(default_factory=ModelConfig)
    features: FeatureConfig = field(default_factory=FeatureConfig)
    registration: RegistrationConfig = field(default_factory=RegistrationConfig)
    ring: RingConfig = field(default_factory=RingConfig)
    search: SearchConfig = field(default_factory=SearchConfig)
    judgement: JudgementConfig = field(default_factory=JudgementConfig)
