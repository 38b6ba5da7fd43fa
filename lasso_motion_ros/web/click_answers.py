"""What the tracker says to clicks, as its diagnostics count it: clicks travel on topics, which bring no answer."""

from __future__ import annotations

import threading
import time
from collections.abc import Mapping
from dataclasses import dataclass

from msg_adapters.topics import CLICKS_REFUSED_KEY, CLICKS_TAKEN_KEY, LAST_REFUSAL_KEY


@dataclass(frozen=True)
class _Tuning:
    """How long is waited.

    Attributes:
        answer_s: for the tracker's answer, seconds: a model takes half a second, its pairs since then as long again.
        second_thought_s: after a refusal, seconds: one plane's clicks may be refused before both have come.
    """

    answer_s: float = 8.0
    second_thought_s: float = 0.5


TUNING = _Tuning()


@dataclass(frozen=True)
class ClickCounts:
    """How often clicks were taken and refused, and why they were refused the last time."""

    taken: int
    refused: int
    refusal: str


class ClickAnswers:
    """Waits for the tracker's answer to clicks; may be used from several threads."""

    def __init__(self) -> None:
        self._changed = threading.Condition()
        self._counts: ClickCounts | None = None

    def take(self, values: Mapping[str, str]) -> None:
        """Take the values of the tracker's diagnostics; without the counts there are no answers."""
        try:
            counts = ClickCounts(
                int(values[CLICKS_TAKEN_KEY]), int(values[CLICKS_REFUSED_KEY]), values.get(LAST_REFUSAL_KEY, "")
            )
        except (KeyError, ValueError):
            return
        with self._changed:
            self._counts = counts
            self._changed.notify_all()

    @property
    def counts(self) -> ClickCounts | None:
        """As they are now; None where the tracker tells none."""
        return self._counts

    def wait(self, before: ClickCounts, patience_s: float = TUNING.answer_s) -> str | None:
        """Wait for the answer to clicks.

        Args:
            before: the counts when the clicks were sent.
            patience_s: how long.

        Returns:
            Empty where they were taken, else the tracker's reason; None without an answer.
        """
        deadline = time.monotonic() + patience_s
        refusal: str | None = None
        with self._changed:
            while (left := deadline - time.monotonic()) > 0:
                counts = self._counts
                if counts is not None and counts.taken > before.taken:
                    return ""
                if counts is not None and counts.refused > before.refused and refusal is None:
                    refusal = counts.refusal or "the tracker does not say why"
                    deadline = min(deadline, time.monotonic() + TUNING.second_thought_s)
                    continue
                self._changed.wait(left)
        return refusal
