"""Parameters of the tracker: which method, what both methods share, and the groups of each."""

from __future__ import annotations

from dataclasses import dataclass

from lasso_motion_ros.config.brost2009 import FeatureConfig, ModelConfig, RegistrationConfig
from lasso_motion_ros.config.catheters import AUTO, named
from lasso_motion_ros.config.parameters import group, parameter, tuning
from lasso_motion_ros.config.ring import JudgementConfig, RingConfig, SearchConfig

APPEARANCE, BROST2009 = METHODS = ("appearance", "brost2009")
POSTURES = ("supine", "prone", "unknown")


@dataclass(frozen=True)
class PathConfig:
    """The path along the loop, from click to click."""

    line_sigma_mm: float = parameter(
        0.25, "scale of the line filter that the path follows, at the iso-centre", unit="mm", minimum=0.05, maximum=2.0
    )
    cost_floor: float = parameter(
        0.05, "cost of a pixel on a perfect line, relative to a pixel on none", minimum=1e-3, maximum=1.0
    )


@dataclass(frozen=True)
class TrackerConfig:
    """The parameters of the tracker: those of both methods, and the groups of each."""

    method: str = parameter(
        APPEARANCE, "tracking method: appearance is this package's own, brost2009 the published one", choices=METHODS
    )
    polarity: str = tuning(
        "auto",
        "whether the catheter is darker or brighter than its background; auto: as the clicks show",
        choices=("auto", "dark", "bright"),
        holds_from="from the next clicks on",
    )
    posture: str = tuning(
        "supine",
        "how the patient lies, which tells where breathing moves the heart before any motion has been seen; needs the"
        " head at the top of the images, the detectors above the patient and plane A the more frontal; unknown: no"
        " assumption",
        choices=POSTURES,
        holds_from="from the next clicks on",
        method=APPEARANCE,
    )
    catheter: str = tuning(
        AUTO,
        "the catheter that is followed, by its name in config/catheters.yaml; its size is then asked of the clicks'"
        " ring, and its distances of the electrodes; auto: as the images show",
        holds_from="from the next clicks on",
        method=APPEARANCE,
    )
    path: PathConfig = group(PathConfig)
    model: ModelConfig = group(ModelConfig, method=BROST2009)
    features: FeatureConfig = group(FeatureConfig, method=BROST2009)
    registration: RegistrationConfig = group(RegistrationConfig, method=BROST2009)
    ring: RingConfig = group(RingConfig, method=APPEARANCE)
    search: SearchConfig = group(SearchConfig, method=APPEARANCE)
    judgement: JudgementConfig = group(JudgementConfig, method=APPEARANCE)

    def __post_init__(self) -> None:
        """Refuse a catheter that nobody knows, wherever its name came from.

        Raises:
            ConfigurationError: no such name.
        """
        named(self.catheter)
