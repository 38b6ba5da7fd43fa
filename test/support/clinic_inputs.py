"""A ring that lies still, for what the clinic suite says of it: no breath, no heartbeat, a small picture."""

import dataclasses
from functools import cache

from lasso_motion_ros.bench.suite.sequence import RenderedSequence, render_sequence
from lasso_motion_ros.phantom.settings import (
    BreathingSettings,
    GeometrySettings,
    HeartSettings,
    LassoSettings,
    Scenario,
)

STILL = Scenario(
    name="still",
    pairs=5,
    rate_hz=1.0,
    geometry=GeometrySettings(size_px=128),
    lasso=LassoSettings(normal=(0.27, -0.73, 0.62), turns=0.98),
    breathing=BreathingSettings(amplitude_mm=0.0),
    heart=HeartSettings(amplitude_mm=0.0),
    exact_place=True,
)


SHORT = dataclasses.replace(STILL, pairs=3, geometry=GeometrySettings(size_px=512))


@cache
def short() -> RenderedSequence:
    """Three pairs at 512²; rendered once, so not to be changed."""
    return render_sequence(SHORT)
