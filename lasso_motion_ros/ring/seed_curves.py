"""The curve that the clicks lead to: from an ellipse to an open curve that follows the wire in both planes.

The ellipse tells how far the outlines go round the loop. From it on, the likeliest curve is looked for (`loop_curve`).
Several ellipses may be the loop's; which of them led to the right curve, the images tell.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from lasso_motion_ros.config.tracker import TrackerConfig
from lasso_motion_ros.core.errors import ReconstructionError, SeedError
from lasso_motion_ros.geometry.curves import distance_to_curve, resample
from lasso_motion_ros.geometry.frames import FramePair, Plane, Seed
from lasso_motion_ros.ring.loop_curve import LikeliestCurve, likeliest_curve
from lasso_motion_ros.ring.loop_model import LoopModel, model_along, shifted
from lasso_motion_ros.ring.seed_circle import seed_circles
from lasso_motion_ros.ring.seed_images import SeedImages
from lasso_motion_ros.ring.strip import HALF_WIDTH, strip_along
from lasso_motion_ros.ring.working_image import WholeImages
from lasso_motion_ros.seeding.cones import Ellipse3D
from lasso_motion_ros.seeding.loop_outline import TURN, LoopOutline, angles_between, on_ellipse
from lasso_motion_ros.seeding.outlines import (
    curves_through_clicks,
    is_bright,
    outlines,
    require_both_planes,
    require_lasso_size,
)
from lasso_motion_ros.seeding.reconstruction import epipolar_shift, reconstruct_ellipse

Array = npt.NDArray[np.float64]

POINTS = 120


@dataclass(frozen=True)
class _Tuning:
    """Which curves are tried, which of them is taken, and when the images show none."""

    # Logarithm of how much likelier the images and the clicks are with a curve than with none (docs/constants.md).
    smallest_log_odds: float = 6.0
    doubtful_log_odds: float = 20.0  # with less the other polarity is tried, too
    open_contrast: float = 0.5  # of the rest of the loop's: less of it where nobody clicked, and there is no wire
    ellipses: int = 2  # that are tried at most, of each kind of outline,
    doubtful_misfit: float = 5.0  # and that fit worse than the best by less than this
    circles: int = 1  # that are tried, of those that clicks and images show best,
    search_penalty: float = 0.1  # and by how much they have to show more: ellipses from good clicks fit more finely
    roundness_spread: float = 0.15  # a lasso is round to about this
    shape_penalty: float = 0.05  # of what the planes have in common, for a model that is one spread less round
    click_penalty: float = 0.41  # of what the planes have in common, for a mean squared distance of the clicks of 1 mm²


TUNING = _Tuning()


def build_loop_model(
    pair: FramePair, seed: Seed, config: TrackerConfig, points: int = POINTS, whole: WholeImages | None = None
) -> LoopModel:
    """The loop's curve from the clicks.

    Args:
        pair: the clicked images.
        seed: the clicks.
        config: the tracker's parameters.
        points: of the curve.
        whole: the pair's working images, where others ask for them, too.

    Raises:
        SeedError: clicks that are too few, outside the image or beside any catheter, that make a loop of no lasso's
            size, or a pair that lacks a plane.
        ReconstructionError: no 3-D loop explains the clicks.
    """
    require_both_planes(pair)
    bright = is_bright(pair, seed, config)

    def images(bright: bool) -> SeedImages:
        return SeedImages(pair, bright=bright, whole=whole)

    model, log_odds = _build(images(bright), pair, seed, config, points)
    if config.polarity == "auto" and log_odds < TUNING.doubtful_log_odds:
        # At low dose a few clicks may mistake the polarity; the whole loop seldom does.
        try:
            other, its_odds = _build(images(not bright), pair, seed, config, points)
        except ReconstructionError:
            pass
        else:
            if its_odds > log_odds:
                model, log_odds = other, its_odds
    if log_odds < TUNING.smallest_log_odds:
        raise SeedError(
            f"no catheter is seen along the clicks: the logarithm of the odds for one is {log_odds:.1f}, "
            f"expected at least {TUNING.smallest_log_odds:.0f}"
        )
    require_lasso_size(model.radius_mm)
    return model


def _shifts(images: SeedImages, model: LoopModel) -> dict[Plane, Array]:
    """Per plane, (2,) pixels by which the clicked images lie off their calibration."""
    return {plane: model.shift(plane, projection) for plane, projection in images.projections.items()}


def _contrasts(images: SeedImages, curve: Array, shifts: dict[Plane, Array]) -> Array:
    """(N,) how far a curve (N, 3) stands out from what lies beside it, mean of both planes, in units of local noise."""
    contrasts = []
    for image in images.working(curve.mean(axis=0), shifts).values():
        strip = strip_along(curve, image.projection).sample(image)
        beside = 0.5 * (strip[:, :3].mean(axis=1) + strip[:, -3:].mean(axis=1))
        contrasts.append(strip[:, HALF_WIDTH - 1 : HALF_WIDTH + 2].mean(axis=1) - beside)
    return np.asarray(np.mean(contrasts, axis=0), dtype=np.float64)


def _build(
    images: SeedImages, pair: FramePair, seed: Seed, config: TrackerConfig, count: int
) -> tuple[LoopModel, float]:
    """Of the models that the clicks allow the one whose planes have most in common along the arc; and its log odds.

    An electrode lies at one arc length in both planes, along the right curve only. The outlines alone often leave two
    ellipses that fit about as well; and where noise outweighs the wire, the path from click to click is no outline.
    """
    models: list[tuple[float, LoopModel, float]] = []
    starts, failure = _starts(images, pair, seed, config)
    for start in starts:
        try:
            model, log_odds = _around(start, images, seed, count)
        except ReconstructionError as error:
            failure = failure or error
            continue
        # What the clicks alone lead to holds, unless the images plainly speak for a circle that was searched.
        worth = _worth(model, images, seed) - (TUNING.search_penalty if start.is_searched else 0.0)
        models.append((worth, model, log_odds))
    if not models:
        raise failure or ReconstructionError("no 3-D loop explains the clicks")
    _, model, log_odds = max(models, key=lambda one: one[0])
    return model, log_odds


@dataclass(frozen=True, eq=False)
class _Start:
    """An ellipse to begin with.

    Attributes:
        ellipse: the loop's, roughly, world metres.
        paths: per plane, (N, 2) pixels along the loop.
        shifts: per plane, (2,) pixels by which its images lie off its calibration.
        is_searched: whether images led to it; then the paths only tell how far the loop goes round.
    """

    ellipse: Ellipse3D
    paths: dict[Plane, Array]
    shifts: dict[Plane, Array]
    is_searched: bool = False


def _starts(
    images: SeedImages, pair: FramePair, seed: Seed, config: TrackerConfig
) -> tuple[list[_Start], ReconstructionError | None]:
    """All ellipses that the clicks, the paths between them and the images lead to; and why one of them led to none."""
    projections, share_of_a = images.projections, images.share_of_a
    found = outlines(pair, seed, config, bright=images.bright)  # refuses clicks that are none
    drawn = curves_through_clicks(seed, projections)
    starts, failure = list[_Start](), None
    for paths in (found, drawn):
        shifts = epipolar_shift(projections, paths, share_of_a)  # of `drawn` at last, for the circles
        try:
            candidates = reconstruct_ellipse(shifted(projections, shifts), paths).candidates
        except ReconstructionError as error:
            failure = failure or error
            continue
        limit = candidates[0].misfit + TUNING.doubtful_misfit
        starts += [_Start(one.ellipse, paths, shifts) for one in candidates[: TUNING.ellipses] if one.misfit <= limit]
    circles = seed_circles(images, seed, shifts, TUNING.click_penalty, count=TUNING.circles)
    return [*starts, *(_Start(circle, drawn, shifts, is_searched=True) for circle in circles)], failure


def _worth(model: LoopModel, images: SeedImages, seed: Seed) -> float:
    """What the planes have in common along a model, less what speaks against it: clicks beside it, and its shape."""
    lengthwise = (1.0 - model.roundness) / TUNING.roundness_spread
    return (
        _in_common(images, model)
        - TUNING.click_penalty * _beside(model, images, seed)
        - TUNING.shape_penalty * lengthwise**2
    )


def _beside(model: LoopModel, images: SeedImages, seed: Seed) -> float:
    """Mean squared distance of the clicks from the model's curve, mm²."""
    squares = []
    for plane, projection in images.projections.items():
        curve = projection.project(model.points) + model.shift(plane, projection)
        unit = projection.millimetres_per_pixel(model.centre)
        squares.append((unit * distance_to_curve(seed.points(plane), curve)) ** 2)
    return float(np.mean([square.mean() for square in squares]))


def _in_common(images: SeedImages, model: LoopModel) -> float:
    """Mean along the arc of the lesser of the two planes' evidence, as far as it speaks for a ring."""
    seen = images.working(model.centre, _shifts(images, model)).values()
    shown = [image.evidence_at(image.projection.project(model.points)) for image in seen]
    return float(np.maximum(np.minimum(*shown), 0.0).mean())


def _around(start: _Start, images: SeedImages, seed: Seed, count: int) -> tuple[LoopModel, float]:
    """The model whose curve follows the wire in both planes, from an ellipse on, and the logarithm of its odds."""
    outline = LoopOutline(start.ellipse, shifted(images.projections, start.shifts), start.paths)

    def likeliest(low: float, high: float) -> tuple[Array, LikeliestCurve]:
        angles = angles_between(low, high)
        return angles, likeliest_curve(on_ellipse(start.ellipse, angles), images, start.shifts, seed)

    low, high = outline.extent
    angles, found = likeliest(low, high)
    if (gap := outline.gap) is not None and high - low <= TURN:
        # Nobody clicked there; where there is no wire either, the loop is open.
        contrasts, is_inside = (
            _contrasts(images, found.points, found.shifts),
            (angles - gap[0]) % TURN < gap[1] - gap[0],
        )
        if contrasts[is_inside].mean() < TUNING.open_contrast * contrasts[~is_inside].mean():
            _, found = likeliest(gap[1] - TURN, gap[0])
    return _along(found, images, count), found.log_odds


def _along(found: LikeliestCurve, images: SeedImages, count: int) -> LoopModel:
    """The model of a curve."""
    points = resample(found.points, count)
    simultaneous = images.share_of_a > 0.0
    return model_along(points, images.bright, found.shifts, images.projections, simultaneous=simultaneous)


def model_beside(
    start: Array, images: SeedImages, shifts: Mapping[Plane, Array], places: Seed, sigma_mm: float, points: int = POINTS
) -> tuple[LoopModel, float]:
    """The model of a loop that follows the wire near a curve in both planes, whoever drew it; its log odds.

    Args:
        start: (N, 3) along the loop, world metres.
        images: of the pair.
        shifts: per plane, (2,) pixels by which its images lie off its calibration, about.
        places: along it in both planes.
        sigma_mm: how far those lie beside the wire, standard deviation.
        points: of the model's curve.
    """
    found = likeliest_curve(start, images, shifts, places, sigma_mm)
    return _along(found, images, points), found.log_odds
