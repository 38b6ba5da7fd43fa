"""Detections made by hand: what two planes would have seen of a ring, without any image."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from support.method_inputs import biplane

from lasso_motion_ros.geometry.frames import Plane
from lasso_motion_ros.ring.alignment import Alignment
from lasso_motion_ros.ring.detection import Detection, DetectionTuning
from lasso_motion_ros.ring.loop_views import PlaneFit

WORTH = DetectionTuning()
VIEWS = biplane(side=512)


class SeenViews:
    """What the planes showed, in the place of `LoopViews`."""

    def __init__(self, fits: list[PlaneFit]) -> None:
        self._fits = fits

    def fits(self, covariance: np.ndarray) -> list[PlaneFit]:
        return self._fits


def plane_fit(
    plane: Plane,
    centre: np.ndarray,
    *,
    evidence: float = 1.8,
    wire: float = 0.4,
    coverage: float = 1.0,
    visible: float = 1.0,
    contrast: float = 0.2,
    sigma_m: float = 5e-5,
) -> PlaneFit:
    """A plane's fit with the ring's centre at a world point (3,) m."""
    ray = centre - VIEWS[plane].source
    ray = ray / np.linalg.norm(ray)
    return PlaneFit(
        centre=centre,
        ray=ray,
        across=np.linalg.svd(ray[None])[2][1:],
        covariance=sigma_m**2 * np.eye(2),
        contrast=contrast,
        correlation=0.9,
        evidence=evidence,
        wire=wire,
        coverage=coverage,
        visible=visible,
        residual_mm=0.1,
        strip=np.zeros((1, 13), np.float32),
        shown=np.zeros(1, np.float32),
    )


def detection_of(
    fits: Mapping[Plane, PlaneFit],
    *,
    turn: np.ndarray | None = None,
    stretch: float = 0.0,
    likeness: float = 1.0,
    tuning: DetectionTuning = WORTH,
) -> Detection:
    """The detection that some planes' fits are."""
    size = 2 * len(fits) + 4
    alignment = Alignment(
        likeness=dict.fromkeys(fits, likeness),
        turn=np.zeros(3) if turn is None else turn,
        stretch=stretch,
        correlations=(0.9,),
        is_given_up=False,
        views=SeenViews(list(fits.values())),
        covariance=1e-4 * np.eye(size),
    )
    return Detection(alignment, tuning)


def detection_at(
    place: np.ndarray,
    *,
    planes: str = "ab",
    evidence: float = 1.8,
    likeness: float = 1.0,
    visible: float = 1.0,
    wire: float = 0.4,
    sigma_m: float = 5e-5,
) -> Detection:
    """Both planes, or one, see the ring's centre at a world point (3,) m."""
    seen = {"evidence": evidence, "visible": visible, "wire": wire, "sigma_m": sigma_m}
    return detection_of({plane: plane_fit(plane, place, **seen) for plane in planes}, likeness=likeness)
