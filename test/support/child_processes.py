"""Which processes a process has started, and whether one still runs (Linux: /proc)."""

from __future__ import annotations

import os
import signal
import subprocess
from pathlib import Path
from typing import Any


def children_of(pid: int) -> list[int]:
    """Process ids of the processes that a process has started."""
    found = []
    for entry in Path("/proc").iterdir():
        if entry.name.isdigit():
            try:
                parent = int((entry / "stat").read_text().rsplit(")", 1)[1].split()[1])
            except (OSError, IndexError):
                continue  # it has ended meanwhile
            if parent == pid:
                found.append(int(entry.name))
    return found


def is_running(pid: int) -> bool:
    try:
        return (Path("/proc") / str(pid) / "stat").read_text().rsplit(")", 1)[1].split()[0] != "Z"
    except OSError:
        return False


def signal_while_stopped(child: subprocess.Popen[Any], number: signal.Signals) -> None:
    """Stop a child, as Ctrl-Z does, send it a signal, and let it go on."""
    child.send_signal(signal.SIGSTOP)
    os.waitpid(child.pid, os.WUNTRACED)
    child.send_signal(number)
    child.send_signal(signal.SIGCONT)
