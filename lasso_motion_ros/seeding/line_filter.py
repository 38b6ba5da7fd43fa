"""Vesselness: how much each pixel looks like a point of a dark line, by the multi-scale filter of Sato et al.

A second filter belongs here, with the same arguments and the same kind of response; its callers, the published method's
features, the polarity of the clicks, the path between them and the curve along the wire, then choose between them.
There is no parameter for that yet. Our method uses a line filter at the seed only.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import cv2
import numpy as np
import numpy.typing as npt

Image = npt.NDArray[np.float32]


@dataclass(frozen=True)
class _Tuning:
    """How exactly the filter is sampled.

    Attributes:
        kernel_sigmas: half the kernels' width, in units of their scale: beyond, a Gaussian has no weight to speak of.
    """

    kernel_sigmas: float = 3.5


TUNING = _Tuning()


def sato(image: npt.NDArray[np.generic], sigmas: Iterable[float]) -> Image:
    """Response to dark lines: the largest positive eigenvalue of the scale-normalised Hessian over all scales.

    Two-dimensional form of Sato et al., Medical Image Analysis 2(2), 1998: at a dark line the second
    derivative across it is positive. Bright lines: pass the negated image.

    Args:
        image: (H, W), any real type.
        sigmas: scales (Gaussian standard deviations), pixels.

    Returns:
        (H, W) float32, ≥ 0, in the image's grey levels.
    """
    image32 = np.asarray(image, dtype=np.float32)
    response = np.zeros_like(image32)
    for sigma in sigmas:
        np.maximum(response, _largest_eigenvalue(image32, sigma), out=response)
    return response


def _largest_eigenvalue(image: Image, sigma: float) -> Image:
    smooth, first, second = _gaussian_kernels(sigma)
    # Correlation, not convolution: the odd kernel's sign cancels in both even combinations used.
    xx = cv2.sepFilter2D(image, cv2.CV_32F, second, smooth, borderType=cv2.BORDER_REFLECT_101)
    yy = cv2.sepFilter2D(image, cv2.CV_32F, smooth, second, borderType=cv2.BORDER_REFLECT_101)
    xy = cv2.sepFilter2D(image, cv2.CV_32F, first, first, borderType=cv2.BORDER_REFLECT_101)
    # λ = (xx + yy)/2 + √(((xx − yy)/2)² + xy²), in place: the images are large and this is the hot path.
    half_sum = cv2.addWeighted(xx, 0.5, yy, 0.5, 0.0)
    half_difference = cv2.addWeighted(xx, 0.5, yy, -0.5, 0.0)
    return np.asarray(cv2.add(half_sum, cv2.magnitude(half_difference, xy)))


def _gaussian_kernels(sigma: float) -> tuple[Image, Image, Image]:
    """Sampled Gaussian and its σ-normalised first and second derivatives, exact on polynomials."""
    radius = int(np.ceil(TUNING.kernel_sigmas * sigma))
    x = np.arange(-radius, radius + 1, dtype=np.float64)
    gauss = np.exp(-0.5 * (x / sigma) ** 2)
    gauss /= gauss.sum()
    first = x * gauss
    first *= sigma / (first @ x)  # responds with σ·1 to the ramp x
    second = (x**2 / sigma**2 - 1.0) * gauss
    second -= gauss * second.sum()  # none to a constant,
    second *= 2.0 * sigma**2 / (second @ x**2)  # and σ²·2 to the parabola x²
    return tuple(k.astype(np.float32) for k in (gauss, first, second))  # type: ignore[return-value]
