"""A ring that the heart has drawn in since the seed pair is looked for as small as it is then."""

import pytest

from lasso_motion_ros.config.tracker import TrackerConfig
from lasso_motion_ros.geometry.frames import Seed
from lasso_motion_ros.phantom import Simulator
from lasso_motion_ros.phantom.settings import (
    BreathingSettings,
    ClickSettings,
    DistractorSettings,
    GeometrySettings,
    HeartSettings,
    ImagingSettings,
    LassoSettings,
    Scenario,
)
from lasso_motion_ros.ring.detector import DetectorTuning
from lasso_motion_ros.ring.ring_options import RingOptions
from lasso_motion_ros.ring.tracker import RingTracker
from lasso_motion_ros.tracking.tracker import TrackerState

# A wide ring of which a quarter lies double; its electrodes keep their distances, so that they slip along it.
DRAWN_IN = Scenario(
    pairs=2,
    rate_hz=2.0,
    seed=0,
    geometry=GeometrySettings(size_px=512, field_mm=143.0),
    lasso=LassoSettings(
        diameter_mm=24.5, normal=(0.2, -0.9, 0.4), turns=1.2, helix_mm=2.2, electrodes=20, stretch=0.03
    ),
    breathing=BreathingSettings(amplitude_mm=3.0),
    heart=HeartSettings(rate_bpm=60.0, variability=0.0, amplitude_mm=0.0),
    imaging=ImagingSettings(quanta=100.0),
    distractors=DistractorSettings(coronary_sinus=False, ablation=False),
    clicks=ClickSettings(noise_px=0.7),
)


@pytest.fixture(scope="module")
def drawn_in():
    """Two pairs, half a beat apart, and the clicks on the first."""
    simulator = Simulator(DRAWN_IN)
    swings = [simulator.motion.heartbeat.swing(simulator.time_s(pair, "a"))[1] for pair in range(2)]
    assert DRAWN_IN.lasso.stretch * (swings[1] - swings[0]) < -0.055  # of its size
    clicks = simulator.seeds()
    return [pair.images for pair in simulator.pairs()], Seed(clicks["a"], clicks["b"])


@pytest.mark.parametrize("sizes", [DetectorTuning().sizes, ()])
def test_a_ring_that_the_heart_has_drawn_in_is_found_by_its_size(drawn_in, sizes):
    (first, second), seed = drawn_in
    tracker = RingTracker(TrackerConfig(), options=RingOptions(detector=DetectorTuning(sizes=sizes)))
    tracker.initialise(first, seed)
    result = tracker.track(second)
    assert (result.state, result.reason) == (
        (TrackerState.TRACKING, "") if sizes else (TrackerState.LOST, "the lasso is not seen")
    )
