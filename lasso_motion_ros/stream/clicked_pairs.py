"""Joins the user's clicks in both planes to the image pair that was clicked."""

from __future__ import annotations

import dataclasses
from collections import deque
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from lasso_motion_ros.geometry.frames import PLANES, FramePair, Plane, Seed
from lasso_motion_ros.stream.pair_task import PairTask

# Stamps written as decimal seconds return a fraction of a microsecond off.
_SAME_STAMP_NS = 1_000_000
_NEXT = 0


@dataclass(frozen=True, eq=False)
class _Clicks:
    stamp_ns: int
    points: npt.NDArray[np.float64]
    held: bool


class ClickedPairs:
    """Remembers the last pairs and finds the one that was clicked.

    Args:
        capacity: pairs remembered.

    Attributes:
        number: of the last task given out.
    """

    def __init__(self, capacity: int) -> None:
        self._pairs: deque[FramePair] = deque(maxlen=capacity)
        self._held: FramePair | None = None
        self._clicks: dict[Plane, _Clicks] = {}
        self._complaints: list[tuple[Plane, str]] = []
        self.number = 0

    def take_complaints(self) -> list[tuple[Plane, str]]:
        """Clicks that were refused since the last call: plane and reason."""
        complaints, self._complaints = self._complaints, []
        return complaints

    def clear(self) -> None:
        """Forget pairs and clicks; a held pair stays, since somebody is looking at it."""
        self._pairs.clear()
        self._clicks.clear()

    def hold(self) -> FramePair | None:
        """Keep the last pair with both planes for clicks, however many pairs follow; None where there is none."""
        whole = [pair for pair in self._pairs if pair.is_whole]
        if whole:
            self._held = whole[-1]
        return self._held

    def release(self) -> None:
        """Stop holding the pair."""
        self._held = None

    def seed_held(self, seed: Seed) -> PairTask | None:
        """The task of the held pair, with clicks on it and the pairs after it; None where no pair is held."""
        if self._held is None:
            return None
        _, *later = (pair for pair in self._known() if pair.stamp_ns >= self._held.stamp_ns)
        return self._numbered(PairTask(self._held, seed, answered=True, later=tuple(later)))

    def _known(self) -> list[FramePair]:
        """The pairs that may be clicked, oldest first."""
        pairs = list(self._pairs)
        if self._held is None or any(pair is self._held for pair in pairs):
            return pairs
        return [self._held, *pairs]

    def add_clicks(
        self, plane: Plane, stamp_ns: int, points: npt.NDArray[np.float64], hold: bool = False
    ) -> PairTask | None:
        """Take one plane's clicks.

        Args:
            plane: the plane clicked.
            stamp_ns: stamp of the clicked image, or 0 for the next pair.
            points: (N, 2) pixels.
            hold: the stamps may be about to start anew; the clicks wait for the next pair before they are judged.

        Returns:
            Where both planes' clicks are on a remembered pair: the task of that pair with its seed, and the pairs after
            it, to be answered again. Else None.
        """
        self._clicks[plane] = _Clicks(stamp_ns, points, hold)
        index = None if hold else self._clicked_index()
        if index is None:
            return None
        first, *later = self._known()[index:]
        return self._numbered(PairTask(first, self._take_seed(), answered=True, later=tuple(later)))

    def add_pair(self, pair: FramePair, hold: bool = False) -> list[PairTask]:
        """Remember the next pair; its task carries the seed if it is the one that was clicked.

        Args:
            pair: the next pair.
            hold: the stamps may be about to start anew, as in `add_clicks`: clicks are not judged by this pair.

        Returns:
            The pair's task; before it, where clicks were held back until now, that of the clicked pair, as from
            `add_clicks`.
        """
        if pair.new_run:
            self._pairs.clear()
            self._held = None  # its stamp is of the old run
            self._clicks = {plane: clicks for plane, clicks in self._clicks.items() if clicks.held}
        self._pairs.append(pair)
        if hold:
            return [self._numbered(PairTask(pair))]
        known = self._known()
        index = len(known) - 1 if self._is_next_clicked(pair) else self._clicked_index()
        if index is None:
            return [self._numbered(PairTask(pair))]
        seed = self._take_seed()
        if index == len(known) - 1:
            return [self._numbered(PairTask(pair, seed))]
        first, *later = known[index:-1]
        clicked = PairTask(first, seed, answered=True, later=tuple(later))
        return [self._numbered(clicked), self._numbered(PairTask(pair))]

    def _numbered(self, task: PairTask) -> PairTask:
        self.number += 1
        return dataclasses.replace(task, number=self.number)

    def _take_seed(self) -> Seed:
        clicks, self._clicks = self._clicks, {}
        return Seed(clicks["a"].points, clicks["b"].points)

    def _is_next_clicked(self, pair: FramePair) -> bool:
        """Whether the clicks wait for the next pair and this is one they fit."""
        if len(self._clicks) < 2 or all(clicks.stamp_ns != _NEXT for clicks in self._clicks.values()):
            return False
        if not pair.is_whole:
            return False
        stamped = [plane for plane in PLANES if self._clicks[plane].stamp_ns != _NEXT]
        if not stamped:
            return True
        plane = stamped[0]
        place = self._place(plane)
        if place == len(self._known()) - 1:
            return True
        if place != "future":
            self._refuse(
                plane,
                f"the clicked image ({_seconds(self._clicks[plane].stamp_ns)}) is not of the next pair,"
                " which the other plane's clicks (stamp 0) are meant for",
            )
        return False

    def _clicked_index(self) -> int | None:
        """Which remembered pair the stamped clicks of both planes are on; refuses those that fit none."""
        for plane in PLANES:
            if plane in self._clicks and self._clicks[plane].stamp_ns != _NEXT and self._place(plane) == "past":
                self._refuse(
                    plane,
                    f"the clicked image ({_seconds(self._clicks[plane].stamp_ns)}) is not among the last"
                    f" {self._pairs.maxlen} pairs",
                )
        if len(self._clicks) < 2 or any(clicks.stamp_ns == _NEXT for clicks in self._clicks.values()):
            return None
        places = {plane: self._place(plane) for plane in PLANES}
        if places["a"] == places["b"]:
            place = places["a"]
            return place if isinstance(place, int) else None
        # The later clicks may be the first half of a new attempt; the earlier ones will not be completed.
        older: Plane = min(PLANES, key=lambda plane: self._clicks[plane].stamp_ns)
        other: Plane = "b" if older == "a" else "a"
        self._refuse(
            older,
            f"the clicks of both planes must be on one pair: plane {older.upper()}'s are on the image at"
            f" {_seconds(self._clicks[older].stamp_ns)}, plane {other.upper()}'s at"
            f" {_seconds(self._clicks[other].stamp_ns)}",
        )
        return None

    def _place(self, plane: Plane) -> int | str:
        """Index of the pair with the clicked image; `future` or `past` where it is not there (yet, or any more)."""
        wanted = self._clicks[plane].stamp_ns
        pairs = self._known()
        newest = None
        for index in range(len(pairs) - 1, -1, -1):
            frame = pairs[index].frame(plane)
            if frame is None:
                continue
            newest = frame.stamp_ns if newest is None else newest
            if abs(frame.stamp_ns - wanted) <= _SAME_STAMP_NS:
                return index
        if newest is None:
            newest = pairs[-1].stamp_ns if pairs else None
        return "future" if newest is None or wanted > newest else "past"

    def _refuse(self, plane: Plane, reason: str) -> None:
        del self._clicks[plane]
        self._complaints.append((plane, reason))


def _seconds(stamp_ns: int) -> str:
    return f"{stamp_ns // 1_000_000_000}.{stamp_ns % 1_000_000_000:09d} s"
