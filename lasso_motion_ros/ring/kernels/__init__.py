"""The compiled kernels of our method, all of them at once, so that no pair waits for one: see `core/compiled.py`."""

from lasso_motion_ros.ring.kernels import alignment, band, blur, display, search, seed, slide

__all__ = ["alignment", "band", "blur", "display", "search", "seed", "slide"]
