"""Joins the user's clicks in both planes to the image pair that was clicked."""

from __future__ import annotations

import dataclasses
from collections import deque
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from lasso_motion_ros.geometry.frames import PLANES, Frame, FramePair, Plane, Seed
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

    Of clicks that do not fit each other those that came last stand: whoever clicks again means the new ones.
    Where the stamps start anew, clicks that came since the last pair are the new run's if they are on its first pair.

    Args:
        capacity: pairs remembered.

    Attributes:
        number: of the last task given out.
        waiting: what clicks are kept and what they wait for, in words; empty where none are kept. May be read at any
            time.
    """

    def __init__(self, capacity: int) -> None:
        self._pairs: deque[FramePair] = deque(maxlen=capacity)
        self._held: FramePair | None = None
        self._clicks: dict[Plane, _Clicks] = {}
        self._since_last_pair: dict[Plane, _Clicks] = {}  # whatever became of them
        self._complaints: list[tuple[Plane, str]] = []
        self.number = 0
        self.waiting = ""

    def take_complaints(self) -> list[tuple[Plane, str]]:
        """Clicks that were refused since the last call: plane and reason."""
        complaints, self._complaints = self._complaints, []
        return complaints

    def clear(self) -> None:
        """Forget pairs and clicks; a held pair stays, since somebody is looking at it."""
        self._pairs.clear()
        self._clicks.clear()
        self._since_last_pair.clear()
        self.waiting = ""

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

    def seed_pair(self, pair: FramePair, seed: Seed) -> PairTask:
        """The task of any past pair, with clicks on it, and the pairs since then that are remembered."""
        later = tuple(one for one in self._known() if one.stamp_ns > pair.stamp_ns)
        return self._numbered(PairTask(pair, seed, answered=True, later=later))

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
        for kept in (self._clicks, self._since_last_pair):
            kept.pop(plane, None)  # in the order of arrival
            kept[plane] = _Clicks(stamp_ns, points, hold)
        index = None if hold else self._clicked_index()
        self.waiting = self._waiting_words()
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
            # Clicks may overtake the images that they are on: to a busy node they seem to be on one of the old run.
            came = {**self._clicks, **self._since_last_pair}
            self._clicks = {p: clicks for p, clicks in came.items() if clicks.held or _is_on(clicks, pair.frame(p))}
        self._since_last_pair.clear()
        self._pairs.append(pair)
        if hold:
            return [self._numbered(PairTask(pair))]
        known = self._known()
        index = len(known) - 1 if self._is_next_clicked(pair) else self._clicked_index()
        self.waiting = self._waiting_words()
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
        self.waiting = ""
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
            self._refuse_first()
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
        self._refuse_first()
        return None

    def _place(self, plane: Plane) -> int | str:
        """Index of the pair with the clicked image; `future` or `past` where it is not there (yet, or any more)."""
        wanted = self._clicks[plane].stamp_ns
        pairs = self._known()
        for index in range(len(pairs) - 1, -1, -1):
            if _is_on(self._clicks[plane], pairs[index].frame(plane)):
                return index
        newest = self._newest_ns(plane)
        return "future" if newest is None or wanted > newest else "past"

    def _newest_ns(self, plane: Plane) -> int | None:
        """Stamp of the plane's newest image among the remembered pairs, or of the newest pair where it has none."""
        pairs = self._known()
        frames = [frame for pair in reversed(pairs) if (frame := pair.frame(plane)) is not None]
        return frames[0].stamp_ns if frames else pairs[-1].stamp_ns if pairs else None

    def _refuse_first(self) -> None:
        """Refuse, of clicks that are on two pairs, those that came first: the others may be half of a new attempt."""
        first, last = self._clicks
        self._refuse(
            first,
            f"the clicks of both planes must be on one pair: {self._clicked_words(first)},"
            f" {self._clicked_words(last)}, which came last",
        )

    def _refuse(self, plane: Plane, reason: str) -> None:
        del self._clicks[plane]
        self._complaints.append((plane, reason))

    def _clicked_words(self, plane: Plane) -> str:
        stamp_ns = self._clicks[plane].stamp_ns
        where = "for the next pair" if stamp_ns == _NEXT else f"on the image at {_seconds(stamp_ns)}"
        return f"plane {plane.upper()}'s are {where}"

    def _waiting_words(self) -> str:
        """What clicks are kept, and what they wait for."""
        if not self._clicks:
            return ""
        words = [f"plane {plane.upper()} has no clicks yet" for plane in PLANES if plane not in self._clicks]
        for plane in sorted(self._clicks):
            clicks = self._clicks[plane]
            if clicks.held or (clicks.stamp_ns == _NEXT and not words):
                words.append(f"plane {plane.upper()}'s clicks wait for the next pair")
            elif clicks.stamp_ns != _NEXT and self._place(plane) == "future":
                newest = self._newest_ns(plane)
                came = "no calibrated image has come" if newest is None else f"the newest is at {_seconds(newest)}"
                words.append(
                    f"plane {plane.upper()}'s clicks wait for the image at {_seconds(clicks.stamp_ns)}; {came}"
                )
        return ", ".join(words)


def _is_on(clicks: _Clicks, frame: Frame | None) -> bool:
    return frame is not None and abs(frame.stamp_ns - clicks.stamp_ns) <= _SAME_STAMP_NS


def _seconds(stamp_ns: int) -> str:
    return f"{stamp_ns // 1_000_000_000}.{stamp_ns % 1_000_000_000:09d} s"
