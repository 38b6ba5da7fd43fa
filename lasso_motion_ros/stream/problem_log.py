"""What was wrong with what came in: noted where it is found, taken by whoever tells the user."""

from __future__ import annotations

import threading
from collections import Counter, deque
from collections.abc import Iterable, Mapping
from dataclasses import dataclass

_MAX_PROBLEMS = 64


@dataclass(frozen=True)
class Problem:
    """Something wrong with what came in.

    Attributes:
        topic: relative name of the topic it came on, or empty where it is none's in particular.
        text: what was found and what was expected.
    """

    topic: str
    text: str


class ProblemLog:
    """The last problems, and how many there were on each topic; may be used from several threads."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._problems: deque[Problem] = deque(maxlen=_MAX_PROBLEMS)
        self._counts: Counter[str] = Counter()
        self._last: dict[str, str] = {}
        self._remarks: dict[str, str] = {}
        self._new_remarks: list[Problem] = []

    def report(self, topic: str, text: str) -> None:
        """Note a problem; see `Problem`."""
        with self._lock:
            self._problems.append(Problem(topic, text))
            self._counts[topic] += 1
            self._last.pop(topic, None)  # so that the newest stands last
            self._last[topic] = text

    def remark(self, topic: str, text: str) -> None:
        """Note what is to be known of a topic, though nothing is wrong: given out where it is news, and once."""
        with self._lock:
            if text and self._remarks.get(topic) != text:
                self._remarks[topic] = text
                self._new_remarks.append(Problem(topic, text))

    def take_remarks(self) -> list[Problem]:
        """Remarks that are new since the last call."""
        with self._lock:
            remarks, self._new_remarks = self._new_remarks, []
            return remarks

    def of_topics(self, topics: Iterable[str]) -> tuple[int, str]:
        """How many problems there were on some topics, and the text of the last; empty where there was none."""
        wanted = set(topics)
        with self._lock:
            texts = [text for topic, text in self._last.items() if topic in wanted]
            return sum(self._counts[topic] for topic in wanted), texts[-1] if texts else ""

    def take(self) -> list[Problem]:
        """Problems since the last call (the last few, if there were many)."""
        with self._lock:
            problems = list(self._problems)
            self._problems.clear()
            return problems

    @property
    def counts(self) -> dict[str, int]:
        """Problems since the start, by topic."""
        with self._lock:
            return dict(self._counts)


def problem_lines(problems: Mapping[Problem, int]) -> list[str]:
    """What was wrong with messages, a line each; what was wrong on several topics alike is said once."""
    topics: dict[str, list[str]] = {}
    often: Counter[str] = Counter()
    for problem, count in problems.items():
        topics.setdefault(problem.text, []).append(problem.topic)
        often[problem.text] += count
    return [
        (f"{', '.join(names)}: " if any(names) else "")
        + text
        + (f" ({often[text]} times)" if often[text] > len(names) else "")
        for text, names in topics.items()
    ]
