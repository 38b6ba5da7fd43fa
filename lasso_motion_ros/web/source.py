"""What the server shows: pictures of both planes, a status, a motion trace, and commands; live or from a recording."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Literal, Protocol

import numpy as np
import numpy.typing as npt

from lasso_motion_ros.geometry.frames import Plane

Array = npt.NDArray[np.float64]
PageView = Literal["film", "overlay"]
PAGE_VIEWS: tuple[PageView, ...] = ("film", "overlay")


@dataclass(frozen=True, eq=False)
class PlanePicture:
    """One plane's picture.

    Attributes:
        stamp_ns: the image's stamp.
        pixels: (H, W) uint8 or uint16, to be windowed for the eye; or (H, W, 3) uint8 RGB, to be shown as it is.
        loop: (N, 2) the tracked loop in this image's pixels, at this image's pair; or None.
    """

    stamp_ns: int
    pixels: npt.NDArray[np.uint8] | npt.NDArray[np.uint16]
    loop: Array | None


@dataclass(frozen=True, eq=False)
class Picture:
    """What both planes show at one time.

    Attributes:
        number: differs between any two pictures.
        held: it stays until it is released, for a person to click in; to be sent without loss.
        planes: what there is of each plane.
    """

    number: int
    held: bool
    planes: Mapping[Plane, PlanePicture]


@dataclass(frozen=True)
class TracePoint:
    """One point of the motion trace.

    Attributes:
        number: counts up from point to point.
        time_s: when its image came (the source's steady clock, seconds). A point no later than the one before replaces
            it: clicks on a past pair have that pair and those since answered anew.
        shift_mm: displacement of the loop's centre along the world's x, y, z since the reference; None: no pose.
    """

    number: int
    time_s: float
    shift_mm: tuple[float, float, float] | None


class Source(Protocol):
    """What a server can show; called from the server's threads. Each page that is open has a number of its own."""

    def status(self, page: int) -> dict[str, Any]:
        """A page's numbers and words, ready for JSON."""

    def picture(self, view: PageView, page: int) -> Picture | None:
        """The newest picture for a page; None before the first."""

    def trace(self, after: int) -> list[TracePoint]:
        """Points with a number above `after`, oldest first."""

    def command(self, name: str, body: Mapping[str, Any], page: int) -> str:
        """Carry out a user's command; may block.

        Returns:
            A line for the user, or nothing.

        Raises:
            LassoMotionError: it cannot be done; the text is for the user.
        """

    def clicks_file(self, body: Mapping[str, Any], page: int) -> str:
        """The text of a seeds file with the clicks that a page's user has set, or else those that were sent last.

        Raises:
            LassoMotionError: there are none; the text is for the user.
        """

    def millimetres_per_pixel(self, page: int) -> Mapping[Plane, float]:
        """The scale of the pictures in which a page's user clicks, at the iso-centre; empty where it is not known."""

    def watch(self, on_change: Callable[[], None]) -> None:
        """Register a function to be called, from any thread, when there is something new."""

    def audience(self, views: Mapping[int, PageView]) -> None:
        """Learn which page looks at which view; empty when the last one has gone."""
