"""The tracker that a configuration names."""

from __future__ import annotations

from lasso_motion_ros.brost2009.tracker import Brost2009Tracker
from lasso_motion_ros.config.tracker import TrackerConfig
from lasso_motion_ros.ring.tracker import RingTracker
from lasso_motion_ros.stream.kernels import load_kernels
from lasso_motion_ros.tracking.stages import Stages, no_stages
from lasso_motion_ros.tracking.tracker import Tracker


def create_tracker(config: TrackerConfig, stages: Stages = no_stages) -> Tracker:
    """A new tracker of the configured method.

    Where the extra `fast` is installed, its kernels are ready afterwards, so that no pair waits for one.

    Args:
        config: the parameters.
        stages: told of each stage of the tracker's work on a pair.
    """
    load_kernels()
    if config.method == "brost2009":
        return Brost2009Tracker(config, stages)
    return RingTracker(config, stages)
