"""The shared-memory profile: the shipped file, its size, and that a user's own stays."""

from __future__ import annotations

from collections import namedtuple
from pathlib import Path
from xml.etree import ElementTree

import pytest

from lasso_motion_ros.core.share import share_file
from lasso_motion_ros.nodes import fastdds

MIB = 1024 * 1024
Usage = namedtuple("Usage", "total used free")


def segment(text: str) -> int:
    element = ElementTree.fromstring(text.encode()).find(".//{*}segment_size")
    assert element is not None
    return int(element.text or "0")


def test_the_shipped_file_is_the_profile_that_the_nodes_use() -> None:
    text = share_file("config/fastdds.xml").read_text(encoding="utf-8")
    assert text == fastdds.profile_xml()
    assert segment(text) == 32 * MIB


@pytest.mark.parametrize(
    ("free_mib", "expected_mib"), [(1024, 32), (128, 32), (64, 16), (33, 8), (20, 8), (9, 8), (8, None), (0, None)]
)
def test_several_participants_find_room(free_mib: int, expected_mib: int | None) -> None:
    expected = None if expected_mib is None else expected_mib * MIB
    assert fastdds.segment_bytes_for(free_mib * MIB) == expected


def test_the_profile_is_written_and_named(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(fastdds.shutil, "disk_usage", lambda path: Usage(0, 0, 64 * MIB))
    environment: dict[str, str] = {}
    assert fastdds.use_image_profile(environment) is None
    assert segment(Path(environment["FASTRTPS_DEFAULT_PROFILES_FILE"]).read_text()) == 16 * MIB


@pytest.mark.parametrize("name", ["FASTRTPS_DEFAULT_PROFILES_FILE", "FASTDDS_DEFAULT_PROFILES_FILE"])
def test_a_users_own_profile_stays(monkeypatch: pytest.MonkeyPatch, tmp_path: Path, name: str) -> None:
    monkeypatch.chdir(tmp_path)
    environment = {name: "/theirs.xml"}
    assert fastdds.use_image_profile(environment) is None
    assert environment == {name: "/theirs.xml"}


def test_a_profile_in_the_current_directory_stays(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    (tmp_path / "DEFAULT_FASTRTPS_PROFILES.xml").write_text("<dds/>")
    monkeypatch.chdir(tmp_path)
    environment: dict[str, str] = {}
    assert fastdds.use_image_profile(environment) is None
    assert environment == {}


def test_too_little_shared_memory_is_said_with_its_cure(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(fastdds.shutil, "disk_usage", lambda path: Usage(0, 0, 5 * MIB))
    environment: dict[str, str] = {}
    assert fastdds.use_image_profile(environment) == (
        "/dev/shm has 5 MiB free, images need 8 MiB a process: images may be lost; "  # noqa: S108
        "give the container more (docker run --shm-size=256m)"
    )
    assert environment == {}
