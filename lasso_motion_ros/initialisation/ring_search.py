"""The rings that a few successive pairs show: through electrodes and along lines, as all pairs together have them."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from lasso_motion_ros.core.errors import GeometryError
from lasso_motion_ros.geometry.frames import FramePair, Plane
from lasso_motion_ros.initialisation.carried_rings import begun, carried
from lasso_motion_ros.initialisation.circle_fit import find_circles
from lasso_motion_ros.initialisation.circles import Circles
from lasso_motion_ros.initialisation.direction_maps import DirectionMaps
from lasso_motion_ros.initialisation.electrode_spots import Spots, electrode_spots, points_of
from lasso_motion_ros.initialisation.epipolar_grid import LATER_S, EpipolarGrid, largest_lift_m
from lasso_motion_ros.initialisation.laid_image import LaidImage, row_range
from lasso_motion_ros.initialisation.nearby_points import PointCloud
from lasso_motion_ros.initialisation.shaped_rings import ShapedRings
from lasso_motion_ros.initialisation.spot_circles import circles_of_spots

Array = npt.NDArray[np.float64]


@dataclass(frozen=True)
class _Tuning:
    """How many rings are carried through the pairs, and how many are left."""

    carried: int = 16  # by the first pair's electrodes
    lined: int = 14  # of the circles that lie on lines, beside those
    questioned: int = 10
    kept: int = 4  # by either evidence
    same_m: float = 3e-3
    same_cosine: float = 0.9
    smallest_evidence: float = 6.0
    smallest_field_m: float = 0.02  # that both planes have in common


TUNING = _Tuning()


@dataclass(frozen=True, eq=False)
class FoundRings:
    """Rings that may be in the pairs.

    Attributes:
        rings: some.
        rareness: (N,) how seldom chance would put so many of all pairs' electrodes on each (minus the logarithm to base
            ten), a long line in one plane being thought of.
    """

    rings: ShapedRings
    rareness: Array

    def __len__(self) -> int:
        return len(self.rings)


@dataclass(frozen=True, eq=False)
class Layout:
    """Both planes of one pair on their grid.

    Attributes:
        grid: theirs.
        laid: per plane, its image.
        between_s: from plane A's exposure to plane B's.
    """

    grid: EpipolarGrid
    laid: dict[Plane, LaidImage]
    between_s: float

    @classmethod
    def of(cls, pair: FramePair, *, logarithm: bool) -> Layout:
        """A pair with both planes.

        Raises:
            GeometryError: the planes look from nearly the same direction, or have too little in common.
        """
        frames = pair.frames
        grid = EpipolarGrid.of({plane: frame.projection for plane, frame in frames.items()})
        rows = row_range(frames, grid)
        common_m = rows[1] - rows[0]
        if common_m < TUNING.smallest_field_m:
            raise GeometryError(
                f"the planes have {1e3 * max(common_m, 0.0):.0f} mm of height in common; a ring is only found where it"
                f" is {1e3 * TUNING.smallest_field_m:.0f} mm or more"
            )
        laid = {p: LaidImage.of(frame, p, grid, rows, logarithm=logarithm) for p, frame in frames.items()}
        return cls(grid, laid, 1e-9 * (frames["b"].stamp_ns - frames["a"].stamp_ns))

    @property
    def largest_lift_m(self) -> float:
        """By which the planes' heights may differ."""
        return largest_lift_m(self.between_s)

    def spots(self, *, bright: bool) -> dict[Plane, Spots]:
        """Per plane, its spots."""
        return {plane: electrode_spots(one, bright=bright) for plane, one in self.laid.items()}


def search_rings(
    pairs: Sequence[FramePair],
    first: Layout,
    maps: Mapping[Plane, DirectionMaps],
    *,
    bright: bool,
    check: Callable[[], None] = lambda: None,
) -> tuple[FoundRings, FoundRings]:
    """The rings that pairs show, as the first does: those that electrodes tell of, and circles along lines.

    Args:
        pairs: successive pairs, both planes each.
        first: the first of them, laid out.
        maps: both planes' lines there.
        bright: whether catheters are brighter than what is behind them.
        check: called again and again; what it raises ends the search.

    Raises:
        GeometryError: see `Layout.of`, of a later pair.
    """
    spots = first.spots(bright=bright)
    points = points_of(spots, first.grid, first.largest_lift_m)
    clouds = [PointCloud(points, first.largest_lift_m)]
    for pair in pairs[1:]:
        check()
        layout = Layout.of(pair, logarithm=not bright)
        shown = points_of(layout.spots(bright=bright), layout.grid, layout.largest_lift_m)
        clouds.append(PointCloud(shown, layout.largest_lift_m))
    check()
    circles = circles_of_spots(points, spots, first.grid)
    lines = find_circles(maps, first.grid, first.between_s, check)[: TUNING.lined]
    check()
    rings, evidence = begun(ShapedRings.of(Circles.joined([circles, lines])), clouds[0])
    check()
    best = rings.circles(evidence).distinct_numbers(TUNING.carried, TUNING.same_m, TUNING.same_cosine)
    along_lines = np.arange(len(circles), len(rings))
    found = carried(
        ShapedRings.joined([rings[best], rings[along_lines]]),
        clouds,
        is_later=abs(first.between_s) > LATER_S,
        check=check,
    )
    check()
    some = found.rings.circles(found.evidence).distinct_numbers(TUNING.questioned, TUNING.same_m, TUNING.same_cosine)
    of_lines = np.arange(len(best), len(best) + len(along_lines))
    found = found[np.concatenate([some, of_lines])]
    doubtful = found.questioned(clouds, list(first.grid.view.values())).evidence
    told, of_lines = np.arange(len(some)), np.arange(len(some), len(found.evidence))
    ranks = np.minimum(*(_ranks(one[told]) for one in (found.evidence, doubtful)))
    told = told[(ranks < TUNING.kept) & (found.evidence[told] >= TUNING.smallest_evidence)]
    told = told[np.argsort(-doubtful[told], kind="stable")]
    return (
        FoundRings(found.rings[told], doubtful[told]),
        FoundRings(ShapedRings.of(lines), doubtful[of_lines]),
    )


def _ranks(evidence: Array) -> npt.NDArray[np.intp]:
    """(N,) 0 for the most, and so on."""
    return np.argsort(np.argsort(-evidence, kind="stable"), kind="stable")
