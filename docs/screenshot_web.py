"""Writes docs/web.png: the demonstration's page in a real browser, once it tracks. Run it with `make screenshots`."""

from __future__ import annotations

import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT / "test"))

from support.browser import Page, open_page  # noqa: E402

PORT = 8097
TRACE_S = 14.0
"""Long enough for some breaths in the trace; the recording is seven seconds long."""
SHOWN_DEPTH_MM = 6.0
"""Away from the reference static and compensated differ."""


def depth_mm(page: Page) -> float:
    """How far the loop is from its reference along the patient, as the page says."""
    try:
        return abs(float(page.text("shift-z").replace("−", "-")))
    except ValueError:
        return 0.0


def is_worth_showing(page: Page) -> bool:
    """Whether both planes show the overlay and the loop, away from the reference."""
    kinds = [one.text for one in page.driver.find_elements("css selector", ".plane .count")]
    return kinds == ["overlay", "overlay"] and depth_mm(page) > SHOWN_DEPTH_MM


def main() -> int:
    """Start the demonstration with its page, take the picture, stop it."""
    command = [sys.executable, "-m", "lasso_motion_ros.cli.main", "demo", "--web", "--port", str(PORT)]
    with (
        tempfile.TemporaryDirectory() as scratch,
        subprocess.Popen(
            [*command, "--out", scratch], stdout=subprocess.PIPE, encoding="utf-8", cwd=ROOT
        ) as demonstration,
    ):
        assert demonstration.stdout is not None  # noqa: S101 - for the type checker
        try:
            url = demonstration.stdout.readline().split()[1]
            with open_page(url, Path(scratch) / "profile") as page:
                page.wait_for_state("TRACKING", patience_s=60.0)
                time.sleep(TRACE_S)
                page.wait_for_state("TRACKING", patience_s=60.0)
                page.wait_for(lambda: is_worth_showing(page), "overlay and loop in a deep breath")
                page.screenshot(ROOT / "docs" / "web.png")
        finally:
            demonstration.send_signal(signal.SIGINT)
    return 0


if __name__ == "__main__":
    sys.exit(main())
