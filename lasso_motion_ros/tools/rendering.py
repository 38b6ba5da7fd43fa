"""Draws the overlay over a recording, offline, into a video or a directory of frames."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, replace
from pathlib import Path
from types import TracebackType

import numpy as np
import numpy.typing as npt

from lasso_motion_ros.config.overlay import OverlayConfig
from lasso_motion_ros.config.stream import StreamConfig
from lasso_motion_ros.core.errors import RecordingError
from lasso_motion_ros.core.output_files import whole_directory
from lasso_motion_ros.core.progress import busy, progress
from lasso_motion_ros.evaluation.measures import PairEstimate
from lasso_motion_ros.evaluation.recorded_input import read_estimates
from lasso_motion_ros.geometry import transforms
from lasso_motion_ros.geometry.frames import PLANES, FramePair
from lasso_motion_ros.overlay.painter import OverlayPainter
from lasso_motion_ros.overlay.reference_anatomy import ReferenceAnatomy, read_reference_anatomy
from lasso_motion_ros.overlay.style import overlay_style
from lasso_motion_ros.reports.offline_overlay import DrawnPair, OfflineOverlay, OverlayView, video_picture
from lasso_motion_ros.reports.picture_files import write_png
from lasso_motion_ros.reports.video import VideoWriter
from lasso_motion_ros.stream.problem_log import Problem, problem_lines
from lasso_motion_ros.stream.recorded_pairs import recorded_pairs
from msg_adapters.recordings.reader import RecordingReader
from msg_adapters.recordings.tracking_topics import check_tracking_topics

Array = npt.NDArray[np.float64]

CELL_PX = 768
FRAMES = tuple(f"plane_{plane}_*.png" for plane in PLANES)
"""Names of the frames in a directory."""


@dataclass(frozen=True)
class RenderedPair:
    """One pair that was drawn.

    Attributes:
        stamp_ns: plane A's stamp.
        compensated: whether a motion was applied.
        status: the words on the picture, or empty.
    """

    stamp_ns: int
    compensated: bool
    status: str


@dataclass(frozen=True)
class RenderSummary:
    """What was drawn.

    Attributes:
        shown: what was drawn, in words.
        pairs: in order of time.
        problems: what was wrong with messages, a line each.
        damage: what is wrong with the recording as a file, or None.
    """

    shown: str
    pairs: tuple[RenderedPair, ...]
    problems: tuple[str, ...]
    damage: str | None

    @property
    def compensated(self) -> int:
        """How many pairs were drawn with a motion."""
        return sum(pair.compensated for pair in self.pairs)


def render_recording(
    recording: Path,
    result: Path,
    output: Path,
    config: OverlayConfig,
    say: Callable[[str], None],
    *,
    view: OverlayView = "compensated",
    rate_hz: float | None = None,
    remap: Mapping[str, str] | None = None,
    quiet: bool = True,
) -> RenderSummary:
    """Draw every pair of a recording with the motion that a tracker published on it.

    Args:
        recording: MCAP file or bag directory with the images.
        result: what the tracker published.
        output: OUT.mp4, or a directory for PNG frames, one a plane and pair.
        config: the overlay's parameters, with the file of what is drawn.
        say: takes a line for the user: what is drawn.
        view: what of it.
        rate_hz: of the video; None: the recording's own.
        remap: recorded topic → the name it is read as.
        quiet: no progress bar.

    Raises:
        LassoMotionError: a file that cannot be read or written, or a recording without a pair; no output is left then.
    """
    with busy(f"reading {config.volume_file}", quiet):
        shown = read_reference_anatomy(config)
    say(shown.description)
    reader = RecordingReader(recording, remap)
    check_tracking_topics(reader.path, reader.topics)
    estimates = read_estimates(result)
    painter = OverlayPainter(shown.drawn, overlay_style(config.style))
    overlay = OfflineOverlay(painter, config, estimates, view)
    problems: Counter[Problem] = Counter()
    stream = replace(StreamConfig(), sync=config.sync, plane_a=config.plane_a, plane_b=config.plane_b)
    pairs = recorded_pairs(reader, stream, problems)
    rendered = []
    with ExitStack() as stack:
        place = output if is_video(output) else stack.enter_context(whole_directory(output, FRAMES))
        pictures = stack.enter_context(_Output(place, view, rate_hz, _centre(estimates, shown)))
        for number, pair in enumerate(progress(pairs, len(estimates) or None, "rendering", quiet)):
            drawn = overlay.draw(pair)
            pictures.write(number, pair, drawn)
            rendered.append(RenderedPair(pair.stamp_ns, drawn.compensated, drawn.status))
        lines = problem_lines(problems)
        if not rendered:
            raise RecordingError(f"{recording}: no image pair could be made{': ' if lines else ''}{'; '.join(lines)}")
    return RenderSummary(shown.description, tuple(rendered), tuple(lines), reader.damage)


class _Output:
    """The video, or the frames in a directory that is there, as a context manager."""

    def __init__(self, path: Path, view: OverlayView, rate_hz: float | None, centre: Array) -> None:
        self._path, self._view, self._rate_hz, self._centre = path, view, rate_hz, centre
        self._video: VideoWriter | None = None
        self._first: tuple[int, DrawnPair] | None = None
        self._start_ns = 0

    def __enter__(self) -> _Output:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if kind is None and self._first is not None:  # a recording of one pair has no rate of its own
            self._add_frame(*self._first, self._rate_hz or 1.0)
        if self._video is not None:
            self._video.__exit__(kind, error, trace)

    def write(self, number: int, pair: FramePair, drawn: DrawnPair) -> None:
        if self._path.is_dir():
            for plane, picture in drawn.planes.items():
                write_png(self._path / f"plane_{plane}_{number:05d}.png", picture)
            return
        if self._video is None and self._first is None:
            self._first, self._start_ns = (pair.stamp_ns, drawn), pair.stamp_ns
            return
        # The first two stamps tell how fast the video plays; until the second comes the first waits.
        rate = self._rate_hz or float(np.clip(1e9 / max(pair.stamp_ns - self._start_ns, 1), 0.2, 60.0))
        if self._first is not None:
            first, self._first = self._first, None
            self._add_frame(*first, rate)
        self._add_frame(pair.stamp_ns, drawn, rate)

    def _add_frame(self, stamp_ns: int, drawn: DrawnPair, rate: float) -> None:
        if self._video is None:
            self._video = VideoWriter(self._path, rate)
        words = f"t = {1e-9 * (stamp_ns - self._start_ns):.2f} s   {drawn.state.replace('_', ' ') or 'no answer'}   "
        if drawn.motion is None:
            words += "not compensated"
        else:
            shift = 1e3 * (transforms.apply(drawn.motion, self._centre) - self._centre)
            words += f"motion x {shift[0]:+.1f}  y {shift[1]:+.1f}  z {shift[2]:+.1f} mm"
        self._video.write(video_picture(drawn, self._view, CELL_PX, words))


def _centre(estimates: Sequence[PairEstimate], shown: ReferenceAnatomy) -> Array:
    """(3,) where the motion is told in millimetres: the first published loop's centre, else the anatomy's."""
    loop = next((one.loop for one in estimates if one.loop is not None), None)
    return np.asarray((shown.surface.vertices if loop is None else loop).mean(axis=0))


def is_video(path: Path) -> bool:
    """Whether an output's name asks for a video."""
    return path.suffix.lower() == ".mp4"
