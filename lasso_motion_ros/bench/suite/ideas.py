"""The ring tracker's ideas, each with the way to switch it off.

Where there is a user's parameter for it, an idea is switched off by its value; where there is none, by one of the
tracker's options; where it is a matter of what is published, by a tracker put around the tracker.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import numpy.typing as npt
from scipy.spatial.transform import Rotation

from lasso_motion_ros.config.parameters import Value, configuration_from_values, configuration_values
from lasso_motion_ros.config.stream import StreamConfig
from lasso_motion_ros.geometry.frames import FramePair, Seed
from lasso_motion_ros.geometry.transforms import rigid
from lasso_motion_ros.ring.association import AssociationTuning
from lasso_motion_ros.ring.breathing_curve import CurveTuning
from lasso_motion_ros.ring.companion_patches import PatchTuning
from lasso_motion_ros.ring.detection import DetectionTuning
from lasso_motion_ros.ring.detector import DetectorTuning
from lasso_motion_ros.ring.plane_companions import CompanionTuning
from lasso_motion_ros.ring.plane_contradiction import ContradictionTuning
from lasso_motion_ros.ring.ring_options import RingOptions
from lasso_motion_ros.ring.slide import SlideTuning
from lasso_motion_ros.ring.template import TemplateTuning
from lasso_motion_ros.ring.temporal_filter import DisplayChainTuning
from lasso_motion_ros.ring.track_state import StateTuning
from lasso_motion_ros.ring.tracker import RingTracker
from lasso_motion_ros.ring.twins import TwinTuning
from lasso_motion_ros.ring.validation import ValidationTuning
from lasso_motion_ros.ring.withdrawal import WithdrawalTuning
from lasso_motion_ros.tracking.tracker import Tracker, TrackResult
from lasso_motion_ros.tracking.wrapped_tracker import WrappedTracker

Array = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Idea:
    """One idea, and how it is switched off.

    Attributes:
        name: as typed.
        without: what is then missing, in words.
        parameters: values of parameters, by dotted name.
        options: the tracker's options without it; None where they stay as they are.
        around: what is put around the tracker.
    """

    name: str
    without: str
    parameters: Mapping[str, Value] = field(default_factory=dict)
    options: RingOptions | None = None
    around: Callable[[Tracker], Tracker] | None = None

    def configuration(self, config: StreamConfig) -> StreamConfig:
        """The configuration without this idea."""
        return configuration_from_values(StreamConfig, configuration_values(config) | dict(self.parameters))

    def tracker(self, config: StreamConfig) -> Tracker:
        """A tracker without this idea.

        Args:
            config: the whole tracker's parameters.
        """
        tracker = RingTracker(self.configuration(config), options=self.options)
        return tracker if self.around is None else self.around(tracker)


def _with(**changes: Any) -> RingOptions:
    return replace(RingOptions(), **changes)


class TurningWithTheRing(WrappedTracker):
    """Another tracker, with the ring's own rotation added to the published motion."""

    _first: Array  # (N, 3) the loop at the seed, about its mean, metres

    def initialise(self, pair: FramePair, seed: Seed) -> TrackResult:
        """Build the model from the clicks on `pair`."""
        result = super().initialise(pair, seed)
        if result.loop is not None:
            self._first = result.loop - result.loop.mean(axis=0)
        return result

    def track(self, pair: FramePair) -> TrackResult:
        """Find the loop in the next pair."""
        result = super().track(pair)
        if result.motion is None or result.loop is None:
            return result
        centre = result.loop.mean(axis=0)
        turn, _ = Rotation.align_vectors(result.loop - centre, self._first)
        return replace(result, motion=rigid(turn.as_rotvec(), np.zeros(3), centre) @ result.motion)


OFF = 1e6  # a limit that nothing reaches
# By regressions of their own on the same pairs.
WITHOUT_FIT = AssociationTuning(
    nothing=-2.62, by_evidence=4.13, by_wire=5.53, by_likeness=0.0, by_visible=0.0, by_blur=-2.65, by_spread=-2.14
)
WITHOUT_WIRE = AssociationTuning(
    nothing=-2.95, by_evidence=2.92, by_wire=0.0, by_likeness=0.56, by_visible=2.65, by_blur=-3.07, by_spread=-1.49
)
WITHOUT_IMAGES = AssociationTuning(
    nothing=2.0, by_evidence=0.0, by_wire=0.0, by_likeness=0.0, by_visible=0.0, by_blur=0.0
)

IDEAS: Mapping[str, Idea] = {
    idea.name: idea
    for idea in (
        # What is looked at.
        Idea("unlagged", "undoing a filter over time", options=_with(display=DisplayChainTuning(undo=False))),
        # Where it is looked for.
        Idea("candidates", "several candidates, carried to the end", {"search.candidates": 1}),
        Idea("near", "looking near the prediction first", options=_with(detector=DetectorTuning(near_first=False))),
        Idea(
            "sizes", "a ring that the heart has drawn in or widened", options=_with(detector=DetectorTuning(sizes=()))
        ),
        Idea("electrodes", "electrodes by themselves", options=_with(detector=DetectorTuning(electrodes=False))),
        Idea("afar", "a look from afar, in blurred images", options=_with(detector=DetectorTuning(from_afar=False))),
        # What it looks like.
        Idea("shared", "one profile that both planes share", options=_with(template=TemplateTuning(shared=False))),
        Idea("learning", "learning the profile from later pairs", options=_with(template=TemplateTuning(pairs=1))),
        # How it is aligned.
        Idea("ring", "the ring's own tilt, spin and size", {"ring.turn_deg": 0.1, "ring.stretch": 0.001}),
        Idea("priors", "the priors of tilt, spin and size", {"ring.turn_deg": 20.0, "ring.stretch": 0.2}),
        Idea("refined", "the curve from many pairs", options=_with(refined=False)),
        Idea(
            "pulled",
            "doubt where the template fits badly",
            options=_with(detection=DetectionTuning(pull=0.0, pulled_m=0.0)),
        ),
        # Which of the detections it is.
        Idea("weaker", "the weaker plane's say", options=_with(detection=DetectionTuning(stronger_share=1.0))),
        Idea("images", "the images' evidence", options=_with(association=WITHOUT_IMAGES)),
        Idea("wire", "the wire between the electrodes", options=_with(association=WITHOUT_WIRE)),
        Idea("fit", "how well the template fits", options=_with(association=WITHOUT_FIT)),
        Idea(
            "motion", "the motion's evidence", options=_with(association=AssociationTuning(foretold_m=OFF, view_m=OFF))
        ),
        Idea("rays", "that both planes see one thing", options=_with(association=AssociationTuning(gap_else=1.0))),
        Idea("beside", "places beside it as one", options=_with(association=AssociationTuning(beside_m=0.0))),
        Idea(
            "surge",
            "breaths that set in unforeseen",
            options=_with(association=AssociationTuning(surge_probability=1e-9)),
        ),
        # How it moves.
        Idea("foreseen", "where breathing is known to move the heart", {"posture": "unknown"}),
        Idea("rotation", "the rotation that repeats with the breath", options=_with(rotation=False)),
        Idea("translation", "publishing the translation alone: the ring's turn as well", around=TurningWithTheRing),
        # Whether it is in its place.
        Idea("curve", "judging by the breathing so far", options=_with(state=StateTuning(elsewhere_sigmas=OFF))),
        Idea("slide", "noticing a slow slide", options=_with(curve=CurveTuning(slide=SlideTuning(penalty=OFF)))),
        Idea(
            "companions",
            "what moves with the heart beside it",
            options=_with(companions=CompanionTuning(patches=PatchTuning(count=0))),
        ),
        Idea(
            "ghost",
            "asking that contrast does not fade",
            options=_with(validation=ValidationTuning(ghost_contrast=0.0)),
        ),
        Idea(
            "sheath",
            "asking for half of what is usual",
            options=_with(validation=ValidationTuning(left_share=0.0)),
        ),
        Idea(
            "twins",
            "what else looks like the ring, and where it lies",
            options=_with(twins=TwinTuning(most=0)),
        ),
        Idea(
            "withdrawal",
            "noticing that an arc of it is gone",
            options=_with(withdrawal=WithdrawalTuning(prior=0.0)),
        ),
        Idea("gap", "the planes' disagreement", {"judgement.degraded_gap_mm": OFF, "judgement.lost_gap_mm": OFF}),
        Idea(
            "contradiction",
            "planes that disagree as the breath goes",
            options=_with(contradiction=ContradictionTuning(odds=-OFF)),
        ),
        Idea("turn", "limits of the ring's turn", {"judgement.degraded_turn_deg": OFF, "judgement.lost_turn_deg": OFF}),
        Idea("doubtful", "withholding what is known badly", options=_with(state=StateTuning(misleads_pose=1.0))),
    )
}
