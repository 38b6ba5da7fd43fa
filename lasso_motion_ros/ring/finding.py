"""What an alignment is worth: which planes show the loop, and whether they agree on where it is."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt

from lasso_motion_ros.config.ring import JudgementConfig
from lasso_motion_ros.geometry.covariance import squared_mahalanobis
from lasso_motion_ros.geometry.frames import PLANES, Plane
from lasso_motion_ros.motion.respiration import Estimate, Observation, RespiratoryMotion
from lasso_motion_ros.ring.alignment import Alignment, RingPrior
from lasso_motion_ros.ring.judgement import epipolar_gap, is_clearly_seen, is_faintly_seen, is_seen
from lasso_motion_ros.ring.loop_model import LoopModel
from lasso_motion_ros.ring.loop_views import PlaneFit
from lasso_motion_ros.ring.working_image import WorkingImage
from lasso_motion_ros.tracking.stages import Stages, no_stages

Array = npt.NDArray[np.float64]

# What an alignment's own covariance leaves out: the background that moves behind the loop, its interpolation.
IMAGE_COVARIANCE_FACTOR = 1.2
SYSTEMATIC_M = 3e-5
# What the heartbeat may add to the planes' disagreement when they are not exposed together, per second.
HEARTBEAT_SPEED_M_S = 0.006
BOTH_AGREE = 4  # the worth of a finding on which both planes agree
# A plane that shows little is believed where the motion so far and the other plane leave no more doubt than this.
NEAR_M = 0.008
FAINT_SPREAD_M = 0.003
FAINT_SURPRISE = 9.0  # squared Mahalanobis distance, two degrees of freedom
EDGE_ON_RATIO = 0.12  # of the projected loop's extents: seen within about seven degrees of edge-on
EDGE_ON_M = 5e-4  # in both planes, the electrodes' spacing is mistaken along the line


@dataclass(frozen=True, eq=False)
class Finding:
    """An alignment that was looked at, and what it was worth.

    Attributes:
        alignment: where the loop would be.
        seen: the planes that show it.
        faint: the weaker plane, where one or both count as seen only because they lie where the motion so far, and the
            other plane, say.
        edge_on: whether all planes in the pair see the loop edge-on, so that the place along the line is uncertain.
        gap_mm: by which the planes disagree, mm.
        degraded_gap_mm: disagreement above which the state is DEGRADED, mm.
        lost_gap_mm: disagreement above which it is LOST, mm.
        rivals: other findings on which both planes agree, and which correlate nearly as well; best first.
    """

    alignment: Alignment
    seen: tuple[Plane, ...]
    faint: Plane | None = None
    edge_on: bool = False
    gap_mm: float = 0.0
    degraded_gap_mm: float = np.inf
    lost_gap_mm: float = np.inf
    rivals: tuple[Finding, ...] = ()

    @property
    def rank(self) -> tuple[int, float]:
        """Two planes that agree are best, then two that do not, then one; then higher correlation."""
        worth = 2 * len(self.seen) - (1 if self.gap_mm > self.lost_gap_mm else 0)
        return worth, sum(self.alignment.planes[p].correlation for p in self.seen)


@dataclass(frozen=True, eq=False)
class Look:
    """One look at a pair: its images, and what is known beforehand.

    Attributes:
        images: of each plane in the pair.
        times: of their exposures, seconds since the start.
        respiration: the motion so far; not to be changed.
        model: the loop at the reference.
        judgement: when a fit is believed.
        prior: of the ring's own motion.
        turn: (3,) rotation vector of the ring to start from.
        stretch: logarithm of its size to start from.
        stages: told of each stage of the work.
    """

    images: dict[Plane, WorkingImage]
    times: dict[Plane, float]
    respiration: RespiratoryMotion
    model: LoopModel
    judgement: JudgementConfig
    prior: RingPrior
    turn: Array
    stretch: float
    stages: Stages = no_stages

    def is_enough(self, finding: Finding | None) -> bool:
        """Whether all planes in the pair show the loop, and agree on it."""
        return finding is not None and finding.rank[0] == 2 * len(self.times)

    @cached_property
    def is_edge_on(self) -> bool:
        """Whether all planes in the pair see the loop edge-on."""
        for image in self.images.values():
            pixels = image.projection.project(self.model.points)
            pixels -= pixels.mean(axis=0)
            narrow, wide = np.linalg.eigvalsh(pixels.T @ pixels)
            if narrow >= EDGE_ON_RATIO**2 * wide:
                return False
        return True


def judged(alignment: Alignment, look: Look) -> Finding:
    """What an alignment is worth, by what each plane shows, and whether the planes agree."""
    times, config = look.times, look.judgement
    seen = tuple(p for p, fit in alignment.planes.items() if is_seen(fit, config))
    faint: Plane | None = None
    if len(seen) < 2 and _is_near_and_faint(alignment, look):
        # Where the motion so far puts it, less has to be seen of it than elsewhere.
        weaker: Plane = min(PLANES, key=lambda p: alignment.planes[p].correlation)
        seen, faint = PLANES, weaker
    if len(seen) < 2:
        # What only one plane shows must be clear there.
        clear = tuple(p for p in seen if is_clearly_seen(alignment.planes[p], config))
        faint = _faint_plane(alignment, clear, look)
        return Finding(alignment, clear if faint is None else PLANES, faint, look.is_edge_on)
    a, b = alignment.planes["a"], alignment.planes["b"]
    trial = look.respiration.copy()
    with look.stages("filter"):
        trial.observe(times["a"], a=_observation(a, look.model))
        between = trial.expected_between(times["b"])
    rays = {p: alignment.planes[p].centre - look.images[p].projection.source for p in PLANES}
    gap, across = epipolar_gap(rays["a"], rays["b"], look.model.centre + between.displacement, b.centre)
    heartbeat = HEARTBEAT_SPEED_M_S * (times["b"] - times["a"])
    slack_mm = 1e3 * float(np.sqrt(across @ between.covariance @ across + heartbeat**2))
    return Finding(
        alignment,
        seen,
        faint,
        look.is_edge_on,
        1e3 * abs(gap),
        max(config.degraded_gap_mm, 2.5 * slack_mm),
        max(config.lost_gap_mm, 4.0 * slack_mm),
    )


def _is_near_and_faint(alignment: Alignment, look: Look) -> bool:
    """Whether both planes show something like the loop near where each is expected to."""
    if len(look.times) < 2:
        return False
    config = look.judgement
    if not all(
        is_faintly_seen(fit, config) and fit.visible >= config.smallest_visible for fit in alignment.planes.values()
    ):
        return False
    with look.stages("filter"):
        expected = {
            "a": look.respiration.predict(look.times["a"]).displacement,
            "b": look.respiration.expected_between(look.times["b"]).displacement,
        }
    return all(
        float(np.linalg.norm(fit.across @ (fit.centre - look.model.centre - expected[plane]))) < NEAR_M
        for plane, fit in alignment.planes.items()
    )


def _faint_plane(alignment: Alignment, clear: tuple[Plane, ...], look: Look) -> Plane | None:
    """The plane that shows the loop too weakly by itself, but just where the other says; None if there is none."""
    if len(clear) != 1 or len(look.times) < 2:
        return None
    faint, expected = foretold(clear[0], alignment, look)
    fit = alignment.planes[faint]
    if not is_faintly_seen(fit, look.judgement):
        return None
    residual = fit.across @ (fit.centre - look.model.centre - expected.displacement)
    spread = fit.across @ expected.covariance @ fit.across.T + _observation(fit, look.model).covariance
    surprise = squared_mahalanobis(residual, spread)
    foreseen = float(np.linalg.eigvalsh(spread)[-1]) <= FAINT_SPREAD_M**2
    return faint if foreseen and surprise <= FAINT_SURPRISE else None


def foretold(clear: Plane, alignment: Alignment, look: Look) -> tuple[Plane, Estimate]:
    """The other plane, and what it measures according to what a plane shows clearly and to the motion so far."""
    trial, observation = look.respiration.copy(), _observation(alignment.planes[clear], look.model)
    with look.stages("filter"):
        if clear == "a":
            trial.observe(look.times["a"], a=observation)
            return "b", trial.expected_between(look.times["b"])
        trial.mark_a(look.times["a"])
        trial.observe(look.times["b"], b=observation)
        return "a", trial.at_a


def _observation(fit: PlaneFit, model: LoopModel, *, edge_on: bool = False) -> Observation:
    """A plane's fit as a measurement of the displacement, with what the fit's own covariance leaves out."""
    systematic = EDGE_ON_M if edge_on else SYSTEMATIC_M
    covariance = IMAGE_COVARIANCE_FACTOR * fit.covariance + systematic**2 * np.eye(2)
    return Observation(fit.across, fit.across @ (fit.centre - model.centre), covariance)


def shows_nothing(alignment: Alignment, config: JudgementConfig) -> bool:
    """Whether no plane can be judged to show the loop: none by itself, nor one with the other's help."""
    likeness = alignment.likeness.values()
    return max(likeness) < config.smallest_likeness and min(likeness) < config.faint_likeness


def observe(
    respiration: RespiratoryMotion, finding: Finding, time_s: float, times: dict[Plane, float], model: LoopModel
) -> None:
    """Tell the filter of the motion what a finding has measured, each plane at its own time.

    Args:
        respiration: the filter, which is changed.
        finding: of one or two planes.
        time_s: of the pair: plane A's exposure, or what would have been it, seconds.
        times: of the exposures, seconds.
        model: the loop at the reference.
    """
    planes = finding.alignment.planes
    if "a" in finding.seen:
        respiration.observe(time_s, a=_observation(planes["a"], model, edge_on=finding.edge_on))
    respiration.mark_a(time_s)
    if "b" in finding.seen:
        respiration.observe(times["b"], b=_observation(planes["b"], model, edge_on=finding.edge_on))
