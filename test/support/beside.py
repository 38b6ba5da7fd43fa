"""How tests run beside each other: those that start processes one after the other, at the machine's pace."""

from __future__ import annotations

from functools import cache

from support.paths import ROOT
from xdist.scheduler import LoadScopeScheduling

MARKS = ("pytest.mark.ros", "pytest.mark.packaging")


@cache
def starts_processes(path: str) -> bool:
    """Whether a test module, by its path in the repository, has tests that start processes."""
    text = (ROOT / path).read_text()
    return any(mark in text for mark in MARKS)


class OneRowOfProcesses(LoadScopeScheduling):
    """Module by module on any worker, but all modules that start processes on one."""

    def _split_scope(self, nodeid: str) -> str:
        path = nodeid.partition("::")[0]
        return "processes" if starts_processes(path) else path
