"""Enters a plain tracker into the benchmark: each plane's template is matched, and the two rays meet in 3-D.

    lasso-motion benchmark export DIR --sequences 4
    python examples/template_tracker.py DIR template.csv
    lasso-motion benchmark score DIR --result template.csv

A tracker of yours takes the place of `Template` and `meeting_point`; `answers` is all that the benchmark asks. The file
is plain CSV (docs/benchmark.md): a program in another language writes it by itself.
"""

from __future__ import annotations

import json
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import cv2
import numpy as np
import numpy.typing as npt

from lasso_motion_ros.config.stream import StreamConfig
from lasso_motion_ros.geometry.frames import PLANES, Frame
from lasso_motion_ros.geometry.transforms import rigid
from lasso_motion_ros.stream.recorded_pairs import recorded_pairs
from msg_adapters.pose_table import PoseRow, pose_table_lines
from msg_adapters.recordings.reader import RecordingReader
from msg_adapters.seeds import decode_polygon

Array = npt.NDArray[np.float64]

FINE_PX = 1.2  # of an electrode, about
MARGIN_PX = 6  # about the clicks
SEARCH_PX = 40  # about the last place
LEAST_CORRELATION = 0.2  # below, the tracker says that it is lost


class Template:
    """One plane's picture of the loop in the first pair, looked for about where it was seen last."""

    def __init__(self, frame: Frame, clicks: Array) -> None:
        self.corner = np.maximum(np.floor(clicks.min(axis=0)).astype(int) - MARGIN_PX, 0)
        end = np.ceil(clicks.max(axis=0)).astype(int) + MARGIN_PX
        self.centre = clicks.mean(axis=0) - self.corner
        self.picture = fine(frame)[self.corner[1] : end[1], self.corner[0] : end[0]]

    def find(self, frame: Frame) -> tuple[Array, float]:
        """Where the loop's centre is (2,), pixels, and the correlation there."""
        begin = np.maximum(self.corner - SEARCH_PX, 0)
        end = self.corner + self.picture.shape[::-1] + SEARCH_PX
        match = cv2.matchTemplate(fine(frame)[begin[1] : end[1], begin[0] : end[0]], self.picture, cv2.TM_CCOEFF_NORMED)
        _, correlation, _, place = cv2.minMaxLoc(match)
        if correlation > LEAST_CORRELATION:
            self.corner = begin + place
        return self.corner + self.centre, float(correlation)


def fine(frame: Frame) -> npt.NDArray[np.float32]:
    """(H, W) the image without what varies slowly: the body."""
    pixels = cv2.GaussianBlur(frame.pixels.astype(np.float32), (0, 0), FINE_PX)
    return pixels - cv2.GaussianBlur(pixels, (0, 0), 4 * FINE_PX)


def meeting_point(frames: dict[str, Frame], pixels: dict[str, Array]) -> Array:
    """(3,) the point nearest to both planes' rays, world metres."""
    across, towards = np.zeros((3, 3)), np.zeros(3)
    for plane, frame in frames.items():
        ray = frame.projection.rays(pixels[plane][None])[0]
        beside = np.eye(3) - np.outer(ray, ray)
        across, towards = across + beside, towards + beside @ frame.projection.source
    return np.linalg.solve(across, towards)


def answers(recording: Path) -> Iterator[PoseRow]:
    """An answer for each whole pair of a recording: the loop's shift since the first, or that it is lost."""
    messages = RecordingReader(recording).messages([f"/plane_{plane}/seed" for plane in PLANES])
    clicks = {one.topic.split("/")[1][-1]: decode_polygon(one.message) for one in messages}
    templates, first = {}, np.zeros(3)
    for pair in recorded_pairs(RecordingReader(recording), StreamConfig()):
        if not pair.is_whole:
            continue
        began = time.perf_counter()
        if not templates:
            templates = {plane: Template(frame, clicks[plane]) for plane, frame in pair.frames.items()}
            first = meeting_point(pair.frames, {plane: one.corner + one.centre for plane, one in templates.items()})
        found = {plane: templates[plane].find(frame) for plane, frame in pair.frames.items()}
        if min(correlation for _, correlation in found.values()) < LEAST_CORRELATION:
            yield PoseRow(pair.stamp_ns, state="LOST")
            continue
        moved = meeting_point(pair.frames, {plane: place for plane, (place, _) in found.items()}) - first
        took_ms = 1e3 * (time.perf_counter() - began)
        yield PoseRow(pair.stamp_ns, rigid((0, 0, 0), moved), state="TRACKING", latency_ms=round(took_ms, 2))


def main(benchmark: str, output: str) -> None:
    """Answer on every sequence of a benchmark, into one file."""
    manifest = json.loads((Path(benchmark) / "manifest.json").read_text(encoding="utf-8"))
    rows = []
    for sequence in manifest["sequences"]:
        rows += answers(Path(benchmark) / "recordings" / f"{sequence['name']}.mcap")
    Path(output).write_text("\n".join(pose_table_lines(rows, manifest["identity"])) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main(*sys.argv[1:])
