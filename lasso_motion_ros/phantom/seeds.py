"""A user's clicks along the loop."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from lasso_motion_ros.phantom.settings import ClickSettings

Array = npt.NDArray[np.float64]


def clicks_along_loop(
    curve: Array, turns: float, random: np.random.Generator, settings: ClickSettings | None = None
) -> Array:
    """Clicks in order along one turn of the loop, their number, start and direction at random.

    A user clicks what is seen as a ring once round; of a loop that is clearly open, from one end to the other.

    Args:
        curve: (N, 2) the projected centreline, pixels, evenly spaced over `turns` turns.
        turns: how often the loop goes round.
        random: draws number, start, direction and noise.
        settings: how many, and how noisy; the defaults if not given.

    Returns:
        (fewest…most, 2) pixels.
    """
    settings = settings or ClickSettings()
    count = int(random.integers(settings.fewest, settings.most + 1))
    # Positions in turns along the curve.
    if turns < 0.93:
        at = np.linspace(0.02, 0.98, count) * turns
    else:
        spare = max(turns - 1.0, 0.0)
        at = random.uniform(0.0, 1.0) + np.arange(count) / count
        at = np.minimum(np.mod(at, 1.0), turns) if spare == 0.0 else spare * random.uniform() + np.mod(at, 1.0)
    spacing = turns / len(curve) / 2.0
    at = at + random.uniform(-0.2, 0.2, count) / count
    index = np.clip(at, spacing, turns - spacing) / turns * (len(curve) - 1)
    clicks = np.stack([np.interp(index, np.arange(len(curve)), curve[:, axis]) for axis in range(2)], axis=1)
    if random.integers(2):
        clicks = clicks[::-1]
    return np.asarray(clicks + random.normal(0.0, settings.noise_px, clicks.shape))
