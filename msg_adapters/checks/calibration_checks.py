"""Calibration: units, sign, size, per frame or latched, k and r against p."""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import numpy.typing as npt

from lasso_motion_ros.core.errors import MessageError
from lasso_motion_ros.geometry.frames import Plane
from lasso_motion_ros.geometry.projection import Projection
from msg_adapters.calibrations import decode_camera_info
from msg_adapters.checks.issue import Issue, cure_of
from msg_adapters.messages import stamp_to_ns
from msg_adapters.topics import camera_info_topic

Array = npt.NDArray[np.float64]


@dataclass(frozen=True)
class _Limits:
    """Where a calibration becomes suspicious.

    Attributes:
        disagree: distance between k·r and p, both normalised, above which they contradict each other.
        parallel_deg: angle between the planes' views below which depth is poorly known (a warning).
        too_parallel_deg: the same, below which it is not known at all (an error).
        at_the_ends: images without calibration that are no fault: of a stream joined and left midway, the partner may
            lie outside.
    """

    disagree: float = 1e-3
    parallel_deg: float = 20.0
    too_parallel_deg: float = 5.0
    at_the_ends: int = 2


LIMITS = _Limits()

_CURES = {
    "p: expected the source": "give p in metres: its fourth column is K·t with t in metres",
    "p: a plain camera matrix": "send p = K[R|t], world to pixels, or install tf2_ros and publish the camera's frame",
    "p: a stereo-style": "send p = K[R|t], world to pixels",
    "p:": "send the full 3×4 projection from world metres to pixels, row by row",
    "d:": "correct the distortion before publishing, and send d all zero",
    "width, height:": "width and height are the full detector's; say a crop in roi and binning in binning_x, binning_y",
    "roi:": "width and height are the full detector's; roi lies inside",
}


@dataclass
class CalibrationSamples:
    """What was found in one plane's calibrations.

    Attributes:
        stamps: of all of them.
        refusals: why one was refused → how often.
        projection: the last that was accepted.
        inconsistent: how many whose k·r does not agree with p.
        without_k: how many without k.
        changes: how often p changed.
    """

    stamps: list[int] = field(default_factory=list)
    refusals: Counter[str] = field(default_factory=Counter)
    projection: Projection | None = None
    inconsistent: int = 0
    without_k: int = 0
    changes: int = 0
    _last: bytes | None = None

    def add(self, message: Any) -> None:
        """Look at one CameraInfo."""
        self.stamps.append(stamp_to_ns(message.header.stamp))
        try:
            self.projection = decode_camera_info(message)
        except MessageError as error:
            self.refusals[str(error)] += 1
            return
        p, k, r = (np.asarray(values, dtype=np.float64) for values in (message.p, message.k, message.r))
        self.changes += self._last is not None and self._last != p.tobytes()
        self._last = p.tobytes()
        if not np.any(k):
            self.without_k += 1
        elif not _agree(p.reshape(3, 4)[:, :3], k.reshape(3, 3) @ r.reshape(3, 3)):
            self.inconsistent += 1


def _agree(left: Array, product: Array) -> bool:
    """Whether two (3, 3) matrices are one up to scale and sign."""
    left, product = left / np.linalg.norm(left), product / max(float(np.linalg.norm(product)), 1e-300)
    return min(float(np.linalg.norm(left - product)), float(np.linalg.norm(left + product))) < LIMITS.disagree


def check_calibration(
    plane: Plane,
    seen: CalibrationSamples,
    image_stamps: Collection[int],
    sizes: Collection[tuple[int, int]],
    *,
    latched: bool,
) -> Iterator[Issue]:
    """Issues with one plane's calibrations, beside its images.

    Args:
        plane: `a` or `b`.
        seen: its calibrations.
        image_stamps: of its images.
        sizes: (height, width) of its images.
        latched: they are offered as latched.
    """
    name = camera_info_topic(plane).recorded_name
    for refusal, count in seen.refusals.items():
        yield Issue("error", name, f"{refusal} ({count} of {len(seen.stamps)})", cure_of(refusal, _CURES))
    if seen.inconsistent:
        yield Issue(
            "warning",
            name,
            f"k·r is not the left 3×3 of p ({seen.inconsistent} of {len(seen.stamps)}); p is what is used",
            "send k and r from the decomposition of p, or the p that belongs to them",
        )
    if seen.without_k:
        yield Issue("note", name, "k is all zero; p is what is used")
    if seen.projection is None:
        return
    shape = (seen.projection.height, seen.projection.width)
    if sizes and shape not in sizes:
        found = ", ".join(f"{width}×{height}" for height, width in sizes)
        yield Issue(
            "error",
            name,
            f"it is for an image of {shape[1]}×{shape[0]}, the images have {found}",
            _CURES["width, height:"],
        )
    yield from _check_when(name, seen, set(image_stamps), latched=latched)
    yield from _check_origin(name, seen.projection)


def _check_when(name: str, seen: CalibrationSamples, images: set[int], *, latched: bool) -> Iterator[Issue]:
    own = images & set(seen.stamps)
    if len(images) - len(own) <= LIMITS.at_the_ends:
        return
    per_frame = len(seen.stamps) > len(images) / 2
    if per_frame and len(own) >= len(seen.stamps) / 2:
        yield Issue(
            "warning",
            name,
            f"{len(images) - len(own)} of {len(images)} images have no calibration of their own stamp",
            "publish one with each image, with the image's header",
        )
    elif per_frame and any(seen.stamps):
        yield Issue("warning", name, "its stamps are no image's stamps", "copy the image's header.stamp into it")
    elif not latched:
        yield Issue(
            "warning",
            name,
            f"{len(seen.stamps)} for {len(images)} images, and not latched: a node that starts later has none",
            "publish it with each image, or transient local (latched)",
        )
    if seen.changes and not per_frame:
        yield Issue(
            "warning",
            name,
            "it changes, and does not come with the images: the instant of the change is not known",
            "publish one with each image, with the image's header",
        )


def _check_origin(name: str, projection: Projection) -> Iterator[Issue]:
    x, y = projection.project(np.zeros(3))
    if not (-projection.width <= x < 2 * projection.width and -projection.height <= y < 2 * projection.height):
        yield Issue(
            "warning",
            name,
            f"the world origin (the iso-centre) is seen at ({x:.0f}, {y:.0f}), far outside {projection.width}×"
            f"{projection.height} pixels",
            "see the principal point in K, the sign of t, and that t is in metres",
        )


def check_planes(projections: Mapping[Plane, Projection | None]) -> Iterator[Issue]:
    """Issues with both planes' calibrations together."""
    a, b = projections.get("a"), projections.get("b")
    if a is None or b is None:
        return
    cosine = abs(float(a.viewing_direction @ b.viewing_direction))
    angle = float(np.degrees(np.arccos(min(1.0, cosine))))
    if angle < LIMITS.parallel_deg:
        yield Issue(
            "error" if angle < LIMITS.too_parallel_deg else "warning",
            "planes",
            f"the planes look along nearly one line ({angle:.1f}° apart): depth is badly known",
            "see that each plane has its own matrix, and the angles their signs",
        )
