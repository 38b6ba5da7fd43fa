"""Parameters of the published method (`method: brost2009`). The defaults are the paper's, where it gives them."""

from __future__ import annotations

from dataclasses import dataclass

from lasso_motion_ros.config.parameters import parameter

REFERENCE_WIDTH_PX = 1024  # detector width for which the parameters below give pixels; they scale with the detector


@dataclass(frozen=True)
class ModelConfig:
    """The 3-D model of the loop, built once from the clicks."""

    points: int = parameter(100, "points on the model curve, the paper's L", minimum=16, maximum=1000)
    candidate: str = parameter(
        "circular",
        "which 3-D ellipse is taken; circular: the more circular one, as published; likely: the one that fits outlines"
        " and a circle best together",
        choices=("circular", "likely"),
    )
    edge_on_ratio: float = parameter(
        0.1,
        "circular: a loop is edge-on where its outline is narrower than this fraction of its length",
        minimum=0.0,
        maximum=1.0,
    )


@dataclass(frozen=True)
class FeatureConfig:
    """The distance map of each image; pixels are given for a detector 1024 pixels wide."""

    roi_px: int = parameter(400, "side of the region of interest about the expected centre", unit="px", minimum=64)
    sigma_min_px: float = parameter(1.5, "smallest scale of the line filter", unit="px", minimum=0.5, maximum=10.0)
    sigma_max_px: float = parameter(3.0, "largest scale of the line filter", unit="px", minimum=0.5, maximum=20.0)
    scales: int = parameter(3, "number of scales, spaced geometrically", minimum=1, maximum=8)
    clipped_share: float = parameter(
        0.0,
        "share of the strongest line responses that is clipped before Otsu's threshold",
        minimum=0.0,
        maximum=0.1,
    )
    distance: str = parameter(
        "exact",
        "distance map: exact, or a chamfer (5×5) that is within 2 % of it and faster",
        choices=("exact", "chamfer"),
    )


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
    tie_break: float = parameter(
        0.0,
        "weight at which each point's own distance is added, to end in the middle of equal costs; 0: as published",
        minimum=0.0,
        maximum=1.0,
    )
    translation_step_mm: float = parameter(2.0, "first step of the translation search", unit="mm", minimum=0.01)
    rotation_step_deg: float = parameter(2.0, "first step of the rotation search", unit="deg", minimum=0.01)
    smallest_step: float = parameter(
        0.02,
        "the search ends once the steps are halved below this fraction of the first",
        minimum=1e-4,
        maximum=1.0,
    )
