"""Kernels that are not kept are compiled by other processes, once, and nothing of them is left behind."""

from __future__ import annotations

import os
import re
import select
import signal
import subprocess
import sys
from pathlib import Path

import pytest
from support.child_processes import children_of, is_running
from support.paths import ROOT

from lasso_motion_ros.core.compiled import NotKept, arithmetic, has_kernels, hold_back
from lasso_motion_ros.stream import kernels
from lasso_motion_ros.stream.kernels import MODULES, Compilation, load_kept

has_numba = pytest.mark.skipif(not has_kernels(), reason="the extra `fast` is not installed")

KERNEL = """
from lasso_motion_ros.core.compiled import compiled

@compiled("float64(float64)")
def doubled(value):
    return 2.0 * value
"""
ENDLESS = "import time\ntime.sleep(1000.0)\n"


def test_every_file_of_kernels_is_named() -> None:
    package = ROOT / "lasso_motion_ros"
    files = [path for path in package.rglob("*.py") if re.search(r"^ *@compiled\(", path.read_text("utf-8"), re.M)]
    assert {".".join(path.relative_to(ROOT).with_suffix("").parts) for path in files} == set(MODULES)
    assert len(set(MODULES)) == len(MODULES)


@pytest.fixture
def one_kernel(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A file of kernels that stands for all, and is in no cache."""
    file = tmp_path / "kernel_that_stands_for_all.py"
    file.write_text(KERNEL)
    monkeypatch.syspath_prepend(str(tmp_path))
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join([str(tmp_path), str(ROOT), os.environ.get("PYTHONPATH", "")]))
    monkeypatch.setattr(kernels, "MODULES", (file.stem,))
    monkeypatch.delitem(sys.modules, file.stem, raising=False)
    return file


@has_numba
def test_what_a_child_has_compiled_is_loaded(one_kernel: Path) -> None:
    with pytest.raises(NotKept) as missing:
        load_kept()
    assert missing.value.folder == str(one_kernel.parent / "__pycache__")
    with Compilation(2, niceness=1) as compilation:
        assert compilation.wait() == ""
    load_kept()
    assert sys.modules[one_kernel.stem].doubled(3.0) == 6.0
    assert sys.modules[one_kernel.stem].doubled.stats.cache_misses == {}


@has_numba
def test_why_a_child_has_failed_is_said(one_kernel: Path) -> None:
    one_kernel.write_text("raise OSError('no space left on device')")
    with Compilation() as compilation:
        assert compilation.wait() == "OSError: no space left on device"


@has_numba
def test_a_command_waits_for_what_is_compiled(one_kernel: Path, caplog: pytest.LogCaptureFixture) -> None:
    kernels.say_that_it_takes_time.cache_clear()
    kernels.load_kernels()
    assert [record.getMessage()[:26] for record in caplog.records] == ["compiling for this machine"]
    assert sys.modules[one_kernel.stem].doubled.stats.cache_misses == {}


@has_numba
def test_where_nothing_can_be_kept_that_is_known(one_kernel: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from numba.core import caching

    monkeypatch.setattr(caching.CompileResultCacheImpl, "_locator_classes", [])
    with pytest.raises(NotKept, match="NUMBA_CACHE_DIR may name a folder that can be written") as missing:
        load_kept()
    assert missing.value.folder is None


@has_numba
@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGINT])
def test_no_child_outlives_its_parent(one_kernel: Path, number: signal.Signals) -> None:
    one_kernel.write_text(ENDLESS)
    code = f"""
from lasso_motion_ros.stream import kernels
kernels.MODULES = ({one_kernel.stem!r},)
with kernels.Compilation() as compilation:
    print("begun", flush=True)
    compilation.wait()
"""
    with subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE, stderr=subprocess.DEVNULL) as parent:
        assert parent.stdout is not None
        assert parent.stdout.readline() == b"begun\n"
        (child,) = children_of(parent.pid)
        parent.send_signal(number)
        parent.wait(60)
    if is_running(child):
        handle = os.pidfd_open(child)
        assert select.select([handle], [], [], 60)[0], "it is still there"
        os.close(handle)


@has_numba
def test_kernels_that_are_held_back_do_not_run() -> None:
    try:
        hold_back("somebody compiles them")
        assert not has_kernels()
        assert arithmetic() == "plain numpy: somebody compiles them"
    finally:
        hold_back("")
    assert has_kernels()
