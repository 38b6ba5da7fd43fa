import cv2
import numpy as np
import pytest

from lasso_motion_ros.ring.correlation import correlation


@pytest.mark.parametrize("beyond", [(0, 0, 0, 0), (9, 3, 5, 7), (0, 6, 12, 0), (-20, -2, -1, -5)])
@pytest.mark.parametrize(
    ("height", "width", "rows", "columns"), [(97, 131, 20, 33), (150, 150, 41, 41), (63, 50, 40, 30)]
)
def test_it_is_that_of_template_matching(height, width, rows, columns, beyond):
    """Also where the kernel hangs out of the image, or where only a part of the image is asked for."""
    random = np.random.default_rng(height)
    values = random.normal(size=(height, width)).astype(np.float32)
    kernel = random.normal(size=(rows, columns)).astype(np.float32)
    top, left, bottom, right = beyond
    around = cv2.copyMakeBorder(values, *(max(v, 0) for v in (top, bottom, left, right)), cv2.BORDER_CONSTANT)
    part = around[max(-top, 0) : around.shape[0] - max(-bottom, 0), max(-left, 0) : around.shape[1] - max(-right, 0)]
    expected = cv2.matchTemplate(part, kernel, cv2.TM_CCORR)
    found = correlation(values, kernel, (-left, -top), (width - columns + right, height - rows + bottom))
    np.testing.assert_allclose(found[: expected.shape[0], : expected.shape[1]], expected, atol=1e-3)
