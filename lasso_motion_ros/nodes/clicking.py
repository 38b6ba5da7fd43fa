"""A person's clicks on the pictures of a frozen pair, collected until they make a seed."""

from __future__ import annotations

import math
import threading

import numpy as np
import numpy.typing as npt

from lasso_motion_ros.core.errors import SeedError
from lasso_motion_ros.geometry.frames import PLANES, FramePair, Plane, Seed
from msg_adapters.seeds import MAXIMUM_CLICKS, MINIMUM_CLICKS

NOT_FROZEN = "a click was left out: the picture was not frozen (call ~/freeze first)"


class ClickBoard:
    """The frozen pair and the clicks on it; callbacks add clicks while a worker draws them, hence the lock."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._pair: FramePair | None = None
        self._clicks: dict[Plane, list[tuple[float, float]]] = {plane: [] for plane in PLANES}

    @property
    def pair(self) -> FramePair | None:
        """The pair that is frozen, or None."""
        return self._pair

    def freeze(self, pair: FramePair | None) -> None:
        """Show a pair from now on, without clicks; None: show the stream again."""
        with self._lock:
            self._pair = pair
            self._clicks = {plane: [] for plane in PLANES}

    def click(self, plane: Plane, x: float, y: float) -> None:
        """Take a click, pixels of the picture.

        Raises:
            SeedError: nothing is frozen, or the click is not in the picture.
        """
        with self._lock:
            frame = None if self._pair is None else self._pair.frame(plane)
            if frame is None:
                raise SeedError(NOT_FROZEN)
            height, width = frame.pixels.shape
            inside = math.isfinite(x) and math.isfinite(y) and -0.5 <= x < width - 0.5 and -0.5 <= y < height - 0.5
            if not inside or len(self._clicks[plane]) >= MAXIMUM_CLICKS:
                raise SeedError(f"a click at ({x:g}, {y:g}) was left out: the picture has {width}×{height} pixels")
            self._clicks[plane].append((x, y))

    def clicks(self, plane: Plane) -> npt.NDArray[np.float64]:
        """(N, 2) pixels, in the order clicked."""
        with self._lock:
            return np.array(self._clicks[plane], dtype=np.float64).reshape(-1, 2)

    def seed(self) -> Seed:
        """The clicks of both planes.

        Raises:
            SeedError: nothing is frozen, or there are too few.
        """
        if self._pair is None:
            raise SeedError("no pair is held: call ~/freeze, then click along the loop in both planes")
        points = {plane: self.clicks(plane) for plane in PLANES}
        for plane, clicked in points.items():
            if len(clicked) < MINIMUM_CLICKS:
                raise SeedError(
                    f"plane {plane.upper()}: expected {MINIMUM_CLICKS} or more clicks along the loop,"
                    f" found {len(clicked)}"
                )
        return Seed(points["a"], points["b"])
