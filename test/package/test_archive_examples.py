"""The examples for archives: what Slurm is asked for, and what Snakemake runs."""

from __future__ import annotations

import importlib.util
import re

import pytest
from support.paths import ROOT

from lasso_motion_ros.cli.main import COMMANDS


def test_slurm_gets_jobs_of_workers_with_one_thread_each() -> None:
    pytest.importorskip("dask_jobqueue", reason="needs the cluster extra")
    spec = importlib.util.spec_from_file_location("slurm_archive", ROOT / "examples" / "slurm_archive.py")
    assert spec is not None
    assert spec.loader is not None
    example = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(example)
    local = {"dashboard_address": None, "host": "127.0.0.1"}
    with example.slurm_cluster("short", "02:00:00", scheduler_options=local) as cluster:
        script = cluster.job_script()
    for line in ("#SBATCH -p short", "#SBATCH -t 02:00:00", "#SBATCH --cpus-per-task=8"):
        assert line in script
    assert re.search(r"--nthreads 1 .*--nworkers 8 ", script)


def test_the_snakefile_runs_commands_that_are_there() -> None:
    text = (ROOT / "examples" / "Snakefile").read_text(encoding="utf-8")
    assert set(re.findall(r"lasso-motion (\w+)", text)) == {"track", "evaluate"} <= {one.name for one in COMMANDS}
