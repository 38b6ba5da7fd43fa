"""What may be changed of how the ring is followed, beside the user's parameters: tuning of several modules, together.

An ablation switches an idea off by one value of it.
"""

from __future__ import annotations

from dataclasses import dataclass, field

from lasso_motion_ros.core.errors import ConfigurationError
from lasso_motion_ros.ring.association import AssociationTuning
from lasso_motion_ros.ring.breathing_curve import CurveTuning
from lasso_motion_ros.ring.detection import DetectionTuning
from lasso_motion_ros.ring.detector import DetectorTuning
from lasso_motion_ros.ring.plane_companions import CompanionTuning
from lasso_motion_ros.ring.plane_contradiction import ContradictionTuning
from lasso_motion_ros.ring.seed_curves import POINTS
from lasso_motion_ros.ring.template import TemplateTuning
from lasso_motion_ros.ring.temporal_filter import DisplayChainTuning
from lasso_motion_ros.ring.track_state import StateTuning
from lasso_motion_ros.ring.twins import TwinTuning
from lasso_motion_ros.ring.validation import ValidationTuning
from lasso_motion_ros.ring.withdrawal import SEGMENTS, WithdrawalTuning


@dataclass(frozen=True)
class RingOptions:
    """Every option of the tracker, by the part that it belongs to.

    Attributes:
        display: when images are taken to be filtered over time, and that is undone.
        template: how the template is made and learned.
        detection: what the evidence of two planes is worth.
        detector: where the ring is looked for.
        association: what images and motion are worth.
        curve: how breathing repeats, and when the ring slides off it.
        companions: what else that moves with the heart tells of the ring's place.
        contradiction: when the planes show two things.
        twins: what else looks like the ring.
        withdrawal: when a part of the ring is gone.
        state: what the states ask for.
        validation: what else is asked of a detection.
        refined: whether the ring's curve follows from many pairs.
        rotation: whether a turning that follows the breath is the atrium's.
        points: of the model's curve.
    """

    display: DisplayChainTuning = field(default_factory=DisplayChainTuning)
    template: TemplateTuning = field(default_factory=TemplateTuning)
    detection: DetectionTuning = field(default_factory=DetectionTuning)
    detector: DetectorTuning = field(default_factory=DetectorTuning)
    association: AssociationTuning = field(default_factory=AssociationTuning)
    curve: CurveTuning = field(default_factory=CurveTuning)
    companions: CompanionTuning = field(default_factory=CompanionTuning)
    contradiction: ContradictionTuning = field(default_factory=ContradictionTuning)
    twins: TwinTuning = field(default_factory=TwinTuning)
    withdrawal: WithdrawalTuning = field(default_factory=WithdrawalTuning)
    state: StateTuning = field(default_factory=StateTuning)
    validation: ValidationTuning = field(default_factory=ValidationTuning)
    refined: bool = True
    rotation: bool = True
    points: int = POINTS

    def __post_init__(self) -> None:
        if self.points < SEGMENTS:
            raise ConfigurationError(f"points must be {SEGMENTS} or more, found {self.points}")
