"""The data files are found beside the modules, wherever they were installed; the version stands in one place."""

from __future__ import annotations

from importlib.metadata import version as installed_version
from pathlib import Path

import pytest
from support.paths import ROOT

from lasso_motion_ros.core import share
from lasso_motion_ros.core.errors import LassoMotionError


def test_a_checkout_is_its_own_share_directory() -> None:
    assert share.share_file("package.xml").resolve() == ROOT / "package.xml"


def test_a_file_that_is_not_there_is_named() -> None:
    with pytest.raises(LassoMotionError, match=r"config/nonsense\.yaml: no such file"):
        share.share_file("config/nonsense.yaml")


@pytest.mark.parametrize(
    "modules",
    ["lib/python3.12/site-packages", "local/lib/python3.12/dist-packages", "."],
    ids=["venv or colcon", "Debian's prefix", "pip --target"],
)
def test_an_installation_is_searched_upwards(modules: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    package = tmp_path / modules / "lasso_motion_ros"
    package.mkdir(parents=True)
    data = tmp_path / "share" / "lasso_motion_ros"
    data.mkdir(parents=True)
    (data / "package.xml").write_text("<package><version>1.2.3</version></package>")
    monkeypatch.setattr(share, "__file__", str(package / "core" / "share.py"))
    assert share.share_directory() == data
    assert share.version() == "1.2.3"


def test_modules_without_their_data_say_so(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(share, "__file__", str(tmp_path / "lasso_motion_ros" / "core" / "share.py"))
    with pytest.raises(LassoMotionError, match="install with pip or colcon"):
        share.share_file("config/tracker.yaml")


def test_the_changelog_and_the_installed_metadata_know_the_version() -> None:
    assert installed_version("lasso_motion_ros") == share.version()
    assert f"\n{share.version()} (" in (ROOT / "CHANGELOG.rst").read_text()
