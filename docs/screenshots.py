"""Makes the pictures in this folder: `make screenshots`.

Both are what a user gets: `lasso-motion track`, `render` and `evaluate --report` on the bundled recording, the report
photographed by a headless Chromium (Debian: `apt-get install chromium`).
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

import cv2
import numpy as np

from lasso_motion_ros.cli.main import main
from lasso_motion_ros.core.share import bundled_recording, share_file
from lasso_motion_ros.tools.demo_surface import write_demo_surface

HERE = Path(__file__).resolve().parent
BROWSERS = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable")
SHOWN_PAIR = 6  # deep in the first breath, where static and compensated differ most
REPORT_SIZE_PX = (1280, 2150)


def main_or_stop(*words: str | Path) -> None:
    """Run a `lasso-motion` command; a failure ends the script."""
    status = main([str(word) for word in words])
    if status:
        sys.exit(status)


def overlay_picture(directory: Path) -> None:
    """Static beside compensated, plane A above plane B."""
    recording = bundled_recording()
    surface, result, frames = directory / "atrium.stl", directory / "result.mcap", directory / "frames"
    write_demo_surface(recording, surface)
    main_or_stop("track", "--quiet", recording, "-o", result)
    volume = ("--volume", surface, "--units", "mm")
    main_or_stop("render", "--quiet", recording, result, *volume, "-o", frames, "--view", "both")
    planes = [cv2.imread(str(frames / f"plane_{plane}_{SHOWN_PAIR:05d}.png")) for plane in "ab"]
    gap = np.zeros((4, planes[0].shape[1], 3), np.uint8)
    write_small_png(HERE / "overlay.png", np.concatenate([planes[0], gap, planes[1]]))


def report_picture(directory: Path, browser: str) -> None:
    """The upper part of the report on both methods."""
    configurations = [share_file("config/tracker.yaml"), share_file("config/brost2009.yaml")]
    report = directory / "report"
    main_or_stop("evaluate", "--quiet", bundled_recording(), "--config", *configurations, "--report", report)
    picture = directory / "report.png"
    photograph(browser, (report / "report.html").as_uri(), picture, REPORT_SIZE_PX)
    write_small_png(HERE / "report.png", cv2.imread(str(picture)))


def photograph(browser: str, address: str, picture: Path, size_px: tuple[int, int]) -> None:
    """Let a headless browser draw a page into a PNG file."""
    # ROS wheels set a library path that would give the browser the wrong libraries.
    environment = {name: value for name, value in os.environ.items() if name != "LD_LIBRARY_PATH"}
    with tempfile.TemporaryDirectory() as profile:
        options = ["--headless", "--no-sandbox", "--disable-gpu", "--hide-scrollbars", f"--user-data-dir={profile}"]
        window = [f"--window-size={size_px[0]},{size_px[1]}", f"--screenshot={picture}"]
        subprocess.run([browser, *options, *window, address], check=True, env=environment, capture_output=True)


def write_small_png(path: Path, picture: np.ndarray) -> None:
    """Write a BGR picture with a palette's worth of levels, which compresses to a fraction."""
    coarse = (np.rint(picture / 6.0) * 6.0).clip(0, 255).astype(np.uint8)
    cv2.imwrite(str(path), coarse, [cv2.IMWRITE_PNG_COMPRESSION, 9])
    print(f"{path}: {path.stat().st_size / 1024:.0f} KiB")


def make_all() -> None:
    """Every picture that this machine can make."""
    browser = next((found for name in BROWSERS if (found := shutil.which(name))), None)
    with tempfile.TemporaryDirectory() as directory:
        overlay_picture(Path(directory))
        if browser is None:
            sys.exit("report.png was left out: no Chromium here; on Debian and Ubuntu: sudo apt install chromium")
        report_picture(Path(directory), browser)


if __name__ == "__main__":
    make_all()
