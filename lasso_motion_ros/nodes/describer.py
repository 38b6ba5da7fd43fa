"""Works out what the images show of the catheter while the tracker has nothing else to do."""

from __future__ import annotations

from collections.abc import Iterator

from lasso_motion_ros.tracking.tracker import Description


class Describer:
    """Goes on with the newest description, step by step; used by one thread."""

    def __init__(self) -> None:
        self._described: Description | None = None
        self._steps: Iterator[None] = iter(())

    def step(self, described: Description | None) -> bool:
        """Do the next step of a description's work; whether there was one to do."""
        if described is not self._described:
            self._described, self._steps = described, iter(()) if described is None else described.work()
        return next(self._steps, self) is not self
