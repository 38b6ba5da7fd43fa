"""All curves that the clicks lead to: from an ellipse to an open curve that follows the wire in both planes.

The ellipse gives each plane's outline its place along the loop; a smooth curve is then fitted to both outlines at once,
and once more to the lines found in the images beside it. Which of several curves is the right one, the images tell.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from lasso_motion_ros.config.tracker import TrackerConfig
from lasso_motion_ros.core.errors import ReconstructionError, SeedError
from lasso_motion_ros.geometry.curves import distance_to_curve, resample
from lasso_motion_ros.geometry.frames import FramePair, Plane, Seed
from lasso_motion_ros.ring.loop_curve import CurveFit, LoopCurve, snap
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

    rounds: int = 3  # of snapping to the lines in the images
    # Contrast along the model in units of the local noise (docs/constants.md).
    smallest_contrast: float = 0.88  # together with what both planes show of electrodes, which counts for
    in_common: float = 1.5  # times its evidence
    doubtful_contrast: float = 1.0
    open_contrast: float = 0.5  # of the rest of the loop's: less of it where nobody clicked, and there is no wire
    ellipses: int = 2  # that are tried at most, of each kind of outline,
    doubtful_misfit: float = 5.0  # and that fit worse than the best by less than this
    circles: int = 1  # that are tried, of those that clicks and images show best,
    search_penalty: float = 0.1  # and by how much they have to show more: ellipses from good clicks fit more finely
    roundness_spread: float = 0.15  # a lasso is round to about this
    shape_penalty: float = 0.05  # of what the planes have in common, for a model that is one spread less round
    click_penalty: float = 0.41  # of what the planes have in common, for a mean squared distance of the clicks of 1 mm²


TUNING = _Tuning()


def build_loop_model(pair: FramePair, seed: Seed, config: TrackerConfig, points: int = POINTS) -> LoopModel:
    """The loop's curve from the clicks: the first of `build_loop_models`, with its errors."""
    return build_loop_models(pair, seed, config, points)[0]


def build_loop_models(
    pair: FramePair, seed: Seed, config: TrackerConfig, points: int = POINTS, whole: WholeImages | None = None
) -> list[LoopModel]:
    """All curves that the clicks lead to, the one that the clicked pair shows best first.

    Args:
        pair: the clicked images.
        seed: the clicks.
        config: the tracker's parameters.
        points: of the curves.
        whole: the pair's working images, where others ask for them, too.

    Raises:
        SeedError: clicks that are too few, outside the image or beside any catheter, that make a loop of no lasso's
            size, or a pair that lacks a plane.
        ReconstructionError: no 3-D loop explains the clicks.
    """
    require_both_planes(pair)
    bright = is_bright(pair, seed, config)

    def images(bright: bool) -> SeedImages:
        return SeedImages(pair, bright=bright, line_sigma_mm=config.path.line_sigma_mm, whole=whole)

    models, contrast, in_common = _build(images(bright), pair, seed, config, points)
    if config.polarity == "auto" and contrast < TUNING.doubtful_contrast:
        # At low dose a few clicks may mistake the polarity; the whole loop seldom does.
        try:
            others, their_contrast, theirs = _build(images(not bright), pair, seed, config, points)
        except ReconstructionError:
            pass
        else:
            if their_contrast > contrast:
                models, contrast, in_common = others, their_contrast, theirs
    # A faint wire with electrodes is a catheter; without, the path along the clicks may have snapped to noise.
    expected = TUNING.smallest_contrast - TUNING.in_common * in_common
    if contrast < expected:
        raise SeedError(
            f"no catheter is seen along the clicks: contrast {contrast:.2f} times the noise, "
            f"expected at least {expected:.2f}"
        )
    require_lasso_size(models[0].radius_mm)
    return models


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
) -> tuple[list[LoopModel], float, float]:
    """All models that the clicks allow, at least one; the one whose planes have most in common along the arc first.

    And how far that one stands out from what lies beside it, mean of both planes, in units of local noise; and what its
    planes have in common.

    An electrode lies at one arc length in both planes, along the right curve only. The outlines alone often leave two
    ellipses that fit about as well; and where noise outweighs the wire, the path from click to click is no outline.
    """
    models: list[tuple[float, LoopModel]] = []
    starts, failure = _starts(images, pair, seed, config)
    for start in starts:
        try:
            model = _around(start, images, count)
        except ReconstructionError as error:
            failure = failure or error
            continue
        # What the clicks alone lead to holds, unless the images plainly speak for a circle that was searched.
        worth = _worth(model, images, seed) - (TUNING.search_penalty if start.is_searched else 0.0)
        models.append((worth, model))
    if not models:
        raise failure or ReconstructionError("no 3-D loop explains the clicks")
    best, *others = (model for _, model in sorted(models, key=lambda one: -one[0]))
    contrast = float(_contrasts(images, best.points, _shifts(images, best)).mean())
    return [best, *others], contrast, _in_common(images, best)


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


def _around(start: _Start, images: SeedImages, count: int) -> LoopModel:
    """The model whose curve follows the wire in both planes, from an ellipse on."""
    outline = LoopOutline(start.ellipse, shifted(images.projections, start.shifts), start.paths)

    def fitted(low: float, high: float) -> tuple[LoopCurve, dict[Plane, Array]]:
        angles = angles_between(low, high)
        return _fitted(start.ellipse, angles, images, start.shifts, None if start.is_searched else outline.at(angles))

    low, high = outline.extent
    curve, moved = fitted(low, high)
    if (gap := outline.gap) is not None and high - low <= TURN:
        # Nobody clicked there; where there is no wire either, the loop is open.
        inside = _contrasts(images, curve(angles_between(*gap)), moved).mean()
        whole = _contrasts(images, curve(angles_between(low, gap[0])), moved).mean()
        if inside < TUNING.open_contrast * whole:
            low, high = gap[1] - TURN, gap[0]
            curve, moved = fitted(low, high)
    return _along(curve, low, high, images, moved, count)


def _fitted(
    ellipse: Ellipse3D,
    angles: Array,
    images: SeedImages,
    shifts: dict[Plane, Array],
    outlines: dict[Plane, Array] | None = None,
) -> tuple[LoopCurve, dict[Plane, Array]]:
    """The curve at eccentric angles (N,), and the planes' shifts that go with it.

    Args:
        ellipse: to begin with.
        angles: rising.
        images: of both planes.
        shifts: per plane, (2,) pixels, to begin with.
        outlines: per plane, (N, 2) pixels along the loop; None: where the ellipse lies.
    """
    moved, views = shifts, shifted(images.projections, shifts)
    fit = CurveFit(ellipse, angles)
    points = on_ellipse(ellipse, angles) if outlines is None else fit(views, outlines).points
    for _ in range(TUNING.rounds):
        found = snap(points, images.lines, views)
        # The clicks' own outlines are a pixel or two off; the lines found in the images tell the shift better.
        moved = epipolar_shift(images.projections, found, images.share_of_a)
        views = shifted(images.projections, moved)
        curve = fit(views, found)
        points = curve.points
    return curve, moved


def _along(
    curve: LoopCurve, low: float, high: float, images: SeedImages, shifts: dict[Plane, Array], count: int
) -> LoopModel:
    """The model of a curve between two eccentric angles."""
    points = resample(curve(np.linspace(low, high, 8 * count)), count)
    return model_along(points, images.bright, shifts, images.projections, simultaneous=images.share_of_a > 0.0)


def model_beside(
    ellipse: Ellipse3D,
    images: SeedImages,
    shifts: dict[Plane, Array],
    points: int = POINTS,
    *,
    shape: Callable[[Array], Array] | None = None,
) -> LoopModel:
    """The model of a closed loop that follows the lines beside an ellipse in both planes, whoever drew it.

    Args:
        ellipse: in space, world metres.
        images: of the pair.
        shifts: per plane, (2,) pixels by which its images lie off their calibration, about.
        points: of the curve.
        shape: where the loop lies about, (N, 3) m at eccentric angles (N,) of the ellipse; None: on the ellipse.

    Raises:
        ReconstructionError: the two views are the same.
    """
    angles = angles_between(0.0, TURN)
    outlines = None
    if shape is not None:
        about = shape(angles)
        outlines = {plane: view.project(about) + shifts[plane] for plane, view in images.projections.items()}
    curve, moved = _fitted(ellipse, angles, images, shifts, outlines)
    return _along(curve, 0.0, TURN, images, moved, points)
