"""The ring tracker's ideas, each with the way to switch it off.

Where there is a parameter for it, an idea is switched off by its value; where it is a matter of what is published, by a
tracker put around the tracker. What is left lies inside the tracker (see `patches`).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field, replace

import numpy as np
import numpy.typing as npt
from scipy.spatial.transform import Rotation

from lasso_motion_ros.bench.suite.patches import OFF, patched
from lasso_motion_ros.config.parameters import Value, configuration_from_values, configuration_values
from lasso_motion_ros.config.stream import StreamConfig
from lasso_motion_ros.geometry.frames import FramePair, Seed
from lasso_motion_ros.geometry.transforms import rigid
from lasso_motion_ros.stream.tracker_factory import create_tracker
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
        around: what is put around the tracker.
    """

    name: str
    without: str
    parameters: Mapping[str, Value] = field(default_factory=dict)
    around: Callable[[Tracker], Tracker] | None = None

    def configuration(self, config: StreamConfig) -> StreamConfig:
        """The configuration without this idea."""
        return configuration_from_values(StreamConfig, configuration_values(config) | dict(self.parameters))

    @contextmanager
    def switched_off(self, config: StreamConfig) -> Iterator[Tracker]:
        """A tracker without this idea, to be used within the block.

        Args:
            config: the whole tracker's parameters.
        """
        with patched(self.name):
            tracker = create_tracker(self.configuration(config))
            yield tracker if self.around is None else self.around(tracker)


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


IDEAS: Mapping[str, Idea] = {
    idea.name: idea
    for idea in (
        # The search.
        Idea("candidates", "several candidates, carried to the end", {"search.candidates": 1}),
        Idea("rivals", "a look at rivals of the first that is found"),
        Idea("judged_rivals", "asking the motion which of two alike it is"),
        Idea("near", "looking near the prediction first"),
        Idea("anywhere", "looking everywhere where that fails"),
        Idea("afar", "a second look, from afar"),
        Idea("prediction", "the prediction: the last place instead"),
        Idea("joint", "one search in both planes: each its own best"),
        Idea("ceiling", "the ceiling by which neither plane drowns the other"),
        Idea("disagreeing", "candidates of planes that disagree"),
        # What the loop looks like.
        Idea("electrodes", "the electrodes' pattern: one profile all along"),
        Idea("distinctive", "strips of what is distinctive"),
        Idea("denoised", "shrinking what is only noise"),
        Idea("learning", "learning the appearance, and what correlation is usual, from later pairs"),
        Idea("local", "contrast in units of the local noise"),
        Idea("clip", "clipping of strong contrast"),
        # Alignment.
        Idea("robust", "robust weights"),
        Idea("ring", "the ring's own tilt, spin and size", {"ring.turn_deg": 0.1, "ring.stretch": 0.001}),
        Idea("priors", "the priors of tilt, spin and size", {"ring.turn_deg": 20.0, "ring.stretch": 0.2}),
        Idea("hopeless", "giving up early on hopeless candidates"),
        Idea("unawaited", "not waiting for a plane that shows nothing"),
        Idea("translation", "publishing the translation alone: the ring's turn as well", around=TurningWithTheRing),
        Idea("rotation", "the rotation that repeats with the breath"),
        # The model.
        Idea("calibration", "absorbing a calibration's shift at the seed"),
        Idea("images", "fitting the model to the images, not the clicks alone"),
        Idea("curve", "an open curve: the ellipse"),
        Idea("centre", "the circle's centre: the points' mean"),
        Idea("polarity", "trying the other polarity where in doubt"),
        # The motion in time.
        Idea("together", "plane B's own time of exposure"),
        Idea("filter", "the filter in time, and B's own time"),
        Idea("foreseen", "where breathing is known to move the heart", {"posture": "unknown"}),
        Idea("between", "the motion between the first two exposures"),
        Idea("direction", "learning the breathing's direction"),
        Idea("rebuild", "going through the past again"),
        Idea("heartbeat", "the heartbeat beside the breathing"),
        Idea("doubt", "doubt of a depth that no plane sees"),
        # Judgement.
        Idea(
            "thresholds",
            "asking for likeness and visible share",
            {"judgement.smallest_likeness": 0.0, "judgement.smallest_visible": 0.0},
        ),
        Idea("dose", "the likeness that the dose allows: 0.4 of correlation for all"),
        Idea("ghost", "asking that contrast does not fade"),
        Idea("visible", "asking for the visible share", {"judgement.smallest_visible": 0.0}),
        Idea("faint", "less to be asked where it is foreseen"),
        Idea("one_plane", "poses that rest on one plane", {"judgement.one_plane_s": 0.0}),
        Idea("gap", "the planes' disagreement", {"judgement.degraded_gap_mm": OFF, "judgement.lost_gap_mm": OFF}),
        Idea("turn", "limits of the ring's turn", {"judgement.degraded_turn_deg": OFF, "judgement.lost_turn_deg": OFF}),
        Idea("found_share", "asking for more after a loss"),
        Idea("found_turn", "asking that it lies as it lay"),
        Idea("edge_on", "care where it is edge-on in both planes"),
        Idea("envelope", "judging by the breathing so far"),
        Idea("foresight", "doubt of a place that nothing foretold"),
        Idea("speed", "the limit of speed", {"judgement.largest_speed_mm_s": OFF}),
        Idea("acceleration", "the limit of acceleration"),
        Idea("repeatable", "a narrow curve once breaths repeat", {"judgement.repeatable_mm": OFF}),
        Idea("deeper", "deeper breaths than before", {"judgement.deeper_breath_mm": 0.0}),
    )
}
