"""The demonstration's results: video, plots and table, from the received messages and the truth."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import numpy.typing as npt

from lasso_motion_ros.core.errors import RecordingError
from lasso_motion_ros.core.output_files import write_json, write_text
from lasso_motion_ros.evaluation.measures import PairEstimate, PairScore, Truth, score_pairs
from lasso_motion_ros.evaluation.same_pair import of_pair
from lasso_motion_ros.evaluation.summary import Summary, evaluation_record, format_table, summarise
from lasso_motion_ros.geometry import transforms
from lasso_motion_ros.geometry.frames import PLANES, FramePair, Plane
from lasso_motion_ros.overlay.compositing import blend, surface_mask
from lasso_motion_ros.overlay.primitives import WHITE, Colour, draw_banner, draw_legend, draw_text, fit_text
from lasso_motion_ros.overlay.silhouette import silhouette
from lasso_motion_ros.overlay.style import OverlayStyle
from lasso_motion_ros.overlay.tracking_picture import STATE_COLOURS
from lasso_motion_ros.overlay.triangle_mesh import TriangleMesh
from lasso_motion_ros.overlay.windowing import RgbImage, grey_to_rgb, window_image
from lasso_motion_ros.reports.figure_panels import save_figure
from lasso_motion_ros.reports.picture_grid import (
    RESEARCH_ONLY,
    STRIP_TEXT_AT,
    STRIP_TEXT_SCALE,
    below_each_other,
    beside,
    fitted,
    missing_cell,
    text_strip,
)
from lasso_motion_ros.reports.sequence_figures import PairFlags, error_figure, errors_2d_mm, motion_figure
from lasso_motion_ros.reports.video import VideoWriter
from lasso_motion_ros.tracking.tracker import TrackerState

Array = npt.NDArray[np.float64]

VIDEO, MOTION_PLOT, ERROR_PLOT = "overlay.mp4", "motion.png", "error_2d.png"
TABLE_TEXT, TABLE_JSON = "table.txt", "table.json"
ARTEFACTS = (VIDEO, MOTION_PLOT, ERROR_PLOT, TABLE_TEXT, TABLE_JSON)
CELL_PX = 512
_GAP_PX = 4
_STATIC_COLOUR: Colour = (143, 180, 216)
_PAPER_NOTE = (
    "2-D and model errors are millimetres at the loop's depth. The published method (Brost et al., MICCAI 2009)\n"
    "reports 1.0 ± 0.5 mm in each plane over 231 clinical frames, 0.6 mm of it model error."
)


@dataclass(frozen=True, eq=False)
class DemoRun:
    """One run of the graph, as seen from outside.

    Attributes:
        name: what the recording is called in table and titles.
        pairs: the biplane pairs that were played, in order of time, with pixels and geometry.
        estimates: what the tracker published, as received, one a pair that was answered.
        overlays: per plane, by *that plane's image* stamp (ns), (H, W, 3) uint8 RGB as received from the overlay node.
        surface: the surface the overlay node was given, world metres, at the reference.
        truth: the recording's truth, or None where it has none (video and motion plot only then).
    """

    name: str
    pairs: Sequence[FramePair]
    estimates: Sequence[PairEstimate]
    overlays: Mapping[Plane, Mapping[int, RgbImage]]
    surface: TriangleMesh
    truth: Truth | None = None


@dataclass(frozen=True)
class DemoArtefacts:
    """What was written.

    Attributes:
        video: overlay.mp4, both planes, without and with compensation.
        motion_plot: motion.png.
        error_plot: error_2d.png, or None without truth.
        table_text: table.txt, or None without truth.
        table_json: table.json, or None without truth.
        summary: the measures in the table, or None without truth.
        scores: the measures of each pair; empty without truth.
    """

    video: Path
    motion_plot: Path
    error_plot: Path | None
    table_text: Path | None
    table_json: Path | None
    summary: Summary | None
    scores: tuple[PairScore, ...]

    def moved(self, directory: Path) -> DemoArtefacts:
        """The same, with the files in another directory."""

        def there(path: Path | None) -> Path | None:
            return None if path is None else directory / path.name

        return replace(
            self,
            video=directory / self.video.name,
            motion_plot=directory / self.motion_plot.name,
            error_plot=there(self.error_plot),
            table_text=there(self.table_text),
            table_json=there(self.table_json),
        )


def write_demo_artefacts(run: DemoRun, directory: Path) -> DemoArtefacts:
    """Write the demonstration's results into an empty directory.

    Raises:
        RecordingError: no pair was played, or a file cannot be written.
    """
    if not run.pairs:
        raise RecordingError("no image pair was played: there is nothing to show")
    paths = {name: directory / name for name in ARTEFACTS}
    video = paths[VIDEO]
    with VideoWriter(video, _frames_per_second(run.pairs)) as writer:
        for number in range(len(run.pairs)):
            writer.write(demo_picture(run, number))

    scores = score_pairs(run.truth, run.estimates) if run.truth is not None else ()
    motion_plot = paths[MOTION_PLOT]
    found, true = _displacements(run, scores)
    title = f"Motion at the lasso since the reference: {run.name}"
    save_figure(motion_figure(_times(run), found, true, title=title), motion_plot)
    if not scores:
        return DemoArtefacts(video, motion_plot, None, None, None, None, ())

    error_plot = paths[ERROR_PLOT]
    title = f"2-D error of every frame: {run.name}"
    save_figure(error_figure(errors_2d_mm(scores), PairFlags.of(scores), title=title), error_plot)

    summary = summarise(scores)
    table_text, table_json = paths[TABLE_TEXT], paths[TABLE_JSON]
    write_text(table_text, f"{format_table({run.name: summary})}\n\n{_PAPER_NOTE}\n")
    write_json(table_json, evaluation_record({run.name: scores}))
    return DemoArtefacts(video, motion_plot, error_plot, table_text, table_json, summary, scores)


def demo_picture(run: DemoRun, number: int) -> RgbImage:
    """One frame of the video: planes A and B below each other, without compensation left, as received right."""
    pair = run.pairs[number]
    rows = []
    for plane in PLANES:
        cells = [
            _cell(_static_picture(pair, plane, run.surface), f"Plane {plane.upper()}: without compensation"),
            _cell(_received_picture(run, pair, plane), f"Plane {plane.upper()}: with compensation, as received"),
        ]
        rows.append(beside(cells, _GAP_PX))
    grid = below_each_other(rows, _GAP_PX)
    return below_each_other([grid, _footer(run, number, grid.shape[1])])


def _static_picture(pair: FramePair, plane: Plane, surface: TriangleMesh) -> RgbImage | None:
    frame = pair.frame(plane)
    if frame is None:
        return None
    picture = grey_to_rgb(window_image(frame.pixels))
    width = 2.0 * picture.shape[0] / CELL_PX
    mask = surface_mask(silhouette(surface, frame.projection, np.eye(4)), OverlayStyle(), width)
    blend(picture, mask, _STATIC_COLOUR)
    picture = fitted(picture, CELL_PX, CELL_PX)
    draw_legend(picture, [("static", _STATIC_COLOUR)])
    return picture


def _received_picture(run: DemoRun, pair: FramePair, plane: Plane) -> RgbImage | None:
    frame = pair.frame(plane)
    if frame is None:
        return None
    received = run.overlays.get(plane, {}).get(frame.stamp_ns)
    if received is not None:
        return fitted(received, CELL_PX, CELL_PX)
    picture = fitted(grey_to_rgb(window_image(frame.pixels)), CELL_PX, CELL_PX)
    draw_banner(picture, "no overlay arrived for this image", (255, 92, 80))
    return picture


def _cell(picture: RgbImage | None, label: str) -> RgbImage:
    shown = missing_cell(CELL_PX, CELL_PX, "no image in this pair") if picture is None else picture
    return below_each_other([text_strip(label, CELL_PX), shown])


def _footer(run: DemoRun, number: int, width: int) -> RgbImage:
    pair = run.pairs[number]
    strip = text_strip(
        f"pair {number + 1} of {len(run.pairs)}   t = {_times(run)[number]:.2f} s   {RESEARCH_ONLY}", width
    )
    estimate = of_pair(run.estimates, pair.stamp_ns)
    if estimate is None:
        words, colour = "no answer arrived", STATE_COLOURS[TrackerState.LOST]
    else:
        words, colour = estimate.state.replace("_", " "), _state_colour(estimate.state)
        motion = estimate.motion_raw
        if motion is not None:
            shift = 1e3 * (transforms.apply(motion, _centre(run)) - _centre(run))
            words += f"   motion x {shift[0]:+.1f}  y {shift[1]:+.1f}  z {shift[2]:+.1f} mm"
    half, scale = width // 2, STRIP_TEXT_SCALE
    draw_text(strip, fit_text(words, scale, half - 24), (half + 14, STRIP_TEXT_AT[1]), colour, scale)
    return strip


def _state_colour(state: str) -> Colour:
    known = {s.value: colour for s, colour in STATE_COLOURS.items()}
    return known.get(state, WHITE)


def _frames_per_second(pairs: Sequence[FramePair]) -> float:
    periods = np.diff([pair.stamp_ns for pair in pairs])
    periods = periods[periods > 0]
    return float(np.clip(1e9 / np.median(periods), 0.2, 60.0)) if len(periods) else 1.0


def _times(run: DemoRun) -> Array:
    return np.array([1e-9 * (pair.stamp_ns - run.pairs[0].stamp_ns) for pair in run.pairs])


def _centre(run: DemoRun) -> Array:
    """(3,) the loop's centre at the reference: the true one, else the first published one, else the surface's."""
    if run.truth is not None and run.truth.loop is not None:
        return np.asarray(run.truth.loop.mean(axis=0))
    loop = next((e.loop for e in run.estimates if e.loop is not None), None)
    return np.asarray((run.surface.vertices if loop is None else loop).mean(axis=0))


def _displacements(run: DemoRun, scores: Sequence[PairScore]) -> tuple[Array, Array | None]:
    """(N, 3) published and true displacement of the loop's centre since the reference, mm, NaN where unknown."""
    centre = _centre(run)
    found = np.full((len(run.pairs), 3), np.nan)
    true = np.full((len(run.pairs), 3), np.nan)
    start = next((s.true_centre_m for s in scores if s.is_reference and s.true_centre_m is not None), None)
    by_stamp = {score.stamp_ns: score for score in scores}
    for number, pair in enumerate(run.pairs):
        score = by_stamp.get(pair.stamp_ns)
        if start is not None and score is not None:
            for target, value in ((true, score.true_centre_m), (found, score.centre_m)):
                if value is not None:
                    target[number] = 1e3 * (value - start)
            continue
        estimate = of_pair(run.estimates, pair.stamp_ns)
        if estimate is not None and estimate.motion_raw is not None:
            found[number] = 1e3 * (transforms.apply(estimate.motion_raw, centre) - centre)
    return found, true if np.isfinite(true).any() else None
