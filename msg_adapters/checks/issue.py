"""An issue: something that is wrong, and how to fix it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

Severity = Literal["error", "warning", "note"]
SEVERITIES: tuple[Severity, ...] = ("error", "warning", "note")


@dataclass(frozen=True)
class Issue:
    """Something that is wrong, or worth knowing.

    Attributes:
        severity: `error` keeps the tracker from working, `warning` costs frames or accuracy, `note` is for
            information.
        subject: a topic's full name, or `plane a`, `planes`, `graph`, `recording`.
        problem: what was found, and what was expected.
        cure: how to fix it; empty where there is nothing to do.
    """

    severity: Severity
    subject: str
    problem: str
    cure: str = ""

    def __str__(self) -> str:
        cure = f" -> {self.cure}" if self.cure else ""
        return f"{self.severity:7}  {self.subject}: {self.problem}{cure}"


def cure_of(problem: str, cures: Mapping[str, str]) -> str:
    """The cure of a problem that begins with a known text; empty where none does.

    Args:
        problem: as the adapters' errors say it, the field first.
        cures: by the problem's beginning.
    """
    return next((cure for beginning, cure in cures.items() if problem.startswith(beginning)), "")
