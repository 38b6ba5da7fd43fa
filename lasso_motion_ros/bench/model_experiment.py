"""The paper's model experiment: how far the 3-D ellipse is from the truth when its outlines are noisy."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from lasso_motion_ros.core.errors import ReconstructionError
from lasso_motion_ros.geometry.carm import carm_projection
from lasso_motion_ros.geometry.curves import distance_to_curve
from lasso_motion_ros.geometry.frames import PLANES, Plane
from lasso_motion_ros.geometry.projection import Projection
from lasso_motion_ros.seeding.cones import Ellipse3D
from lasso_motion_ros.seeding.reconstruction import reconstruct_ellipse

Array = npt.NDArray[np.float64]

PAPER_DISTANCE_MM = 3.2  # Brost et al., MICCAI 2009, for 5 mm of noise
DEFAULT_TRIALS = 200


@dataclass(frozen=True)
class ExperimentSetting:
    """The rings and the views of them.

    Attributes:
        pixel_size_m: of the detectors.
        ring_radius_m: of the lasso.
        largest_offset_m: of the ring's centre from the iso-centre, along each axis.
        smallest_tilt_deg: between each line of sight and the ring's plane; below it the ring is edge-on.
        curve_points: on each of the curves whose distance is measured.
    """

    pixel_size_m: float = 0.2e-3
    ring_radius_m: float = 0.010
    largest_offset_m: float = 0.03
    smallest_tilt_deg: float = 20.0
    curve_points: int = 120


SETTING = ExperimentSetting()


@dataclass(frozen=True)
class ModelExperiment:
    """What the trials gave.

    Attributes:
        noise_mm: standard deviation of the outlines' noise, mm on the detector, per coordinate.
        trials: rings reconstructed or refused.
        refused: trials in which no ellipse explained the noisy outlines; they enter no distance.
        mean_mm: mean over the other trials of the distance between model and truth, mm; NaN where none is left.
        median_mm: their median, mm. It is smaller, since noise now and then turns the choice between the two
            candidates round.
    """

    noise_mm: float
    trials: int
    refused: int
    mean_mm: float
    median_mm: float


def run_model_experiment(
    trials: int = DEFAULT_TRIALS, noise_mm: float = 5.0, points: int = 100, random_seed: int = 0
) -> ModelExperiment:
    """Reconstruct rings from noisy projections and measure how far the models are from the truth.

    RAO 30 and LAO 60, source–detector distance 1.2 m, source–object distance 0.785 m, pixels of 0.2 mm; a
    circular lasso of 20 mm diameter within 30 mm of the iso-centre along each axis, at random orientations at
    least 20° from edge-on in both planes. The distance is the symmetric mean distance of the two curves.

    Args:
        trials: number of rings.
        noise_mm: standard deviation of the isotropic normal noise on every projected point, in mm on the
            detector and per coordinate.
        points: points on the ring.
        random_seed: the same seed gives the same result.
    """
    random = np.random.default_rng(random_seed)
    projections: dict[Plane, Projection] = {"a": _plane(-30.0), "b": _plane(60.0)}
    noise_px = noise_mm * 1e-3 / SETTING.pixel_size_m
    distances = []
    for _ in range(trials):
        ring = _random_ring(random, projections)
        outlines: dict[Plane, Array] = {}
        for plane in PLANES:
            projected = projections[plane].project(ring.points(points))
            outlines[plane] = projected + random.normal(scale=noise_px, size=projected.shape)
        try:
            model = reconstruct_ellipse(projections, outlines).chosen.ellipse
        except ReconstructionError:
            continue
        distances.append(1e3 * curve_distance(ring, model))
    if not distances:
        return ModelExperiment(noise_mm, trials, trials, float("nan"), float("nan"))
    return ModelExperiment(
        noise_mm, trials, trials - len(distances), float(np.mean(distances)), float(np.median(distances))
    )


def format_experiment(found: ModelExperiment) -> str:
    """The figures in a sentence, beside the paper's."""
    return (
        f"{found.trials} rings from outlines with {found.noise_mm:g} mm of noise: the model is {found.mean_mm:.2f} mm "
        f"from the truth on average (median {found.median_mm:.2f}; the paper: {PAPER_DISTANCE_MM:g} for 5 mm), "
        f"{found.refused} refused"
    )


def curve_distance(first: Ellipse3D, second: Ellipse3D) -> float:
    """Symmetric mean distance of two closed curves, metres."""
    a, b = (np.vstack([e.points(SETTING.curve_points), e.points(1)]) for e in (first, second))
    return float((distance_to_curve(a[:-1], b).mean() + distance_to_curve(b[:-1], a).mean()) / 2.0)


def _plane(lao_deg: float) -> Projection:
    return carm_projection(
        np.radians(lao_deg),
        0.0,
        source_detector_m=1.2,
        source_object_m=0.785,
        pixel_size_m=SETTING.pixel_size_m,
        width=1024,
        height=1024,
    )


def _random_ring(random: np.random.Generator, projections: dict[Plane, Projection]) -> Ellipse3D:
    smallest = np.sin(np.radians(SETTING.smallest_tilt_deg))
    while True:
        # Orthonormal columns of a normally distributed matrix: orientations evenly spread.
        frame, _ = np.linalg.qr(random.normal(size=(3, 3)))
        if all(abs(frame[:, 2] @ projections[plane].viewing_direction) > smallest for plane in PLANES):
            break
    centre = random.uniform(-SETTING.largest_offset_m, SETTING.largest_offset_m, size=3)
    return Ellipse3D(centre, SETTING.ring_radius_m * frame[:, 0], SETTING.ring_radius_m * frame[:, 1])
