"""Thread pools are held at one while something is measured."""

import cv2
import numpy as np
from threadpoolctl import threadpool_info

from lasso_motion_ros.core.one_thread import one_thread


def test_thread_pools_are_held_at_one_and_let_go() -> None:
    np.linalg.inv(np.eye(3))  # loads the linear algebra whose pool is meant
    before = cv2.getNumThreads()
    with one_thread():
        assert cv2.getNumThreads() == 1
        assert {pool["num_threads"] for pool in threadpool_info()} == {1}
    assert cv2.getNumThreads() == before
