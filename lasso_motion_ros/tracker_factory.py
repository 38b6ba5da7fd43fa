"""The tracker that a configuration names."""

from __future__ import annotations

from lasso_motion_ros.appearance_tracker import AppearanceTracker
from lasso_motion_ros.brost2009 import Brost2009Tracker
from lasso_motion_ros.configuration import TrackerConfig
from lasso_motion_ros.tracker import Tracker


def create_tracker(config: TrackerConfig) -> Tracker:
    """A new tracker of the configured method."""
    if config.method == "brost2009":
        return Brost2009Tracker(config)
    return AppearanceTracker(config)
