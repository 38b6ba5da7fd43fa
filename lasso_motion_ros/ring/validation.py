"""What is asked of the most probable detection before a pose rests on it, and the words for what is not met."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from lasso_motion_ros.config.ring import JudgementConfig
from lasso_motion_ros.geometry.covariance import largest_sigma
from lasso_motion_ros.geometry.frames import PLANES, FramePair, Plane
from lasso_motion_ros.ring.association import Association, Hypothesis
from lasso_motion_ros.ring.track import Track
from lasso_motion_ros.ring.track_state import StateTuning
from lasso_motion_ros.tracking.tracker import TrackerState

Array = npt.NDArray[np.float64]

SHOWN = 1.0  # of evidence: a plane that shows less shows nothing like the ring
MOVED_C_ARM = "moved C-arm without a new calibration?"
OTHER_PLACES = "other places look nearly as much like the lasso"


@dataclass(frozen=True)
class ValidationTuning:
    """When the most probable detection is not the ring after all."""

    degraded_slacks: float = 2.5  # the planes may disagree so many times by what moved between their exposures
    lost_slacks: float = 4.0
    faint_share: float = (
        0.7  # of the support that is usual: less is shown where a plane's geometry is not as it says, too
    )
    left_share: float = 0.5  # of it: with less it is not believed to be all there (docs/constants.md)
    # Where the filter is undone no ghost is left, but before it is recognised, and after an image that did not come.
    ghost_contrast: float = 0.55  # of when it was last seen: what a filter over time leaves of a ring that has gone


def refusal(
    track: Track,
    association: Association,
    pair: FramePair,
    limits: JudgementConfig,
    tuning: ValidationTuning,
    states: StateTuning,
) -> str:
    """Why nothing in the pair is believed to be the ring, wherever it lies; empty if the best detection is."""
    best = association.best
    if best is not None and _stand_apart(best, limits, tuning) and (best.believed >= states.pose or _both_show(best)):
        return f"the planes disagree by {abs(best.gap_mm):.1f} mm: {MOVED_C_ARM}"
    if best is None or best.believed < states.pose:
        return _unseen(association, pair)
    return _unlike(track, best, limits, tuning, states)


def shows_looks(
    track: Track, best: Hypothesis, limits: JudgementConfig, tuning: ValidationTuning, states: StateTuning
) -> bool:
    """Whether what a detection shows is learned to be how the ring looks, whether a pose rests on it or not."""
    is_ring = best.believed * (1.0 - best.alike) * (1.0 - track.contradiction.probability)
    return (
        best.is_whole
        and is_ring >= states.learned
        and track.belief.elsewhere <= states.displaced
        and not _stand_apart(best, limits, tuning)
        and not _unlike(track, best, limits, tuning, states)
        and not fading(track, best, tuning)
    )


def _unlike(
    track: Track, best: Hypothesis, limits: JudgementConfig, tuning: ValidationTuning, states: StateTuning
) -> str:
    """Why a detection is not the ring as it is known; empty if it may be."""
    shown = best.detection.support / track.usual_support
    if best.is_whole and shown < tuning.left_share:
        return f"plane {_weaker(best)} hardly shows the lasso: {100 * shown:.0f} % of what is usual is left"
    turned_deg = _turned_deg(track, best)
    is_elsewhere = track.belief.elsewhere > states.displaced  # a ring that was moved may lie as it likes
    if turned_deg > limits.lost_turn_deg * track.own_turn.excess and best.is_whole and not is_elsewhere:
        return f"the lasso is turned by {turned_deg:.0f} degrees: {MOVED_C_ARM}"
    return ""


def unforeseen(best: Hypothesis, limits: JudgementConfig, tuning: ValidationTuning, states: StateTuning) -> str:
    """Why a detection may be something that is just like the ring; empty if it is where motion foretold the ring."""
    if best.believed * (1.0 - best.alike) >= states.pose:
        return ""
    if _disagree(best, limits, tuning):
        return f"the planes disagree by {abs(best.gap_mm):.1f} mm: {MOVED_C_ARM}"
    return "it is far from where it was foretold: something else that looks like it?"


def left_behind(track: Track, departure: float, states: StateTuning) -> str:
    """That a ring is elsewhere by what moves with the heart beside it alone; empty if it has left its breathing.

    Args:
        track: all that is known, this pair included.
        departure: how far it is from breathing, standard deviations.
        states: how far off it is as likely displaced as in place.
    """
    is_told = track.companions.deny or track.joined_slide.beyond(states.misleading_m) > 0.5
    if departure >= states.elsewhere_sigmas or not is_told:
        return ""
    return "it has left what moves with the heart beside it, or that was moved"


def out_of_place(track: Track, departure: float, states: StateTuning) -> str:
    """Why a ring that is believed to be seen is not surely in its place; arguments as of `left_behind`."""
    if track.belief.absent > track.belief.elsewhere:
        return "it has come into view again: the next pair tells whether it is back in its place"
    far = f"{departure:.1f} times as far from breathing as breaths are apart"
    return left_behind(track, departure, states) or far


def contradiction(track: Track, states: StateTuning) -> str:
    """Why no pose rests on a ring that is seen: one plane shows something else, far enough off to mislead; or empty."""
    planes = track.contradiction
    is_likely = planes.probability > 1.0 - states.pose
    return planes.text if is_likely and planes.size_mm > states.misleading_mm else ""


def drawn_in(track: Track, states: StateTuning) -> str:
    """Why what is left of a ring carries no pose: a part of it is gone; empty if it is whole."""
    return track.withdrawal.text if track.withdrawal.probability > 1.0 - states.pose else ""


def misleading(
    track: Track, position: Array, association: Association, best: Hypothesis, states: StateTuning
) -> tuple[float, str]:
    """Probability that a pose is off by so much that it misleads, and what speaks for that most.

    Args:
        track: all that is known; whether it slides by what this pair shows.
        position: (3, 3) m² of the pose, all places considered.
        association: those places.
        best: the one that the pose is of.
        states: how far off misleads.
    """
    limit_m = states.misleading_m
    # A place far off is as wrong as can be, however far, and only as probable as it is: no normal deviate.
    elsewhere = 1.0 - best.believed
    near = position - association.spread_beyond(limit_m)
    sigma_mm = 1e3 * largest_sigma(near)
    # Where one plane is alone, what is known of its depth is not the filters'.
    across = np.eye(3)
    if not best.is_whole:
        (alone,) = best.detection.planes.values()
        across -= np.outer(alone.ray, alone.ray)
    motion = track.motion
    vague = motion.beyond(limit_m, near - across @ motion.at_a.covariance @ across, across)
    # Companions know of all directions, but along the ray of a plane that alone shows them: of that its own past tells.
    # Where they have been lost since, what they last told still counts if it was a slide; a doubt that nobody can take
    # back does not: it would last for good.
    companions, own = track.joined_slide, track.slide
    if companions.is_told:
        own = companions.hidden(own)
    slid, told = own.beyond(limit_m), companions.beyond(limit_m)
    by = f"{1e3 * own.across_m:.1f} mm across its breathing, and perhaps more along it"
    if told >= slid if companions.is_told else told > max(slid, 0.5):
        slid = told
        by = f"{1e3 * companions.size_m:.1f} mm from what moves with the heart beside it"
    why = {
        f"it seems to slide: {by}": slid,
        f"its place is known to {sigma_mm:.1f} mm only": vague,
        OTHER_PLACES if elsewhere > 2.0 * association.absent else _faint(best): elsewhere,
    }
    return 1.0 - (1.0 - vague) * (1.0 - slid) * (1.0 - elsewhere), max(why, key=lambda text: why[text])


def fading(track: Track, best: Hypothesis, tuning: ValidationTuning) -> str:
    """Why a detection is only what a filter over time has left of the ring; empty if it is the ring."""
    shares = [fit.contrast / track.contrast[plane] for plane, fit in best.detection.planes.items()]
    left = sum(shares) / len(shares)
    if left < tuning.ghost_contrast:
        text = f"only {100 * left:.0f} % of its contrast is left"
        return f"{text}: gone, and still in the images' filter over time?"
    return ""


def quality(
    track: Track,
    best: Hypothesis,
    pair: FramePair,
    limits: JudgementConfig,
    tuning: ValidationTuning,
    states: StateTuning,
) -> tuple[TrackerState, str]:
    """TRACKING, or DEGRADED and why, for a detection of the ring in its place."""
    planes = best.detection.planes
    if not best.is_whole:
        other: Plane = "b" if "a" in planes else "a"
        why = "missing" if pair.frame(other) is None else "does not reach as far as the lasso"
        return TrackerState.DEGRADED, f"plane {other.upper()} {why}: depth from the breathing so far"
    if (turned_deg := _turned_deg(track, best)) > limits.degraded_turn_deg * track.own_turn.excess:
        return (
            TrackerState.DEGRADED,
            f"the lasso is turned by {turned_deg:.0f} degrees, by the heartbeat or a moved C-arm",
        )
    if _disagree(best, limits, tuning):
        return TrackerState.DEGRADED, f"the planes disagree by {abs(best.gap_mm):.1f} mm"
    if track.contradiction.probability > 1.0 - states.tracking:
        return TrackerState.DEGRADED, track.contradiction.text
    if track.withdrawal.probability > 1.0 - states.tracking:
        return TrackerState.DEGRADED, track.withdrawal.text
    if track.agreement.doubt:
        return TrackerState.DEGRADED, track.agreement.doubt
    if track.belief.in_place < states.tracking:
        return TrackerState.DEGRADED, "it is not sure yet that it is in its place"
    weak = _weaker(best)
    if best.believed < states.tracking:
        return TrackerState.DEGRADED, _faint(best)
    if best.detection.support < tuning.faint_share * track.usual_support:
        return TrackerState.DEGRADED, f"plane {weak} shows less of the lasso than it did"
    return TrackerState.TRACKING, ""


def _stand_apart(best: Hypothesis, limits: JudgementConfig, tuning: ValidationTuning) -> bool:
    """Whether the planes disagree so much that no pose may rest on them."""
    return abs(best.gap_mm) > max(limits.lost_gap_mm, tuning.lost_slacks * best.slack_mm)


def _both_show(best: Hypothesis) -> bool:
    """Whether each plane shows something like the ring, believed to be it or not."""
    return best.is_whole and min(fit.evidence for fit in best.detection.planes.values()) >= SHOWN


def _weaker(best: Hypothesis) -> str:
    """Name of the plane that shows less of it."""
    return min(best.detection.planes, key=lambda plane: best.detection.planes[plane].evidence).upper()


def _faint(best: Hypothesis) -> str:
    return f"plane {_weaker(best)} shows the lasso only faintly"


def _unseen(association: Association, pair: FramePair) -> str:
    best = association.best
    if best is None or len(pair.frames) < len(PLANES):
        return "the lasso is not seen"
    evidence = {plane: fit.evidence for plane, fit in best.detection.planes.items()}
    weak = min(PLANES, key=lambda plane: evidence.get(plane, -1.0))
    if max(evidence.values()) < SHOWN:
        return "the lasso is not seen"
    has_rival = len(association.hypotheses) > 1 and association.hypotheses[1].probability > association.absent
    if has_rival and evidence.get(weak, -1.0) >= SHOWN:
        return OTHER_PLACES
    strong = max(PLANES, key=lambda plane: evidence.get(plane, -1.0))
    return f"plane {weak.upper()} does not show the lasso where plane {strong.upper()} has it"


def _disagree(best: Hypothesis, limits: JudgementConfig, tuning: ValidationTuning) -> bool:
    """Whether the planes disagree so much that it is a doubt."""
    return abs(best.gap_mm) > max(limits.degraded_gap_mm, tuning.degraded_slacks * best.slack_mm)


def _turned_deg(track: Track, best: Hypothesis) -> float:
    return float(np.degrees(np.linalg.norm(track.turn_of(best))))
