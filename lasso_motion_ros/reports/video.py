"""MP4 files that browsers play: H.264 in 4:2:0, the index in front."""

from __future__ import annotations

from contextlib import suppress
from fractions import Fraction
from pathlib import Path
from types import TracebackType
from typing import Any

import numpy as np

from lasso_motion_ros.core.errors import RecordingError
from lasso_motion_ros.core.output_files import UnfinishedFile, cannot_write
from lasso_motion_ros.overlay.windowing import RgbImage

TIME_BASE = Fraction(1, 90_000)


class VideoWriter:
    """Writes RGB pictures of one size to an MP4, overwriting, whole or not at all, as a context manager.

    Browsers decode 4:2:0 only, which needs even sides: an odd last row or column is dropped.

    Args:
        path: the file.
        frames_per_second: how fast it plays.
        quality: constant rate factor of x264, 0 (lossless) to 51; 20 keeps noise and thin lines.

    Raises:
        RecordingError: PyAV is not installed, a rate that is not positive, or the file cannot be written.
    """

    def __init__(self, path: str | Path, frames_per_second: float, quality: int = 20) -> None:
        try:
            import av
        except ImportError as error:
            raise RecordingError("writing a video needs PyAV: pip install 'lasso_motion_ros[video]'") from error
        if not 0.0 < frames_per_second <= 240.0:
            raise RecordingError(f"{path}: a video plays at 0 to 240 frames/s, found {frames_per_second}")
        self._path = Path(path)
        self._unfinished = UnfinishedFile(self._path)
        self._rate = Fraction(frames_per_second).limit_denominator(1001)
        self._quality = quality
        self._av = av
        self._stream: Any = None
        self._size = (0, 0)
        self._frames = 0
        try:
            # PyAV opens the file only with the first picture; a bad path must fail at once.
            self._unfinished.path.open("wb").close()
            self._container = av.open(str(self._unfinished.path), "w", format="mp4", options={"movflags": "+faststart"})
        except (OSError, av.FFmpegError) as error:
            raise cannot_write(self._path, error) from error

    def __enter__(self) -> VideoWriter:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, value: BaseException | None, traceback: TracebackType | None
    ) -> None:
        if kind is None:
            self.close()
        else:
            self._discard()

    def write(self, picture: RgbImage) -> None:
        """Append one picture (H, W, 3) uint8 RGB; all have the first one's size.

        Raises:
            RecordingError: another shape than the first picture's, or the disk is full.
        """
        if picture.dtype != np.uint8 or picture.ndim != 3 or picture.shape[2] != 3 or min(picture.shape[:2]) < 2:
            raise RecordingError(f"{self._path}: a picture is (H, W, 3) uint8, found {picture.dtype} {picture.shape}")
        height, width = picture.shape[0] & ~1, picture.shape[1] & ~1
        if self._stream is None:
            self._open_stream(width, height)
        if (width, height) != self._size:
            raise RecordingError(f"{self._path}: pictures of {self._size} expected, found {(width, height)}")
        frame = self._av.VideoFrame.from_ndarray(np.ascontiguousarray(picture[:height, :width]), format="rgb24")
        # x264 counts in the stream's own time base, so the rate may be any fraction.
        frame.time_base = TIME_BASE
        frame.pts = round(self._frames / self._rate / TIME_BASE)
        self._frames += 1
        self._mux(frame)

    def close(self) -> None:
        """Finish the file; calling it again is harmless.

        Raises:
            RecordingError: the disk is full; nothing is left then.
        """
        if self._container is None:
            return
        try:
            if self._stream is not None:
                self._mux(None)
            self._container.close()
        except BaseException as error:
            self._discard()
            if isinstance(error, (OSError, self._av.FFmpegError)):
                raise cannot_write(self._path, error) from error
            raise
        self._container = None
        self._unfinished.finish()

    def _discard(self) -> None:
        container, self._container = self._container, None
        if container is not None:
            with suppress(OSError, self._av.FFmpegError):  # it is thrown away: a full disk does not matter any more
                container.close()
        self._unfinished.discard()

    def _open_stream(self, width: int, height: int) -> None:
        stream = self._container.add_stream("libx264", rate=self._rate)
        stream.width, stream.height = width, height
        stream.pix_fmt = "yuv420p"
        stream.codec_context.time_base = TIME_BASE
        # One thread and no wall clock: the same pictures give the same file.
        stream.codec_context.thread_count = 1
        stream.options = {"crf": str(self._quality), "preset": "fast"}
        self._stream, self._size = stream, (width, height)

    def _mux(self, frame: Any) -> None:
        try:
            for packet in self._stream.encode(frame):
                self._container.mux(packet)
        except (OSError, self._av.FFmpegError) as error:
            raise cannot_write(self._path, error) from error
