"""Pictures put together: nothing is stretched, nothing covered."""

import numpy as np

from lasso_motion_ros.reports.picture_grid import STRIP_PX, below_each_other, beside, fitted, missing_cell, text_strip


def grey(height, width, value):
    return np.full((height, width, 3), value, dtype=np.uint8)


def test_a_picture_fits_its_cell_without_being_stretched():
    wide = fitted(grey(50, 100, 200), 60, 40)
    assert wide.shape == (40, 60, 3)
    assert (wide[:30] == 200).all()  # 50 of 100 become 30 of 60
    assert not wide[30:].any()
    same = grey(40, 60, 7)
    np.testing.assert_array_equal(fitted(same, 60, 40), same)


def test_gaps_are_between_pictures_only():
    row = beside([grey(4, 3, 10), grey(4, 2, 20)], gap_px=2, shade=255)
    assert row[0, :, 0].tolist() == [10, 10, 10, 255, 255, 20, 20]
    column = below_each_other([grey(2, 3, 10), grey(1, 3, 20)], gap_px=1)
    assert column[:, 0, 0].tolist() == [10, 10, 0, 20]


def test_words_that_are_too_long_stay_in_their_strip():
    strip = text_strip("a reason that goes on " * 10, 200)
    assert strip.shape == (STRIP_PX, 200, 3)
    written = np.flatnonzero((strip != strip[0, 0]).any(axis=(0, 2)))
    assert written.size > 0
    assert written.max() < 195
    assert missing_cell(80, 60, "no image").shape == (60, 80, 3)
