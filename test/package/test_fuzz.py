"""A small, seeded part of `make fuzz`, run as it is."""

from __future__ import annotations

import os
import subprocess
import sys

import pytest
from support.paths import SCRIPT_PATH, SUPPORT

COUNT = 900


@pytest.mark.slow
@pytest.mark.timeout(300)
def test_spoilt_inputs_give_clear_errors_only() -> None:
    script = SUPPORT / "fuzz.py"
    command = [sys.executable, str(script), str(COUNT), "--seed", "2"]
    environment = os.environ | {"PYTHONPATH": SCRIPT_PATH}
    done = subprocess.run(command, capture_output=True, encoding="utf-8", check=False, env=environment)
    assert done.returncode == 0, done.stdout + done.stderr
    assert f"{COUNT} inputs in " in done.stdout
    assert ", seed 2: 0 failures" in done.stdout
