"""Words and curves drawn into a picture."""

import numpy as np

from lasso_motion_ros.overlay import primitives


def test_words_fit_the_picture_and_unusual_characters_become_plain():
    long = "a reason that goes on " * 10
    line = primitives.fit_text(long, 0.5, 300)
    assert line.endswith("...")
    assert primitives.text_size(line, 0.5)[0] <= 300
    assert primitives.text_size("±2° – 3 mm…", 0.5) == primitives.text_size("+/-2 deg - 3 mm...", 0.5)
    picture = np.zeros((64, 256, 3), np.uint8)
    primitives.draw_curve(picture, np.array([[np.nan, 0.0], [1e12, 5.0]]), (255, 0, 0))
    assert not picture.any()
