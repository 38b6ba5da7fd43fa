"""What the planes' disagreement at the seed says: measured, in doubt, refused, swapped; and kept as geometry."""

import copy
import dataclasses
from functools import cache

import numpy as np
import pytest
from support.breathing_lasso import CONFIG, DEGRADED, TRACKING, centre_error_mm, moved
from support.lasso_inputs import CURVE, LOOP, VIEWS, lasso_image, lasso_pair, lasso_seed, noisy
from support.method_inputs import plane

from lasso_motion_ros.core.errors import SeedError
from lasso_motion_ros.geometry.frames import Frame, FramePair, Seed
from lasso_motion_ros.ring.tracker import RingTracker


def lifted(index, lift_mm, late_ns=0):
    """A pair in which plane B's matrix is that of a detector higher by so much, at the loop."""
    seen, view = lasso_pair(index, moved(index)), VIEWS["b"]
    off = view.shifted(0.0, -lift_mm / view.millimetres_per_pixel(LOOP.centre))
    return FramePair(seen.stamp_ns, seen.a, dataclasses.replace(seen.b, projection=off, stamp_ns=late_ns))


def seeded(pair, seed=None):
    tracker = RingTracker(CONFIG)
    return tracker, tracker.initialise(pair, lasso_seed() if seed is None else seed)


@cache
def seeded_when_lifted(lift_mm):
    return seeded(lifted(0, lift_mm))


@pytest.mark.parametrize("lift_mm", [0.0, 1.0, 3.0, -5.0])
def test_the_disagreement_is_measured_in_millimetres_at_the_ring(lift_mm):
    _, result = seeded_when_lifted(lift_mm)
    assert result.seed_gap_mm == pytest.approx(abs(lift_mm), abs=0.25)


@pytest.mark.slow
def test_from_two_millimetres_on_every_pose_says_that_it_is_in_doubt():
    tracker, result = copy.deepcopy(seeded_when_lifted(3.0))
    assert result.state is DEGRADED
    assert result.reason.startswith("the planes disagree by 3.")
    plain, _ = copy.deepcopy(seeded_when_lifted(0.0))
    for index in (1, 2, 3):
        result, other = tracker.track(lifted(index, 3.0)), plain.track(lifted(index, 0.0))
        assert result.state is DEGRADED
        assert "disagree by 3." in result.reason
        assert other.state is TRACKING


def test_more_than_any_usable_calibration_is_refused():
    with pytest.raises(SeedError, match=r"disagree by 1\d\.\d mm at the seed: wrong calibration"):
        seeded(lifted(0, 12.0))


@pytest.mark.slow
def test_a_breath_between_the_exposures_is_no_wrong_calibration():
    # In a sixth of a second breathing usually goes 2.5 mm.
    _, result = seeded(lifted(0, 3.5, late_ns=167_000_000))
    assert result.state is TRACKING
    _, result = seeded(lifted(0, 6.0, late_ns=167_000_000))
    assert result.state is DEGRADED


@pytest.mark.parametrize(("cranial_a", "cranial_b"), [(25.0, -20.0), (20.0, 0.0), (0.0, 0.0)])
def test_swapped_calibrations_are_named(cranial_a, cranial_b):
    # Away from the iso-centre, so that an exchange shows.
    views = {"a": plane(-30.0, cranial_a, side=512), "b": plane(60.0, cranial_b, side=512)}
    curve = CURVE + np.array([0.03, 0.0, 0.02])
    frames = [Frame(0, noisy(lasso_image(curve, views[p]), 5), views[q]) for p, q in (("a", "b"), ("b", "a"))]
    points = curve[np.linspace(0, len(curve) - 1, 12).astype(int)]
    with pytest.raises(SeedError, match="A and B exchanged: are they swapped"):
        seeded(FramePair(0, *frames), Seed(*(views[p].project(points) for p in "ab")))


@pytest.mark.parametrize("binning", [(2, 2), (2, 1)])
def test_what_was_absorbed_stays_where_it_is_when_the_read_out_changes(binning):
    tracker, _ = copy.deepcopy(seeded_when_lifted(1.5))
    plain, _ = copy.deepcopy(seeded_when_lifted(0.0))

    def read_out(pair):
        x, y = binning
        frames = {}
        for name, frame in pair.frames.items():
            height, width = frame.pixels.shape
            pixels = frame.pixels.reshape(height // y, y, width // x, x).mean(axis=(1, 3)).round().astype(np.uint8)
            frames[name] = Frame(frame.stamp_ns, pixels, frame.projection.binned(x, y))
        return FramePair(pair.stamp_ns, frames["a"], frames["b"])

    result, other = tracker.track(read_out(lifted(1, 1.5))), plain.track(read_out(lifted(1, 0.0)))
    assert result.motion is not None
    assert centre_error_mm(result, moved(1)) < centre_error_mm(other, moved(1)) + 0.15
