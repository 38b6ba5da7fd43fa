"""Circles that are moved, tilted and resized until they lie on the lines beside them in both planes."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from lasso_motion_ros.core.compiled import has_kernels
from lasso_motion_ros.geometry.directions import axes_across
from lasso_motion_ros.geometry.frames import PLANES, Plane
from lasso_motion_ros.initialisation.circle_search import STRONGER_SHARE, search_circles
from lasso_motion_ros.initialisation.circles import SHARES, TURN, Circles, is_narrow, laid, outward
from lasso_motion_ros.initialisation.direction_maps import DIRECTIONS, DirectionMaps, nearest_direction, tangents
from lasso_motion_ros.initialisation.epipolar_grid import LATER_S, EpipolarGrid
from lasso_motion_ros.initialisation.laid_image import CELL_M

Array = npt.NDArray[np.float64]


@dataclass(frozen=True)
class _Round:
    """One round of refinement.

    Attributes:
        reach_m: how far beside a circle a line is looked for.
        step_m: from place to place in there.
        repeats: how often.
        kept: of the circles that are distinct afterwards.
        same_m: see `Circles.distinct`.
        same_cosine: likewise.
    """

    reach_m: float
    step_m: float
    repeats: int
    kept: int
    same_m: float
    same_cosine: float


@dataclass(frozen=True)
class _Tuning:
    """How circles come to lie on lines."""

    rounds: tuple[_Round, ...] = (_Round(2e-3, 0.5e-3, 3, 40, 2e-3, 0.94), _Round(1e-3, 0.5e-3, 4, 24, 1.2e-3, 0.97))
    nearer_share: float = 0.6  # standard deviation of where the line is, of the reach
    beside_m: float = 2e-3  # a ring has nothing there
    beside_share: float = 0.5  # of it counts against the circle
    beyond_m: tuple[float, ...] = (2e-3, 3.5e-3, 5e-3)  # the ends of a ring seen edge-on: a line would go on
    beyond_share: float = 1.0
    narrow_beside: float = 0.4  # a narrow ellipse lies on many a line
    tilts: tuple[float, ...] = (-0.25, 0.0, 0.25)  # sines, out of a plane's view, that are tried of a narrow circle
    # Of the best, what is tried beside each: lines nearby may hold a circle of which a part lies on the ring.
    varied: int = 10
    aside_m: float = 1.5e-3
    aside_tilt: float = 0.25  # sine
    aside_radius: float = 0.12  # of the radius
    # What keeps a circle where no line says otherwise, in weights of points along it: centre, tilt, radius, lift.
    inertia: tuple[float, ...] = (0.2, 0.2, 0.2, 2e-5, 2e-5, 0.2)
    lift_inertia: tuple[float, float] = (2.0, 10.0)  # where plane B is exposed later, and where not
    # Planes that are exposed at once may be off their calibration: so many of the best circles are let go,
    let_go: int = 16
    taken_away_m: float = 0.5e-3  # and those that lines take so far away are others.
    largest_step: tuple[float, ...] = (2e-3, 2e-3, 2e-3, 0.25, 0.25, 1.5e-3, 2e-3)  # m and rad
    radii_m: tuple[float, float] = (5.5e-3, 17.5e-3)
    largest_lift_m: float = 5e-3


TUNING = _Tuning()
_BEYOND_M = np.array(TUNING.beyond_m)


def find_circles(
    maps: Mapping[Plane, DirectionMaps], grid: EpipolarGrid, between_s: float, check: Callable[[], None] = lambda: None
) -> Circles:
    """The best circles that both planes show, refined and distinct, best first.

    Args:
        maps: both planes'.
        grid: on which they are laid out.
        between_s: from plane A's exposure to plane B's.
        check: called again and again; what it raises ends the search.
    """
    circles = scored(search_circles(maps, grid, between_s, check), maps, grid)
    lift_inertia = TUNING.lift_inertia[0 if abs(between_s) > LATER_S else 1]
    for number, one in enumerate(TUNING.rounds):
        if number:
            circles = scored(_with_tilted(circles, grid), maps, grid)
        circles = _refined(circles, maps, grid, one, lift_inertia, check).distinct(
            one.kept, one.same_m, one.same_cosine
        )
    last = TUNING.rounds[-1]
    beside = scored(_varied(circles[: TUNING.varied], grid), maps, grid)
    circles = Circles.joined([circles, _refined(beside, maps, grid, last, lift_inertia, check)])
    return circles.distinct(last.kept, last.same_m, last.same_cosine)


def off_calibration(
    circles: Circles,
    maps: Mapping[Plane, DirectionMaps],
    grid: EpipolarGrid,
    between_s: float,
    check: Callable[[], None] = lambda: None,
) -> Circles:
    """What the best circles come to where the planes are off their calibration, distinct, best first.

    Those alone that lines take away from where the calibration holds them. Where plane B is exposed later it hardly
    holds them, and there are none.

    Args:
        circles: from `find_circles`.
        maps: as there.
        grid: as there.
        between_s: as there.
        check: as there.
    """
    last = TUNING.rounds[-1]
    held = circles[: TUNING.let_go if abs(between_s) <= LATER_S else 0]
    free = _refined(held, maps, grid, last, TUNING.lift_inertia[0], check)
    is_away = np.abs(free.lifts - held.lifts) > TUNING.taken_away_m
    return free[is_away].distinct(last.kept, last.same_m, last.same_cosine)


def _refined(
    circles: Circles,
    maps: Mapping[Plane, DirectionMaps],
    grid: EpipolarGrid,
    one: _Round,
    lift_inertia: float,
    check: Callable[[], None],
) -> Circles:
    """The circles where they lie on lines best on their way in one round."""
    moved = circles
    for _ in range(one.repeats):
        check()
        moved = scored(_moved(moved, maps, grid, one, lift_inertia), maps, grid)
        circles = circles.better_of(moved)
    return circles


def _varied(circles: Circles, grid: EpipolarGrid) -> Circles:
    """Circles a little beside, a little tilted, smaller and larger than some."""
    parts = [
        replace(circles, centres=circles.centres + way * TUNING.aside_m * axis)
        for axis in (grid.sideways["a"], grid.sideways["b"], grid.upward)
        for way in (-1.0, 1.0)
    ]
    cosine = np.sqrt(1.0 - TUNING.aside_tilt**2)
    parts += [
        replace(circles, normals=cosine * circles.normals + way * TUNING.aside_tilt * axis)
        for axis in axes_across(circles.normals)
        for way in (-1.0, 1.0)
    ]
    parts += [replace(circles, radii=circles.radii * (1.0 + way * TUNING.aside_radius)) for way in (-1.0, 1.0)]
    return Circles.joined(parts)


def _with_tilted(circles: Circles, grid: EpipolarGrid) -> Circles:
    """The circles, and those that are nearly edge-on in a plane tilted this way and that, too.

    Such a circle's two sides lie so close together that it may have come to rest between them, or on the wrong ones.
    """
    parts = [circles]
    for plane in PLANES:
        few = circles[is_narrow(circles, plane, grid)]
        view = grid.view[plane]
        across = few.normals - (few.normals @ view)[:, None] * view
        across /= np.linalg.norm(across, axis=1, keepdims=True)
        for sine in TUNING.tilts:
            parts.append(replace(few, normals=np.sqrt(1.0 - sine**2) * across + sine * view))
    return Circles.joined(parts)


def scored(circles: Circles, maps: Mapping[Plane, DirectionMaps], grid: EpipolarGrid) -> Circles:
    """The circles with the mean response to lines along them, less that beside them: the weaker plane's above all."""
    means = [_shown_along(circles, maps[plane], plane, grid) for plane in PLANES]
    return replace(circles, scores=np.minimum(*means) + STRONGER_SHARE * np.maximum(*means))


def _shown_along(circles: Circles, maps: DirectionMaps, plane: Plane, grid: EpipolarGrid) -> Array:
    """(N,) the mean response of one plane to lines along circles, less that beside them."""
    narrow = is_narrow(circles, plane, grid)
    if has_kernels():
        from lasso_motion_ros.initialisation import kernels

        shown = np.empty(len(circles))
        tuning = TUNING.beside_m, TUNING.beside_share, _BEYOND_M, TUNING.narrow_beside, TUNING.beyond_share
        radii = np.ascontiguousarray(circles.radii)
        lines = maps.widened, maps.left, maps.top, CELL_M
        everything: list[Any] = [*_laid_by(circles, plane, grid), radii, narrow, *lines, *tuning, shown]
        kernels.shown_along(*everything)
        return shown
    columns, rows = laid(circles, plane, grid)
    direction = nearest_direction(columns, rows)
    column, row = (one.mean(axis=1, keepdims=True) for one in (columns, rows))
    wider = (TUNING.beside_m / circles.radii)[:, None]

    def mean(scale: Array | float) -> Array:
        """(N,) along the curves at a scale."""
        at = column + scale * (columns - column), row + scale * (rows - row)
        return np.asarray(maps.at(*at, direction, widened=True).mean(axis=1), np.float64)

    beside = 0.5 * (mean(1.0 + wider) + mean(1.0 - wider))
    if narrow.any():
        beside[narrow] = np.minimum(beside[narrow], _beside_narrow(columns[narrow], rows[narrow], maps))
    return np.asarray(mean(1.0) - TUNING.beside_share * beside)


def _laid_by(circles: Circles, plane: Plane, grid: EpipolarGrid) -> tuple[Array, Array, Array, float, float]:
    """What kernels lay circles out by: see `kernels.shown_along`."""
    lifts = circles.lifts if plane == "b" else np.zeros(len(circles))
    return grid.parts(plane, circles.axes), np.ascontiguousarray(lifts), SHARES, grid.distance(plane), grid.lever


def _beside_narrow(columns: Array, rows: Array, maps: DirectionMaps) -> Array:
    """(N,) what lies outside narrow ellipses (N, P): along their sides, and where their line would go on."""
    x, y = outward(columns, rows)
    aside = columns + TUNING.beside_m * x, rows + TUNING.beside_m * y
    sides = maps.at(*aside, nearest_direction(columns, rows), widened=True).mean(axis=1)
    beyond = np.mean(_beyond_ends(columns, rows, maps), axis=0)
    return np.asarray(TUNING.narrow_beside + sides + TUNING.beyond_share * beyond, np.float64)


def line_beyond(circles: Circles, maps: Mapping[Plane, DirectionMaps], grid: EpipolarGrid) -> Array:
    """(N,) how much of a line goes on beyond both ends of circles that a plane sees nearly edge-on; 0 if none does.

    A ring's shaft leaves it at one end. What goes on beyond both is a long line, and any spots that the other plane
    shows make rings with it.
    """
    least = np.zeros(len(circles))
    for plane in PLANES:
        narrow = is_narrow(circles, plane, grid)
        if narrow.any():
            ends = _beyond_ends(*laid(circles[narrow], plane, grid), maps[plane])
            least[narrow] = np.maximum(least[narrow], np.minimum(*ends))
    return least


def _beyond_ends(columns: Array, rows: Array, maps: DirectionMaps) -> tuple[Array, Array]:
    """(N,) what lies beyond either end of narrow ellipses (N, P), where their line would go on."""
    flat = np.stack([columns, rows], axis=2)
    middle = flat.mean(axis=1, keepdims=True)
    far = np.linalg.norm(flat - middle, axis=2).argmax(axis=1)
    tip = flat[np.arange(len(flat)), far] - middle[:, 0]
    length = np.linalg.norm(tip, axis=1, keepdims=True)
    axis = (tip / length)[:, None]
    reach = (length + TUNING.beyond_m)[..., None] * axis
    onward = np.rint(np.arctan2(axis[..., 1], axis[..., 0]) * (DIRECTIONS / np.pi)).astype(np.intp) % DIRECTIONS
    one, other = (
        np.asarray(maps.at(ends[..., 0], ends[..., 1], onward, widened=True).mean(axis=1), np.float64)
        for ends in (middle + reach, middle - reach)
    )
    return one, other


def _line_beside(
    columns: Array, rows: Array, across: tuple[Array, Array], maps: DirectionMaps, offsets: Array, nearness: Array
) -> tuple[Array, Array]:
    """How far beside points (N, P) of closed curves a line lies, metres, and the most that is shown of one there.

    Args:
        columns: of the points, metres.
        rows: likewise.
        across: unit vectors (N, P) across the curves, along columns and rows.
        maps: a plane's.
        offsets: (K,) metres along those, at which it is looked for.
        nearness: (K,) how much each counts.
    """
    x, y = across
    direction = nearest_direction(columns, rows)
    at = columns[..., None] + offsets * x[..., None], rows[..., None] + offsets * y[..., None]
    shown = maps.at(*at, direction[..., None])
    weights = shown**2 * nearness
    found = (weights * offsets).sum(axis=2) / np.maximum(weights.sum(axis=2), 1e-6)
    return found, np.asarray(shown.max(axis=2), np.float64)


def _pull(
    circles: Circles,
    axes: Array,
    maps: DirectionMaps,
    plane: Plane,
    grid: EpipolarGrid,
    offsets: Array,
    nearness: Array,
    normal: Array,
    right: Array,
) -> None:
    """Add what the lines beside circles in one plane say of a step towards them.

    Args:
        circles: some.
        axes: (N, 3, 3) m by which a tilt moves their points, and two unit vectors across them.
        maps: the plane's.
        plane: which.
        grid: on which they lie.
        offsets: as of `_line_beside`.
        nearness: likewise.
        normal: (N, 7, 7) of the least squares of centre, tilts, radius and lift,
        right: (N, 7) likewise.
    """
    basis = np.stack([grid.sideways[plane], grid.upward])
    ways = axes @ basis.T  # (N, 3, 2)
    lifted = 1.0 if plane == "b" else 0.0
    if has_kernels():
        from lasso_motion_ros.initialisation import kernels

        moved = basis, np.ascontiguousarray(ways), lifted
        lines = maps.responses, maps.left, maps.top, CELL_M, offsets, nearness
        everything: list[Any] = [*_laid_by(circles, plane, grid), *moved, *lines, normal, right]
        kernels.pull(*everything)
        return
    cosine, sine = np.cos(TURN), np.sin(TURN)
    columns, rows = laid(circles, plane, grid)
    along, down, length = tangents(columns, rows)
    found, most = _line_beside(columns, rows, (-down, along), maps, offsets, nearness)
    # Where a plane sees the circle's side, its points lie close together.
    weight = most * np.minimum(1.0, length / length.mean(axis=1, keepdims=True))
    across = np.stack([-down, along], axis=2)  # (N, P, 2)
    tilted, wider, aside = np.moveaxis(across @ ways.transpose(0, 2, 1), 2, 0)
    others = sine * tilted, cosine * tilted, cosine * wider + sine * aside, lifted * along
    jacobian = np.concatenate([across @ basis, np.stack(others, axis=2)], axis=2)
    weighted = jacobian * weight[..., None]
    normal += np.matmul(weighted.transpose(0, 2, 1), jacobian)
    right += np.einsum("npi,np->ni", weighted, found)


def _moved(
    circles: Circles, maps: Mapping[Plane, DirectionMaps], grid: EpipolarGrid, one: _Round, lift_inertia: float
) -> Circles:
    """The circles after one step towards the lines beside them (weighted least squares of the distances)."""
    inertia = np.array([*TUNING.inertia, lift_inertia])
    normal = np.tile(np.diag(inertia), (len(circles), 1, 1))
    right = np.zeros((len(circles), 7))
    right[:, 6] = -inertia[6] * circles.lifts
    offsets = np.arange(-one.reach_m, one.reach_m + 0.5 * one.step_m, one.step_m)
    nearness = np.exp(-0.5 * (offsets / (TUNING.nearer_share * one.reach_m)) ** 2)
    first, second = axes_across(circles.normals)
    axes = np.stack([circles.radii[:, None] * circles.normals, first, second], axis=1)
    for plane in PLANES:
        _pull(circles, axes, maps[plane], plane, grid, offsets, nearness, normal, right)
    step = np.linalg.solve(normal, right[..., None])[..., 0]
    step = np.clip(step, -np.array(TUNING.largest_step), TUNING.largest_step)
    normals = circles.normals - step[:, 3:4] * second - step[:, 4:5] * first
    return Circles(
        circles.centres + step[:, :3],
        normals / np.linalg.norm(normals, axis=1, keepdims=True),
        np.clip(circles.radii + step[:, 5], *TUNING.radii_m),
        np.clip(circles.lifts + step[:, 6], -TUNING.largest_lift_m, TUNING.largest_lift_m),
        circles.scores,
    )
