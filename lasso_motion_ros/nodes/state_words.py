"""The tracker's state in words, as diagnostics and log say it."""

from __future__ import annotations

from lasso_motion_ros.tracking.tracker import TrackerState
from msg_adapters.topics import LAST_POSE_WORDS


def state_words(state: TrackerState, reason: str, pose_age_s: float | None) -> str:
    """State, reason and, where there is a model but no pose, how old the last one is, in a line."""
    words = f"{state.value}: {reason}" if reason else state.value
    age = last_pose_words(pose_age_s) if state.is_alarm else ""
    return f"{words}{LAST_POSE_WORDS}{age}" if age else words


def last_pose_words(age_s: float | None) -> str:
    """How long ago the last pose was, in words; empty where there was none."""
    if age_s is None:
        return ""
    return f"{age_s:.1f} s ago" if age_s < 60.0 else f"{age_s / 60.0:.0f} min ago"
