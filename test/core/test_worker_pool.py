"""Work on many items by real processes: one that dies costs no other item, and none outlives its parent."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import pytest
from support.child_processes import is_running
from support.paths import ROOT
from support.pool_functions import fate

from lasso_motion_ros.core.worker_pool import LocalPool, Lost


def test_a_process_that_dies_costs_its_own_item_only(tmp_path: Path) -> None:
    words = ["lives", "dies", "lives", "dies once", "lives"]
    items = [(word, tmp_path / str(number)) for number, word in enumerate(words)]
    answers = dict(LocalPool(2).run(fate, items))
    alive = {number: (words[number], 1, True) for number in (0, 2, 3, 4)}
    lost = Lost("its process was lost 2 times: SIGKILL (is there memory enough?)")
    assert answers == {**alive, 1: lost}


PARENT = """
import sys
from pathlib import Path
from support.pool_functions import sleep
from lasso_motion_ros.core.worker_pool import LocalPool
if __name__ == "__main__":
    list(LocalPool(2).run(sleep, [Path(sys.argv[1]) / str(number) for number in range(3)]))
"""


@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGINT], ids=lambda number: number.name)
def test_no_worker_outlives_its_parent(number: signal.Signals, tmp_path: Path) -> None:
    script = tmp_path / "parent.py"
    script.write_text(PARENT)
    items = tmp_path / "items"
    items.mkdir()
    environment = {**os.environ, "PYTHONPATH": f"{ROOT}:{ROOT / 'test'}"}
    parent = subprocess.Popen([sys.executable, script, items], env=environment, stderr=subprocess.DEVNULL)
    try:
        wait_for(lambda: len(list(items.iterdir())) == 2)
        workers = [int(mark.suffix[1:]) for mark in items.iterdir()]
        parent.send_signal(number)
        parent.wait(60)
    finally:
        parent.kill()
    wait_for(lambda: not any(is_running(worker) for worker in workers))
    assert len(list(items.iterdir())) == 2


def wait_for(come: Callable[[], bool]) -> None:
    deadline = time.monotonic() + 100
    while not come():
        assert time.monotonic() < deadline
        time.sleep(0.02)
