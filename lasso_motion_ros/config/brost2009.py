"""Parameters of the published method (`method: brost2009`)."""

from __future__ import annotations

from dataclasses import dataclass

from lasso_motion_ros.config.parameters import parameter


@dataclass(frozen=True)
class ModelConfig:
    """The 3-D model of the loop, built once from the clicks."""

    points: int = parameter(100, "points on the model curve, the paper's L", minimum=16, maximum=1000)


@dataclass(frozen=True)
class FeatureConfig:
    """The distance map of each image; pixels are given for a detector 1024 pixels wide."""

    roi_px: int = parameter(400, "side of the region of interest about the expected centre", unit="px", minimum=64)
    sigma_min_px: float = parameter(1.5, "smallest scale of the line filter", unit="px", minimum=0.5, maximum=10.0)
    sigma_max_px: float = parameter(3.0, "largest scale of the line filter", unit="px", minimum=0.5, maximum=20.0)
    scales: int = parameter(3, "number of scales, spaced geometrically", minimum=1, maximum=8)


@dataclass(frozen=True)
class RegistrationConfig:
    """Best-neighbour registration of the model to the distance maps."""

    normal_search_px: int = parameter(
        5,
        "each model point takes the smallest distance within ± this along the curve's normal, for a detector"
        " 1024 pixels wide",
        unit="px",
        minimum=0,
        maximum=40,
    )
    translation_step_mm: float = parameter(2.0, "first step of the translation search", unit="mm", minimum=0.01)
    rotation_step_deg: float = parameter(2.0, "first step of the rotation search", unit="deg", minimum=0.01)
    smallest_step: float = parameter(
        0.02, "the search ends once the steps are halved below this fraction of the first", minimum=1e-4, maximum=1.0
    )
