"""Which arithmetic runs is never a matter of chance: it is said, and a broken installation is an error."""

from __future__ import annotations

import os
import subprocess
import sys
import warnings
from pathlib import Path

import pytest
from support.paths import ROOT

from lasso_motion_ros.core import compiled
from lasso_motion_ros.core.compiled import arithmetic, has_kernels, plain

has_numba = pytest.mark.skipif(not has_kernels(), reason="the extra `fast` is not installed")


@has_numba
def test_plain_is_for_a_while() -> None:
    assert arithmetic().startswith("compiled by Numba 0.")
    with plain():
        assert not has_kernels()
        assert arithmetic() == "plain numpy, as asked for"
    assert has_kernels()


def test_without_the_extra_the_plain_versions_run(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(compiled, "_numba", lambda: None)
    assert not has_kernels()
    assert arithmetic() == "plain numpy: the extra `fast` is not installed"


def run(code: str, **environment: str) -> subprocess.CompletedProcess[str]:
    """A process of its own."""
    paths = os.pathsep.join([*environment.pop("first", "").split(), str(ROOT), os.environ.get("PYTHONPATH", "")])
    known = os.environ | {"PYTHONPATH": paths, "PYTHONDONTWRITEBYTECODE": "1"} | environment
    return subprocess.run([sys.executable, "-c", code], env=known, capture_output=True, text=True, check=False)


def test_a_broken_installation_is_an_error(tmp_path: Path) -> None:
    (tmp_path / "numba.py").write_text("raise ImportError('Numba needs NumPy 1.26 or less')")
    code = """
from lasso_motion_ros.config.tracker import TrackerConfig
from lasso_motion_ros.core.errors import ConfigurationError
from lasso_motion_ros.stream.tracker_factory import create_tracker
try:
    create_tracker(TrackerConfig())
except ConfigurationError as error:
    print(error)
"""
    done = run(code, first=str(tmp_path))
    assert "ImportError: Numba needs NumPy 1.26 or less" in done.stdout, done.stderr
    assert "pip uninstall numba" in done.stdout


def test_help_needs_no_compiler() -> None:
    done = run("""
import sys
from lasso_motion_ros.cli.main import main
try:
    main(["--help"])
except SystemExit:
    assert "numba" not in sys.modules
    assert "cv2" not in sys.modules
""")
    assert done.returncode == 0, done.stderr


KERNEL = """
from lasso_motion_ros.core.compiled import compiled

@compiled("float64(float64)")
def doubled(value):
    return 2.0 * value

print(doubled(3.0), doubled.stats.cache_path)
"""


@has_numba
@pytest.mark.skipif(os.geteuid() == 0, reason="root writes everywhere")
def test_where_nothing_can_be_written_it_is_compiled_anew_and_said(tmp_path: Path) -> None:
    (tmp_path / "kernel_file.py").write_text(KERNEL)
    tmp_path.chmod(0o500)
    try:
        done = run("import kernel_file", first=str(tmp_path), HOME="/nonexistent", XDG_CACHE_HOME="/nonexistent")
    finally:
        tmp_path.chmod(0o700)
    assert done.stdout.startswith("6.0"), done.stderr
    assert "NUMBA_CACHE_DIR may name a folder" in done.stderr


@has_numba
def test_what_was_compiled_is_kept_where_the_user_says(tmp_path: Path) -> None:
    (tmp_path / "kernel_file.py").write_text(KERNEL)
    done = run("import kernel_file", first=str(tmp_path), NUMBA_CACHE_DIR=str(tmp_path / "kept"))
    assert done.stdout.startswith("6.0"), done.stderr
    assert list((tmp_path / "kept").rglob("*.nbi"))
    # That takes time, which is said; and not again.
    assert done.stderr.count("compiling for this machine") == 1
    again = run("import kernel_file", first=str(tmp_path), NUMBA_CACHE_DIR=str(tmp_path / "kept"))
    assert (again.returncode, again.stderr) == (0, "")


@has_numba
def test_a_folder_that_cannot_be_found_for_the_cache_is_warned_of(monkeypatch: pytest.MonkeyPatch) -> None:
    def numba() -> object:
        class Numba:
            @staticmethod
            def njit(signatures: list[str], **options: object) -> object:
                if options.get("cache"):
                    raise RuntimeError("cannot cache function 'f': no locator available for file 'f.py'")
                return lambda function: function

        return Numba

    monkeypatch.setattr(compiled, "_numba", numba)
    with pytest.warns(UserWarning, match="compiled anew at every start; NUMBA_CACHE_DIR"):
        assert compiled.compiled("float64(float64)")(abs) is abs
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        monkeypatch.undo()
        has_kernels()
