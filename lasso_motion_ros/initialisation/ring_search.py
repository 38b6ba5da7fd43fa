"""The rings that a few successive pairs show: through electrodes and along lines, as all pairs together have them."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from lasso_motion_ros.geometry.frames import Plane
from lasso_motion_ros.initialisation.carried_rings import begun, carried
from lasso_motion_ros.initialisation.circle_fit import find_circles, off_calibration
from lasso_motion_ros.initialisation.circles import Circles
from lasso_motion_ros.initialisation.direction_maps import DirectionMaps, curvature, direction_maps
from lasso_motion_ros.initialisation.epipolar_grid import LATER_S
from lasso_motion_ros.initialisation.laid_pair import LaidPair
from lasso_motion_ros.initialisation.shaped_rings import ShapedRings
from lasso_motion_ros.initialisation.spot_circles import circles_of_spots

Array = npt.NDArray[np.float64]


@dataclass(frozen=True)
class _Tuning:
    """How many rings are carried through the pairs, and how many are left."""

    carried: int = 16  # by the first pair's electrodes
    lined: int = 8  # of the circles that lie on lines, beside those, by whatever shows them,
    off_calibration: int = 3  # and of those that do where the planes are off theirs
    questioned: int = 10
    kept: int = 4  # by either evidence
    same_m: float = 3e-3
    same_cosine: float = 0.9
    same_line_m: float = 1.2e-3
    same_line_cosine: float = 0.97
    smallest_evidence: float = 6.0


TUNING = _Tuning()


@dataclass(frozen=True, eq=False)
class FoundRings:
    """Rings that may be in the pairs.

    Attributes:
        rings: some.
        rareness: (N,) how seldom chance would put so many of all pairs' electrodes on each (minus the logarithm to base
            ten), a long line in one plane being thought of.
        moved: per later pair, (N, 4) m by which each has moved until then, and by which its lift has grown, as its
            electrodes have it.
    """

    rings: ShapedRings
    rareness: Array
    moved: tuple[Array, ...]

    def __len__(self) -> int:
        return len(self.rings)


@dataclass(frozen=True, eq=False)
class Shown:
    """What a pair, or the mean of some, shows of catheters.

    Attributes:
        pair: with its spots.
        maps: per plane, its lines.
    """

    pair: LaidPair
    maps: Mapping[Plane, DirectionMaps]

    @classmethod
    def by(cls, pair: LaidPair) -> Shown:
        """What a pair shows."""
        return cls(pair, {p: direction_maps(curvature(one), bright=pair.bright) for p, one in pair.laid.items()})


def search_rings(
    pairs: Sequence[LaidPair], shown: Sequence[Shown], *, check: Callable[[], None] = lambda: None
) -> tuple[FoundRings, FoundRings]:
    """The rings that pairs show, as the first does: those that electrodes tell of, and circles along lines.

    Args:
        pairs: successive pairs.
        shown: by the first of them, and by what else shows its rings.
        check: called again and again; what it raises ends the search.
    """
    first = pairs[0]
    clouds = []
    for pair in pairs:
        check()
        clouds.append(pair.cloud)
    spotted, lined, begins = [], [], []
    for one in shown:
        check()
        spotted.append(circles_of_spots(one.pair.points, one.pair.spots, first.grid))
        check()
        held = find_circles(one.maps, first.grid, first.between_s, check)
        off = off_calibration(held, one.maps, first.grid, first.between_s, check)
        lined += [held[: TUNING.lined], off[: TUNING.off_calibration]]
    circles, lines = Circles.joined(spotted), Circles.joined(lined)
    lines = lines.distinct(len(lines), TUNING.same_line_m, TUNING.same_line_cosine)
    rings = ShapedRings.of(Circles.joined([circles, lines]))
    for one in shown:
        check()
        begins.append(begun(rings, one.pair.cloud))
    evidence = np.stack([one for _, one in begins])
    best_of = evidence.argmax(axis=0) * len(rings) + np.arange(len(rings))
    rings, evidence = ShapedRings.joined([one for one, _ in begins])[best_of], evidence.max(axis=0)
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
    _, *later = found.moved
    return (
        FoundRings(found.rings[told], doubtful[told], tuple(one[told] for one in later)),
        FoundRings(ShapedRings.of(lines), doubtful[of_lines], tuple(one[of_lines] for one in later)),
    )


def _ranks(evidence: Array) -> npt.NDArray[np.intp]:
    """(N,) 0 for the most, and so on."""
    return np.argsort(np.argsort(-evidence, kind="stable"), kind="stable")
