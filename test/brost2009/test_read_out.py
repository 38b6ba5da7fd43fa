"""The published method on a part of the detector's image: its pixel constants belong to the detector."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from support.tracking_inputs import LOOP, VIEWS, pair, seed

from lasso_motion_ros.brost2009.tracker import Brost2009Tracker
from lasso_motion_ros.config.brost2009 import RegistrationConfig
from lasso_motion_ros.config.tracker import TrackerConfig
from lasso_motion_ros.geometry.frames import PLANES, Frame, FramePair, Plane, Seed
from lasso_motion_ros.geometry.projection import Projection
from lasso_motion_ros.geometry.transforms import apply

PUBLISHED = TrackerConfig(method="brost2009")
TIED = replace(PUBLISHED, registration=RegistrationConfig(tie_break=0.05))
PATH = np.array([[0, 0, 0], [0.5, -1, 2.5], [1, -2, 6], [0.5, -1, 3]]) * 1e-3
CROP_PX = 320  # of 512: the region of interest, 200 pixels wide, still lies inside
CORNERS = {plane: np.rint(VIEWS[plane].project(LOOP.centre) - CROP_PX / 2).astype(int) for plane in PLANES}


def changed(whole: FramePair, change: Callable[[Plane, Frame], tuple[np.ndarray, Projection]]) -> FramePair:
    frames = {plane: Frame(whole.stamp_ns, *change(plane, frame)) for plane, frame in whole.frames.items()}
    return FramePair(whole.stamp_ns, frames["a"], frames["b"])


def crop(plane: Plane, frame: Frame) -> tuple[np.ndarray, Projection]:
    x, y = CORNERS[plane]
    pixels = np.ascontiguousarray(frame.pixels[y : y + CROP_PX, x : x + CROP_PX])
    return pixels, frame.projection.cropped(x, y, CROP_PX, CROP_PX)


def bin_by_two(plane: Plane, frame: Frame) -> tuple[np.ndarray, Projection]:
    height, width = frame.pixels.shape
    means = frame.pixels.reshape(height // 2, 2, width // 2, 2).mean(axis=(1, 3))
    return np.rint(means).astype(np.uint8), frame.projection.binned(2, 2)


def centres(pairs: list[FramePair], clicks: Seed, config: TrackerConfig) -> np.ndarray:
    """(N, 3) where the ring's centre is found, metres."""
    tracker = Brost2009Tracker(config)
    results = [tracker.initialise(pairs[0], clicks), *(tracker.track(one) for one in pairs[1:])]
    return np.array([apply(result.motion, LOOP.centre) for result in results])


@pytest.fixture(scope="module")
def whole() -> list[FramePair]:
    return [pair(index, translation) for index, translation in enumerate(PATH)]


@pytest.mark.parametrize("config", [PUBLISHED, TIED], ids=["published", "tie-break"])
def test_a_cropped_read_out_gives_the_same_motion(whole: list[FramePair], config: TrackerConfig) -> None:
    clicks = Seed(*(seed().points(plane) - CORNERS[plane] for plane in PLANES))
    found = centres([changed(one, crop) for one in whole], clicks, config)
    np.testing.assert_allclose(found, centres(whole, seed(), config), atol=1e-6)


def test_a_binned_read_out_gives_nearly_the_same_motion(whole: list[FramePair]) -> None:
    # As published the place within the level of equal costs is an accident of the pixels: up to a millimetre apart.
    clicks = Seed(*((seed().points(plane) - 0.5) / 2 for plane in PLANES))
    found = centres([changed(one, bin_by_two) for one in whole], clicks, TIED)
    np.testing.assert_allclose(found, centres(whole, seed(), TIED), atol=0.7e-3)
