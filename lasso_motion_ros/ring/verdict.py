"""What is said of a finding, in plain words: why it carries no pose, or one that is DEGRADED."""

from __future__ import annotations

from lasso_motion_ros.config.ring import JudgementConfig
from lasso_motion_ros.geometry.frames import FramePair, Plane
from lasso_motion_ros.ring.finding import Finding
from lasso_motion_ros.tracking.tracker import TrackerState

FAINT_AGAIN_GAP_MM = 0.6  # after a loss a plane may show the lasso faintly where both agree as well as this


def refusal_of(finding: Finding, pair: FramePair, *, followed: bool) -> str:
    """Why what was found carries no pose, wherever it is; empty if it may.

    Args:
        finding: what was found; at least one plane shows it.
        pair: where it was found.
        followed: whether what was found in the pair before was believed.
    """
    if finding.gap_mm > finding.lost_gap_mm:
        return f"the planes disagree by {finding.gap_mm:.1f} mm: moved C-arm without a new calibration?"
    if finding.faint is not None and not followed and finding.gap_mm > FAINT_AGAIN_GAP_MM:
        return f"plane {finding.faint.upper()} shows the lasso only faintly, and not quite where the other does"
    if len(finding.seen) == 2:
        return ""
    other = _other_plane(finding)
    if other not in pair.missing:
        # What the other plane shows cannot tell which.
        text = f"plane {other.upper()} does not show the lasso"
        return f"{text}: hidden there, or moved C-arm without a new calibration?"
    return "" if followed else f"plane {other.upper()} missing: after a loss both have to show the lasso"


def state_of(
    finding: Finding,
    pair: FramePair,
    config: JudgementConfig,
    *,
    alone_s: float,
    turned_deg: float,
) -> tuple[TrackerState, str]:
    """TRACKING; or DEGRADED or LOST and why.

    Args:
        finding: what was found, and not refused.
        pair: where it was found.
        config: limits.
        alone_s: since both planes showed it last, seconds.
        turned_deg: angle between the ring and how it belongs, degrees.
    """
    if len(finding.seen) == 1:
        other = _other_plane(finding)
        missing = "missing" if other in pair.missing else "without a sight of the lasso"
        if alone_s > config.one_plane_s:
            return TrackerState.LOST, f"plane {other.upper()} {missing} for {alone_s:.1f} s"
        return TrackerState.DEGRADED, f"plane {other.upper()} {missing}: depth from the breathing so far"
    if turned_deg > config.degraded_turn_deg:
        lost = turned_deg > config.lost_turn_deg
        reason = f"the lasso is turned by {turned_deg:.0f} degrees: moved C-arm without a new calibration?"
        return (TrackerState.LOST if lost else TrackerState.DEGRADED), reason
    if finding.faint is not None:
        text = f"plane {finding.faint.upper()} shows the lasso only faintly"
        return TrackerState.DEGRADED, f"{text}: noise, or moved C-arm without a new calibration?"
    if finding.edge_on:
        return TrackerState.DEGRADED, "the lasso is seen edge-on in both planes"
    visible = min(finding.alignment.planes[plane].visible for plane in finding.seen)
    if visible < config.full_visible:
        return TrackerState.DEGRADED, f"only {100 * visible:.0f} % of the lasso is seen"
    if finding.gap_mm > finding.degraded_gap_mm:
        return TrackerState.DEGRADED, f"the planes disagree by {finding.gap_mm:.1f} mm"
    return TrackerState.TRACKING, ""


def _other_plane(finding: Finding) -> Plane:
    """The plane that is not the one which alone shows the loop."""
    return "b" if finding.seen == ("a",) else "a"
