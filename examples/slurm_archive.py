"""Tracks an archive by a Slurm cluster: dask-jobqueue submits workers as jobs, `lasso-motion` hands out the recordings.

    pip install 'lasso_motion_ros[cluster]'
    python examples/slurm_archive.py /data/clinic results --jobs 25 --queue short

Run it on a login node, or as a job of its own; it ends when all is done. Recordings, results and the Python environment
must lie where all nodes see them, under the same paths. dask-jobqueue has the same for PBS, SGE, LSF and HTCondor.
"""

from __future__ import annotations

import argparse
import sys
from typing import Any

from dask_jobqueue import SLURMCluster

from lasso_motion_ros.cli.main import main as lasso_motion

WORKERS_A_JOB = 8
MEMORY_A_JOB = "8GB"  # a worker takes 0.2 GB for pairs of 1024 × 1024; Dask ends one that comes near its share


def slurm_cluster(queue: str, walltime: str, **settings: Any) -> SLURMCluster:
    """A cluster without workers; each job has as many processes as cores, of one thread each.

    Args:
        queue: the partition.
        walltime: after which a job ends, `HH:MM:SS`: what it was at is done again by another.
        settings: further ones of `SLURMCluster`.
    """
    return SLURMCluster(
        queue=queue,
        walltime=walltime,
        cores=WORKERS_A_JOB,
        processes=WORKERS_A_JOB,
        memory=MEMORY_A_JOB,
        python=sys.executable,
        # A worker that gives its work back before the job is ended costs no recording a second attempt.
        worker_extra_args=["--lifetime", "115m", "--lifetime-stagger", "4m"],
        **settings,
    )


def main() -> int:
    """Track a folder; returns the command's exit status."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("recordings", help="folder or quoted pattern")
    parser.add_argument("results", help="folder")
    parser.add_argument("--jobs", type=int, default=4, help=f"at most, of {WORKERS_A_JOB} workers each")
    parser.add_argument("--queue", default="short", help="the Slurm partition")
    options = parser.parse_args()
    with slurm_cluster(options.queue, "02:00:00") as cluster:
        cluster.adapt(minimum_jobs=1, maximum_jobs=options.jobs)
        return lasso_motion(
            ["track", options.recordings, "-o", options.results, "--scheduler", cluster.scheduler_address]
        )


if __name__ == "__main__":
    sys.exit(main())
