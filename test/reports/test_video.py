"""Videos: decoded again, and laid out as browsers want them."""

from fractions import Fraction

import numpy as np
import pytest

from lasso_motion_ros.core.errors import RecordingError
from lasso_motion_ros.reports.video import VideoWriter

av = pytest.importorskip("av", reason="pip install 'lasso_motion_ros[video]'")

COLOURS = [(200, 40, 40), (40, 200, 40), (40, 40, 200), (128, 128, 128), (230, 230, 20)]


def pictures(height=120, width=161):
    for colour in COLOURS:
        yield np.broadcast_to(np.array(colour, np.uint8), (height, width, 3)).copy()


def write(path, rate=3.75):
    with VideoWriter(path, rate) as writer:
        for picture in pictures():
            writer.write(picture)


def test_every_picture_comes_back_at_its_time(tmp_path):
    path = tmp_path / "a.mp4"
    write(path)
    with av.open(str(path)) as container:
        stream = container.streams.video[0]
        assert stream.codec_context.name == "h264"
        assert stream.codec_context.pix_fmt == "yuv420p"
        assert (stream.width, stream.height) == (160, 120)
        frames = list(container.decode(stream))
    assert len(frames) == len(COLOURS)
    for number, (frame, colour) in enumerate(zip(frames, COLOURS, strict=True)):
        assert frame.pts * frame.time_base == pytest.approx(float(Fraction(number, 1) / Fraction(15, 4)), abs=1e-3)
        found = frame.to_ndarray(format="rgb24")[60, 80].astype(int)
        assert np.abs(found - np.array(colour)).max() < 12


def test_the_index_stands_before_the_pictures(tmp_path):
    path = tmp_path / "a.mp4"
    write(path)
    data = path.read_bytes()
    assert data[4:8] == b"ftyp"
    assert 0 < data.index(b"moov") < data.index(b"mdat")


def test_the_same_pictures_give_the_same_file(tmp_path):
    write(tmp_path / "a.mp4")
    write(tmp_path / "b.mp4")
    assert (tmp_path / "a.mp4").read_bytes() == (tmp_path / "b.mp4").read_bytes()


def test_a_picture_of_another_size_or_kind_is_refused(tmp_path):
    with VideoWriter(tmp_path / "a.mp4", 10.0) as writer:
        writer.write(np.zeros((64, 64, 3), np.uint8))
        with pytest.raises(RecordingError, match=r"\(64, 64\) expected, found \(32, 64\)"):
            writer.write(np.zeros((64, 32, 3), np.uint8))
        with pytest.raises(RecordingError, match="float64"):
            writer.write(np.zeros((64, 64, 3)))


def test_what_cannot_be_written_is_said(tmp_path):
    with pytest.raises(RecordingError, match="cannot be written"):
        VideoWriter(tmp_path / "missing" / "a.mp4", 10.0)
    with pytest.raises(RecordingError, match="found 0"):
        VideoWriter(tmp_path / "a.mp4", 0.0)
