"""A file is read no further than it may be long, whatever its size is said to be."""

from __future__ import annotations

import errno
from pathlib import Path

import pytest

from lasso_motion_ros.core.bounded_files import read_bounded


def test_the_bound_itself_is_allowed(tmp_path: Path) -> None:
    path = tmp_path / "file"
    path.write_bytes(b"1234")
    assert read_bounded(path, 4) == b"1234"
    with pytest.raises(OSError, match="more than 3 bytes") as caught:
        read_bounded(path, 3)
    assert caught.value.errno == errno.EFBIG


def test_a_device_has_no_size_and_no_end() -> None:
    assert Path("/dev/zero").stat().st_size == 0
    with pytest.raises(OSError, match="more than 100 bytes"):
        read_bounded("/dev/zero", 100)
