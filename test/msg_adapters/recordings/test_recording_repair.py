"""Cut and corrupt recordings made whole: every reader takes them, and nothing that was readable is lost."""

from __future__ import annotations

from pathlib import Path

import pytest
from mcap.reader import make_reader
from rosbags.highlevel import AnyReader
from support.message_inputs import stream

from lasso_motion_ros.cli.main import main
from lasso_motion_ros.core.errors import RecordingError
from msg_adapters.recordings.reader import RecordingReader
from msg_adapters.recordings.repair import repair_recording
from msg_adapters.recordings.writer import RecordingWriter

PAIRS = 12


def write(path: Path, compression: str = "none", flush_every: int = 5) -> Path:
    with RecordingWriter(path, compression) as writer:
        for index, (topic, type_name, message, at) in enumerate(stream(PAIRS)):
            writer.write(topic, type_name, message, at, latched=topic.endswith("camera_info"))
            if index % flush_every == 0:
                writer.flush()
    return path


def content(path: Path) -> list[tuple[str, int, int, bytes]]:
    return [(m.topic, m.log_time_ns, m.publish_time_ns, m.data) for m in RecordingReader(path).raw_messages()]


@pytest.mark.parametrize("compression", ["none", "zstd"])
@pytest.mark.parametrize("share", [0.2, 0.5, 0.8, 0.95, 0.999])
def test_wherever_it_was_cut_what_was_readable_is_there_for_every_reader(
    tmp_path: Path, compression: str, share: float
) -> None:
    path = write(tmp_path / "r.mcap", compression)
    whole = path.read_bytes()
    path.write_bytes(whole[: int(share * len(whole))])
    before = content(path)
    latched = RecordingReader(path).latched_topics
    repaired = repair_recording(path)
    assert repaired.damage is not None
    assert sum(repaired.counts.values()) == len(before) > 0
    assert repaired.seconds == pytest.approx((before[-1][1] - before[0][1]) / 1e9)
    assert content(path) == before
    assert RecordingReader(path).damage is None
    assert RecordingReader(path).latched_topics == latched
    with path.open("rb") as file:
        reader = make_reader(file)
        summary = reader.get_summary()
        assert summary is not None
        assert summary.statistics is not None
        assert summary.statistics.message_count == len(before)
        assert {index.compression for index in summary.chunk_indexes} == {"" if compression == "none" else "zstd"}
        assert [record.name for record in reader.iter_metadata()] == ["rosbag2"]
    with AnyReader([path]) as others:
        assert others.message_count == len(before)
    assert list(tmp_path.iterdir()) == [path]  # nothing is left beside it


def test_best_effort_topics_stay_so(tmp_path: Path) -> None:
    path = tmp_path / "r.mcap"
    with RecordingWriter(path, "none") as writer:
        writer.write_raw("/note", "std_msgs/msg/String", b"\0\1\0\0\1\0\0\0\0", 1, reliable=False)
        writer.flush()
        writer.write_raw("/other", "std_msgs/msg/String", b"\0\1\0\0\1\0\0\0\0", 2)
    path.write_bytes(path.read_bytes()[:-20])
    assert repair_recording(path).damage is not None
    assert RecordingReader(path).best_effort_topics == {"/note"}


def test_a_corrupt_chunk_is_left_out_and_all_others_kept(tmp_path: Path) -> None:
    path = write(tmp_path / "r.mcap")
    before = content(path)
    spoilt = bytearray(path.read_bytes())
    spoilt[len(spoilt) // 3] ^= 0xFF
    path.write_bytes(spoilt)
    readable = content(path)
    assert 0 < len(readable) < len(before)
    assert repair_recording(path).damage is not None
    assert content(path) == readable
    assert RecordingReader(path).damage is None


def test_a_whole_recording_is_left_as_it_is(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = write(tmp_path / "r.mcap")
    before, written = path.read_bytes(), path.stat().st_mtime_ns
    assert main(["record", "--repair", str(path)]) == 0
    assert capsys.readouterr().out == f"{path} is whole; nothing was changed\n"
    assert (path.read_bytes(), path.stat().st_mtime_ns) == (before, written)


def test_what_holds_nothing_is_left_as_it_is(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = write(tmp_path / "r.mcap")
    path.write_bytes(path.read_bytes()[:60])  # the opening record only
    before = path.read_bytes()
    assert main(["record", "--repair", str(path)]) == 2
    assert "no message in it can be read; it was left as it is" in capsys.readouterr().err
    assert path.read_bytes() == before
    assert list(tmp_path.iterdir()) == [path]


def test_a_directory_and_a_stranger_are_refused(tmp_path: Path) -> None:
    with pytest.raises(RecordingError, match=r"name the \.mcap file"):
        repair_recording(tmp_path)
    other = tmp_path / "notes.txt"
    other.write_text("no recording")
    with pytest.raises(RecordingError, match="not an MCAP recording"):
        repair_recording(other)
    assert other.read_text() == "no recording"


def test_what_was_flushed_is_read_while_the_file_is_still_open(tmp_path: Path) -> None:
    path = tmp_path / "r.mcap"
    with RecordingWriter(path, "none") as writer:
        for topic, type_name, message, at in stream(2):
            writer.write(topic, type_name, message, at)
        assert path.stat().st_size == 0  # nothing has left the process: a kill now would lose it
        writer.flush()
        assert len(content(path)) == sum(1 for _ in stream(2)) == sum(writer.counts.values())
