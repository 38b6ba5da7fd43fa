"""Cut, corrupt and hostile files are read as far as they go, or refused in one line."""

from __future__ import annotations

import struct
import tracemalloc
from pathlib import Path

import numpy as np
import pytest
import zstandard
from mcap.reader import make_reader
from support.recording_inputs import content, expected, write, write_noise

from lasso_motion_ros.core.errors import RecordingError
from msg_adapters.recordings.reader import RecordingReader


@pytest.mark.parametrize("compression", ["zstd", "none"])
def test_a_file_cut_anywhere_gives_all_that_is_whole(tmp_path: Path, compression: str) -> None:
    path = write_noise(tmp_path / "r.mcap", 9, compression)
    whole = content(path)
    data = path.read_bytes()
    counts = []
    for cut in np.linspace(400, len(data) - 1, 25).astype(int):
        (tmp_path / "cut.mcap").write_bytes(data[:cut])
        reader = RecordingReader(tmp_path / "cut.mcap")
        found = [(m.topic, m.log_time_ns, m.data) for m in reader.raw_messages()]
        assert found == whole[: len(found)]
        assert reader.damage is not None
        assert "ends at byte" in reader.damage
        # Nothing that lies wholly before the cut is lost but what a compressor still held back.
        assert len(found) >= int(9 * cut / len(data)) - 1
        counts.append(len(found))
    assert counts == sorted(counts)
    assert counts[-1] == 9


def test_a_cut_chunk_is_used_up_to_the_cut(tmp_path: Path) -> None:
    path = write_noise(tmp_path / "r.mcap", 3, "none")  # one chunk of three images
    (tmp_path / "cut.mcap").write_bytes(path.read_bytes()[: int(2.5 * 512 * 512)])
    assert len(content(tmp_path / "cut.mcap")) == 2


def test_a_corrupt_chunk_is_left_out_and_the_rest_is_read(tmp_path: Path) -> None:
    path = write_noise(tmp_path / "r.mcap", 12, "none")
    whole = content(path)
    data = bytearray(path.read_bytes())
    data[len(data) // 2] ^= 0xFF
    path.write_bytes(data)
    reader = RecordingReader(path)
    found = [(m.topic, m.log_time_ns, m.data) for m in reader.raw_messages()]
    assert 0 < len(found) < 12
    assert set(found) < set(whole)
    assert found[-1] == whole[-1]
    assert reader.damage is not None
    assert "corrupt" in reader.damage


@pytest.mark.parametrize("spoilt", [0x00, 0x7F, 0xFF])
def test_behind_a_damaged_place_the_index_leads_on(tmp_path: Path, spoilt: int) -> None:
    path = write_noise(tmp_path / "r.mcap", 24)
    whole = content(path)
    with path.open("rb") as file:
        summary = make_reader(file).get_summary()
    assert summary is not None
    data = bytearray(path.read_bytes())
    place = summary.chunk_indexes[1].chunk_start_offset
    data[place : place + 9] = bytes([spoilt]) * 9
    path.write_bytes(data)
    reader = RecordingReader(path)
    found = [(m.topic, m.log_time_ns, m.data) for m in reader.raw_messages()]
    lost = len(set(whole) - set(found))
    assert 0 < lost <= 5, "the messages of one chunk"
    assert found[-1] == whole[-1]
    assert reader.damage is not None
    assert "middle is not readable" in reader.damage


def test_an_index_that_says_a_chunk_is_shorter_than_its_head_is_passed_over(tmp_path: Path) -> None:
    path = write_noise(tmp_path / "r.mcap", 24)
    whole = content(path)
    with path.open("rb") as file:
        summary = make_reader(file).get_summary()
    assert summary is not None
    data = bytearray(path.read_bytes())
    first, second, third = (index.chunk_start_offset for index in summary.chunk_indexes[:3])
    data[second : second + 9] = bytes(9)
    # The index's record begins with two times, the chunk's place and its length; a summary without checksum.
    in_index = data.index(struct.pack("<Q", third), first)
    struct.pack_into("<Q", data, in_index + 8, 3)
    struct.pack_into("<I", data, len(data) - 8 - 4, 0)
    path.write_bytes(data)
    reader = RecordingReader(path)
    found = [(m.topic, m.log_time_ns, m.data) for m in reader.raw_messages()]
    assert 0 < len(set(whole) - set(found)) <= 10, "the messages of two chunks"
    assert found[-1] == whole[-1]
    assert reader.damage is not None
    assert "middle is not readable" in reader.damage


@pytest.mark.parametrize("compression", ["zstd", "none"])
def test_whatever_is_spoilt_only_a_recording_error_comes_out(tmp_path: Path, compression: str) -> None:
    data = write(tmp_path / "r.mcap", compression=compression).read_bytes()
    random = np.random.default_rng(1)
    for _ in range(60):
        spoilt = bytearray(data)
        for place in random.integers(8, len(data), random.integers(1, 6)):
            spoilt[place] = random.integers(0, 256)
        (tmp_path / "spoilt.mcap").write_bytes(spoilt)
        try:
            found = list(RecordingReader(tmp_path / "spoilt.mcap").messages())
        except RecordingError:
            continue
        assert len(found) <= 26


def test_zeros_behind_the_data_are_no_records(tmp_path: Path) -> None:
    path = write_noise(tmp_path / "r.mcap", 8)
    path.write_bytes(path.read_bytes()[:900_000] + bytes(100_000))
    reader = RecordingReader(path)
    assert len(list(reader.messages())) >= 2
    assert reader.damage is not None


def test_a_file_of_another_format_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "video.mcap"
    path.write_bytes(b"RIFF" + bytes(100))
    with pytest.raises(RecordingError, match="is not an MCAP recording"):
        RecordingReader(path)
    with pytest.raises(RecordingError, match="no such recording"):
        RecordingReader(tmp_path / "absent.mcap")
    (tmp_path / "empty.mcap").write_bytes(b"")
    with pytest.raises(RecordingError, match="is not an MCAP recording"):
        RecordingReader(tmp_path / "empty.mcap")


@pytest.mark.parametrize("claims", [1000, 1 << 40])
def test_a_chunk_unpacks_to_no_more_than_it_says_or_is_sensible(tmp_path: Path, claims: int) -> None:
    """A few kilobytes that unpack to 64 MB."""
    packed = zstandard.ZstdCompressor().compress(bytes(64 << 20))
    head = struct.pack("<QQQI", 0, 2**62, claims, 0) + struct.pack("<I", 4) + b"zstd" + struct.pack("<Q", len(packed))
    data = write(tmp_path / "sound.mcap").read_bytes()
    bomb = struct.pack("<BQ", 0x06, len(head) + len(packed)) + head + packed
    (tmp_path / "bomb.mcap").write_bytes(data[:8] + bomb + data[8:])
    tracemalloc.start()
    assert content(tmp_path / "bomb.mcap") == expected(6)
    assert tracemalloc.get_traced_memory()[1] < 16 << 20
    tracemalloc.stop()


def test_a_chunk_that_ends_before_it_begins_is_left_out(tmp_path: Path) -> None:
    data = bytearray(write(tmp_path / "sound.mcap", compression="none").read_bytes())
    place = data.index(struct.pack("<B", 0x06), 8)
    while data[place] == 0x06 and struct.unpack_from("<Q", data, place + 1)[0] > len(data):
        place = data.index(struct.pack("<B", 0x06), place + 1)
    struct.pack_into("<Q", data, place + 1, 40)  # the chunk's head alone is longer
    (tmp_path / "spoilt.mcap").write_bytes(data)
    reader = RecordingReader(tmp_path / "spoilt.mcap")
    list(reader.raw_messages())
    assert reader.damage is not None
