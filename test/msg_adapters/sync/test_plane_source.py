"""Between what is published and what is tracked: pixels of the crop, and the time of the exposure."""

from __future__ import annotations

import numpy as np
from support.drawn_recording import projections

from lasso_motion_ros.config.parameters import configuration_from_values
from lasso_motion_ros.config.stream import StreamConfig
from msg_adapters.crop import Crop
from msg_adapters.sync.plane_source import PlaneSource, plane_sources

SOURCE = PlaneSource(Crop(100, 30, 400, 300), 80_000_000)
POINT = np.array([[0.01, 0.02, -0.005]])


def test_each_way_is_the_inverse_of_the_other() -> None:
    clicks = np.array([[150.0, 40.5], [499.0, 329.0]])
    assert SOURCE.in_crop(clicks).tolist() == [[50.0, 10.5], [399.0, 299.0]]
    assert np.array_equal(SOURCE.in_picture(SOURCE.in_crop(clicks)), clicks)
    assert SOURCE.exposure_ns(SOURCE.published_ns(10**18)) == 10**18
    assert SOURCE.exposure_ns(10**18) == 10**18 - 80_000_000
    assert SOURCE.exposure_ns(0) == SOURCE.published_ns(0) == 0


def test_a_calibration_is_of_the_picture_or_of_the_field_as_its_size_says() -> None:
    whole = projections()["a"]
    field = whole.cropped(100, 30, 400, 300)
    for calibration in (whole, field):
        found = SOURCE.projection(calibration, (whole.height, whole.width))
        assert (found.width, found.height) == (400, 300)
        np.testing.assert_allclose(found.project(POINT), whole.project(POINT) - [100.0, 30.0], atol=1e-9)
        back = SOURCE.picture_projection(calibration, (whole.height, whole.width))
        np.testing.assert_allclose(back.project(POINT), whole.project(POINT), atol=1e-9)


def test_the_parameters_are_each_planes_own() -> None:
    values = {"plane_a.crop": "[100, 30, 400, 300]", "plane_a.stamp_offset_s": 0.08}
    assert plane_sources(configuration_from_values(StreamConfig, values)) == {"a": SOURCE, "b": PlaneSource()}
