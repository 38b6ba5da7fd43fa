"""pip and colcon both install the package whole: scripts, data files, ament index marker, types."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import tarfile
from pathlib import Path
from xml.etree import ElementTree

import pytest
from support.paths import ROOT
from support.rooms import floors

PACKAGE = "lasso_motion_ros"
EXECUTABLES = {"lasso-motion", "lasso_tracker", "lasso_overlay", "lasso_web", "lasso_igtl"}


@pytest.fixture(scope="module")
def sources(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A copy of the checkout: what a build leaves behind must not lie in the real one."""
    destination = tmp_path_factory.mktemp("workspace") / "src" / PACKAGE
    unwanted = shutil.ignore_patterns(
        ".*", "*.egg-info", "__pycache__", "build", "install", "log", "demo_output", "test"
    )
    shutil.copytree(ROOT, destination, ignore=unwanted)
    return destination


@pytest.fixture(scope="module")
def pip_prefix(sources: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    target = tmp_path_factory.mktemp("target")
    options = ("--no-deps", "--no-build-isolation", "--no-compile", "--target", str(target))
    _run([*_PIP, "install", *options, str(sources)])
    return target


@pytest.fixture(scope="module")
def colcon_prefix(sources: Path) -> Path:
    workspace = sources.parents[1]
    colcon = Path(sys.executable).with_name("colcon")
    if not colcon.exists():
        pytest.skip("colcon is not installed")
    _run([str(colcon), "build", "--event-handlers", "console_direct+"], cwd=workspace)
    return workspace / "install" / PACKAGE


_PIP = [sys.executable, "-m", "pip", "--quiet", "--disable-pip-version-check"]


def _run(command: list[str], cwd: Path | None = None, env: dict[str, str] | None = None) -> str:
    done = subprocess.run(command, cwd=cwd, env=env, capture_output=True, encoding="utf-8", check=False)
    assert done.returncode == 0, f"{' '.join(command)}\n{done.stdout}{done.stderr}"
    return done.stdout


def _assert_share_is_complete(prefix: Path) -> None:
    share = prefix / "share" / PACKAGE
    for folder, kinds in (
        ("config", {".yaml", ".xml", ".rviz", ".json"}),
        ("launch", {".py"}),
        ("bags", {".yaml", ".mcap"}),
    ):
        expected = {path.name for path in (ROOT / folder).iterdir() if path.suffix in kinds}
        assert {path.name for path in (share / folder).glob("*") if path.is_file()} == expected
    assert (share / "package.xml").is_file()
    assert (prefix / "share/ament_index/resource_index/packages" / PACKAGE).is_file()


def _assert_modules_are_complete(site_packages: Path) -> None:
    for package in (PACKAGE, "msg_adapters"):
        expected = {path.relative_to(ROOT) for path in (ROOT / package).rglob("*.py")}
        installed = {path.relative_to(site_packages) for path in (site_packages / package).rglob("*.py")}
        assert installed == expected
        assert (site_packages / package / "py.typed").is_file()
    page = Path(PACKAGE) / "web" / "static"
    files = {path.relative_to(ROOT) for path in (ROOT / page).rglob("*") if path.is_file()}
    assert {path.relative_to(site_packages) for path in (site_packages / page).rglob("*") if path.is_file()} == files


def _version_from(site_packages: Path) -> str:
    """The version as the installed modules find it, from a directory that is not the checkout."""
    environment = {**os.environ, "PYTHONPATH": str(site_packages)}
    code = f"import {PACKAGE}.core.share as s; print(s.__file__, s.version())"
    module, found = _run([sys.executable, "-c", code], cwd=site_packages, env=environment).split()
    assert Path(module).is_relative_to(site_packages)
    return found


@pytest.mark.packaging
def test_pip_installs_everything(pip_prefix: Path) -> None:
    _assert_share_is_complete(pip_prefix)
    _assert_modules_are_complete(pip_prefix)
    assert {path.name for path in (pip_prefix / "bin").iterdir()} >= EXECUTABLES
    assert _version_from(pip_prefix) == _version()


@pytest.mark.packaging
@pytest.mark.timeout(300)
def test_colcon_installs_everything(colcon_prefix: Path) -> None:
    _assert_share_is_complete(colcon_prefix)
    (site_packages,) = (colcon_prefix / "lib").glob("python3*/site-packages")
    _assert_modules_are_complete(site_packages)
    # `ros2 run` looks here, not in bin/.
    assert {path.name for path in (colcon_prefix / "lib" / PACKAGE).iterdir()} == EXECUTABLES
    assert _version_from(site_packages) == _version()


@pytest.mark.packaging
@pytest.mark.timeout(300)
def test_colcon_test_runs_the_tests(colcon_prefix: Path, sources: Path) -> None:
    """It takes pytest only where setup.py names it; else it looks for unittests, finds none, and is content."""
    (sources / "test").mkdir()
    (sources / "test" / "test_that_is_run.py").write_text("def test_that_is_run():\n    pass\n")
    colcon = str(Path(sys.executable).with_name("colcon"))
    workspace = colcon_prefix.parents[1]
    _run([colcon, "test"], cwd=workspace)
    assert "Summary: 1 test, 0 errors" in _run([colcon, "test-result", "--all"], cwd=workspace)


@pytest.mark.packaging
def test_the_source_distribution_builds_by_itself(sources: Path, tmp_path: Path) -> None:
    _run([sys.executable, "setup.py", "--quiet", "sdist", "--dist-dir", str(tmp_path)], cwd=sources)
    (archive,) = tmp_path.glob("*.tar.gz")
    with tarfile.open(archive) as packed:
        names = {name.split("/", 1)[1] for name in packed.getnames() if "/" in name}
    assert {"package.xml", "LICENSE", f"resource/{PACKAGE}", "config/brost2009.yaml"} <= names


def _version() -> str:
    return ElementTree.parse(ROOT / "package.xml").getroot().findtext("version", default="")


def test_the_licence_is_named_and_there_in_full() -> None:
    licence = ElementTree.parse(ROOT / "package.xml").getroot().find("license")
    assert licence is not None
    assert licence.text == "Apache-2.0"
    text = (ROOT / licence.attrib["file"]).read_text()
    assert "Apache License" in text
    assert "END OF TERMS AND CONDITIONS" in text


def test_locks_are_exact_and_name_no_host() -> None:
    for lock in sorted((ROOT / "requirements").glob("*.txt")):
        for line in lock.read_text().splitlines():
            entry = line.strip()
            if entry and not entry.startswith("#") and entry != "-r run.txt":
                assert entry.count("==") == 1, f"{lock.name}: {entry}"
                assert not set("/@;:") & set(entry), f"{lock.name}: {entry}"


METHOD_ROOMS = [name for name, floor in floors().items() if floor < floors()["msg_adapters"]]


def test_the_method_imports_no_message_and_no_ros() -> None:
    """Dependencies point one way: the method, imported whole, pulls in neither adapters nor ROS."""
    code = (
        "import sys, pathlib, importlib\n"
        f"from {PACKAGE}.core.compiled import has_kernels\n"
        f"for room in {METHOD_ROOMS}:\n"
        f"    files = sorted((pathlib.Path({str(ROOT / PACKAGE)!r}) / room).glob('*.py'))\n"
        "    assert files, room\n"
        "    for p in files:\n"
        "        try:\n"
        f"            importlib.import_module(f'{PACKAGE}.{{room}}.{{p.stem}}')\n"
        "        except ImportError as error:\n"
        "            if has_kernels() or 'has_kernels' not in str(error):\n"
        "                raise\n"
        "print([m for m in sys.modules if m.split('.')[0] in ('rclpy', 'msg_adapters', 'rosbags', 'sensor_msgs')])"
    )
    assert _run([sys.executable, "-c", code], cwd=ROOT).strip() == "[]"


def test_the_adapters_import_no_rclpy() -> None:
    code = (
        "import sys, pathlib, importlib\n"
        f"for p in sorted(pathlib.Path({str(ROOT / 'msg_adapters')!r}).rglob('*.py')):\n"
        f"    importlib.import_module('.'.join(p.relative_to({str(ROOT)!r}).with_suffix('').parts))\n"
        "print('rclpy' in sys.modules)"
    )
    assert _run([sys.executable, "-c", code], cwd=ROOT).strip() == "False"
