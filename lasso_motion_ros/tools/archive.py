"""Runs a command over an archive of recordings: workers, progress, the table; finished ones are left as they are."""

from __future__ import annotations

import time
from collections.abc import Callable, Generator, Iterable, Sequence
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path

from lasso_motion_ros.core.errors import RecordingError
from lasso_motion_ros.core.output_files import make_directory
from lasso_motion_ros.core.progress import Tally, tallying
from lasso_motion_ros.core.worker_pool import Lost, Pool
from lasso_motion_ros.tools.archive_job import (
    ArchiveJob,
    Finished,
    Work,
    clear_abandoned,
    code_version,
    lost_job,
    run_job,
)
from lasso_motion_ros.tools.archive_rows import DONE, TABLE, ArchiveRow, read_rows, write_table


@dataclass(frozen=True)
class ArchiveSummary:
    """The outcome.

    Attributes:
        rows: of the recordings that were named, in their order.
        before: how many of them had been done before.
        pairs: image pairs that were worked through now.
        seconds: wall time.
        table: the CSV file, with all rows of the folder.
    """

    rows: tuple[ArchiveRow, ...]
    before: int
    pairs: int
    seconds: float
    table: Path

    @property
    def failed(self) -> int:
        """How many failed."""
        return sum(row.status != DONE for row in self.rows)

    @property
    def complete(self) -> bool:
        """Whether all were done, and nothing is to be known of any."""
        return not any(row.status != DONE or row.reason for row in self.rows)

    def line(self, folder: Path) -> str:
        """One line for the user."""
        done = f"{len(self.rows) - self.failed} of {len(self.rows)} recordings done"
        done += f" ({self.before} of them before)" if self.before else ""
        done += f", {self.failed} failed" if self.failed else ""
        if self.pairs:
            done += f"; {self.pairs} pairs in {self.seconds:.0f} s, {self.pairs / self.seconds:.0f} pairs/s"
        return f"{folder}: {done}; {self.table}"


def run_archive(
    todo: Iterable[tuple[Work, str, str]],
    folder: Path,
    pool: Pool,
    say: Callable[[str], None],
    *,
    label: str,
    overwrite: bool = False,
    quiet: bool = True,
) -> ArchiveSummary:
    """Do something with every recording of an archive.

    Args:
        todo: the work on each, what its row calls it, and the result's path in the folder.
        folder: for the results; made if need be.
        pool: who does it.
        say: takes a line for the user: a recording that failed, or is damaged.
        label: what is being done, a word or two.
        overwrite: replace results of other inputs, configurations or versions, and files that are no such result.
        quiet: no progress.

    Raises:
        RecordingError: a result would replace an input, or the folder cannot be written.
    """
    folder = folder.absolute()
    jobs = [ArchiveJob(work, name, folder, result, code_version(), overwrite) for work, name, result in todo]
    _check_inputs(jobs)
    make_directory(folder)
    clear_abandoned(folder, ())
    rows: dict[int, ArchiveRow] = {}
    before = pairs = 0
    begun = time.monotonic()
    try:
        with tallying(label, len(jobs), quiet) as tally, closing(_answers(pool, jobs)) as answers:
            for number, finished in answers:
                row = rows[number] = finished.row
                before += finished.before
                new = 0 if finished.before else int(row.figures.get("pairs") or 0)
                pairs += new
                if row.reason:
                    say(named(row.recording, row.reason))
                tally(Tally(failed=row.status != DONE, pairs=new))
    finally:
        clear_abandoned(folder, {jobs[number].result for number in rows})
        there = {row.result: row for row in (*read_rows(folder), *rows.values())}
        if there:
            write_table(folder / TABLE, [there[result].cells() for result in sorted(there)])
    in_order = tuple(rows[number] for number in sorted(rows))
    return ArchiveSummary(in_order, before, pairs, time.monotonic() - begun, folder / TABLE)


def named(recording: str, reason: str) -> str:
    """A line on a recording that names it, once."""
    return reason if recording in reason else f"{recording}: {reason}"


def _answers(pool: Pool, jobs: Sequence[ArchiveJob]) -> Generator[tuple[int, Finished], None, None]:
    with closing(pool.run(run_job, jobs)) as answers:
        for number, answer in answers:
            yield number, lost_job(jobs[number], answer.reason) if isinstance(answer, Lost) else answer


def _check_inputs(jobs: Sequence[ArchiveJob]) -> None:
    """Check that no result would take the place of something that is read."""
    read = {path.resolve() for job in jobs for path in job.work.inputs}
    for job in jobs:
        place = job.place.resolve()
        if place in read or any(place.exists() and path.exists() and place.samefile(path) for path in job.work.inputs):
            raise RecordingError(f"{job.place} is an input, and no input is overwritten: choose another folder")
