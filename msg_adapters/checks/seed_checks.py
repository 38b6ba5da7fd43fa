"""Clicks: number, place, stamp; and whether the two planes' rays meet, which tests the calibration."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from lasso_motion_ros.core.errors import GeometryError, MessageError
from lasso_motion_ros.geometry.frames import PLANES, Pair, Plane
from lasso_motion_ros.geometry.projection import Projection
from lasso_motion_ros.geometry.triangulation import triangulate
from msg_adapters.checks.issue import Issue, Severity
from msg_adapters.messages import stamp_to_ns
from msg_adapters.seeds import decode_seed
from msg_adapters.topics import seed_topic

Array = npt.NDArray[np.float64]


@dataclass(frozen=True)
class _Limits:
    """What clicks on a lasso may look like.

    Attributes:
        meet_mm: how far apart the rays through the clicks' centroids may pass; uneven clicks cost two or three.
        narrowest_loop_mm: smallest extent of a clicked loop; a lasso has 10 to 30.
        widest_loop_mm: largest extent of a clicked loop.
        far_m: largest distance of the heart from the world's origin, the iso-centre.
    """

    meet_mm: float = 6.0
    narrowest_loop_mm: float = 6.0
    widest_loop_mm: float = 60.0
    far_m: float = 0.3


LIMITS = _Limits()

_LIVE_CURE = "click along the loop in both planes of one pair: on the page (lasso-motion web), or in rqt_image_view"
_RECORDED_CURE = (
    "click along the loop in both planes on the page (lasso-motion web IN.mcap, or --annotate IN.mcap -o COPY.mcap),"
    " save the clicks there (F), and give the file to track --seeds"
)

_MIRRORS = {
    "plane a mirrored left to right": ((-1, 1), (1, 1)),
    "plane b mirrored left to right": ((1, 1), (-1, 1)),
    "both mirrored left to right": ((-1, 1), (-1, 1)),
    "plane a upside down": ((1, -1), (1, 1)),
    "plane b upside down": ((1, 1), (1, -1)),
    "both upside down": ((1, -1), (1, -1)),
}


def check_seeds(
    messages: Mapping[Plane, Sequence[Any]],
    pairs: Sequence[Pair[int]],
    projections: Mapping[Plane, Projection | None],
    *,
    live: bool,
    has_model: bool = False,
) -> Iterator[Issue]:
    """Issues with the clicks.

    Args:
        messages: per plane, the seeds in order.
        pairs: the stream's pairs, of stamps.
        projections: per plane, its calibration or None.
        live: a running graph: clicks may still come.
        has_model: a tracker has had its clicks before.
    """
    counts = {plane: len(messages.get(plane, ())) for plane in PLANES}
    if not any(counts.values()):
        if has_model:
            return
        severity: Severity = "note" if live else "warning"
        words = "no clicks yet" if live else "it has no clicks, and track begins with those in one image pair"
        yield Issue(severity, "seeds", words, _LIVE_CURE if live else _RECORDED_CURE)
        return
    pair_of = {plane: {pair.frame(plane): number for number, pair in enumerate(pairs)} for plane in PLANES}
    clicks: dict[Plane, tuple[Array, int | None]] = {}
    for plane in PLANES:
        name = seed_topic(plane).recorded_name
        if not counts[plane]:
            yield Issue("error", name, "clicks in the other plane only", "click both planes of one pair")
            continue
        message = messages[plane][0]
        try:
            points = decode_seed(message)
        except MessageError as error:
            yield Issue("error", name, str(error), "click 6 points or more along the loop, in order")
            continue
        stamp = stamp_to_ns(message.header.stamp)
        number = pair_of[plane].get(stamp)
        if stamp and number is None and not live:
            yield Issue("error", name, "its stamp is no image's", "copy the clicked image's stamp, or send 0")
        projection = projections.get(plane)
        if projection is not None and _outside(points, projection):
            yield Issue(
                "error",
                name,
                f"clicks outside the image of {projection.width}×{projection.height}",
                "give pixels of the published image: x right, y down, from 0",
            )
        clicks[plane] = (points, number if stamp else None)
    if len(clicks) == 2:
        numbers = {number for _, number in clicks.values() if number is not None}
        if len(numbers) > 1:
            yield Issue("error", "seeds", "the planes' clicks belong to two pairs", "click both images of one pair")
        a, b = projections.get("a"), projections.get("b")
        if a is not None and b is not None:
            yield from _check_geometry(clicks["a"][0], clicks["b"][0], a, b)


def _outside(points: Array, projection: Projection) -> bool:
    return bool(np.any(points < -0.5) or np.any(points > np.array([projection.width, projection.height]) - 0.5))


def _check_geometry(points_a: Array, points_b: Array, a: Projection, b: Projection) -> Iterator[Issue]:
    middles = points_a.mean(axis=0), points_b.mean(axis=0)
    found = _meeting(middles[0], middles[1], a, b)
    if found is None:
        return
    point, gap_mm = found
    if gap_mm > LIMITS.meet_mm:
        better = _mirrors_that_fit(middles[0], middles[1], a, b)
        hint = f"; with {' or '.join(better)} they would meet" if better else ""
        yield Issue(
            "error",
            "seeds",
            f"the rays through the clicks of the two planes pass {gap_mm:.0f} mm apart{hint}",
            "see signs and angles in p, that no plane is swapped or mirrored, and that the table's motion is in it",
        )
        return
    if np.linalg.norm(point) > LIMITS.far_m:
        yield Issue(
            "warning",
            "seeds",
            f"the loop lies {np.linalg.norm(point):.2f} m from the world origin",
            "see the units and the origin of p",
        )
    for plane, points, projection in zip(PLANES, (points_a, points_b), (a, b), strict=True):
        size = float(np.ptp(points, axis=0).max()) * projection.millimetres_per_pixel(point)
        if not LIMITS.narrowest_loop_mm <= size <= LIMITS.widest_loop_mm:
            yield Issue(
                "warning",
                seed_topic(plane).recorded_name,
                f"the clicked loop would be {size:.0f} mm wide, a lasso has 10 to 30",
                "see the pixel size in K, and binning",
            )


def _meeting(pixel_a: Array, pixel_b: Array, a: Projection, b: Projection) -> tuple[Array, float] | None:
    """The point nearest to both rays (3,) metres, and how far they pass each other, millimetres."""
    try:
        point = triangulate((a, b), (pixel_a, pixel_b))
    except GeometryError:
        return None
    gap = 0.0
    for projection, pixel in ((a, pixel_a), (b, pixel_b)):
        off = point - projection.source
        ray = projection.rays(pixel)
        gap += float(np.linalg.norm(off - (off @ ray) * ray))
    return point, 1e3 * gap


def _mirrors_that_fit(pixel_a: Array, pixel_b: Array, a: Projection, b: Projection) -> list[str]:
    """In words, the reflections with which the rays meet.

    Two planes turned about the patient's long axis alone cannot tell left from right by this: any two rays of one
    cross-section meet.
    """

    def flipped(pixel: Array, projection: Projection, signs: tuple[int, int]) -> Array:
        last = np.array([projection.width, projection.height]) - 1.0
        return np.where(np.array(signs) > 0, pixel, last - pixel)

    fitting = []
    for words, (signs_a, signs_b) in _MIRRORS.items():
        found = _meeting(flipped(pixel_a, a, signs_a), flipped(pixel_b, b, signs_b), a, b)
        if found is not None and found[1] < LIMITS.meet_mm / 2:
            fitting.append(words)
    return fitting
