"""One recording of an archive, as a worker does it: a job in, a result file (whole or not there) and one row out."""

from __future__ import annotations

import hashlib
import json
import os
import re
import resource
import shutil
import socket
import time
from collections.abc import Collection, Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any, Protocol

import lasso_motion_ros
import msg_adapters
from lasso_motion_ros.core.errors import ConfigurationError, LassoMotionError, RecordingError
from lasso_motion_ros.core.output_files import cannot_write, make_directory
from lasso_motion_ros.core.share import version
from lasso_motion_ros.tools.archive_rows import DONE, FAILED, ArchiveRow, Figure, read_row, row_file, write_row

_STAGED = re.compile(r"\.(?P<result>.+)@(?P<host>[^@]*)@(?P<pid>\d+)\.unfinished")


class Work(Protocol):
    """What is done with one recording: small, and the same on every machine."""

    @property
    def inputs(self) -> Sequence[Path]:
        """The recordings and files that are read, absolute; the first are what the row is called by."""
        ...

    @property
    def settings(self) -> Mapping[str, Any]:
        """All else that decides the result, as JSON values."""
        ...

    def make(self, output: Path) -> tuple[Mapping[str, Figure], str]:
        """Write the result; returns the row's figures, and what is to be known (a recording that is cut short)."""
        ...


@dataclass(frozen=True)
class ArchiveJob:
    """One recording.

    Attributes:
        work: what is done.
        recording: what the row calls it.
        folder: of all results, absolute.
        result: the result in it, relative.
        version: `code_version` of whoever asks: a worker with another one does nothing.
        overwrite: whether a result that is there, made of another input or otherwise, is replaced.
    """

    work: Work
    recording: str
    folder: Path
    result: str
    version: str
    overwrite: bool

    @property
    def place(self) -> Path:
        """The result's file."""
        return self.folder / self.result


@dataclass(frozen=True)
class Finished:
    """What a worker answers.

    Attributes:
        row: the recording's.
        before: whether it had been done before, and was left as it is.
    """

    row: ArchiveRow
    before: bool = False


def run_job(job: ArchiveJob) -> Finished:
    """Do one recording, unless it is done already. Whatever goes wrong with it is its row."""
    begun = _Clock()
    try:
        if job.version != code_version():
            raise ConfigurationError(f"this worker has lasso_motion_ros {code_version()}, asked for was {job.version}")
        key = job_key(job.work)
        earlier = read_row(row_file(job.folder, job.result))
        ours = earlier is not None and _digest(job.place) == earlier.digest != ""
        if earlier is not None and ours and earlier.key == key:
            return Finished(earlier, before=True)
        if job.place.exists() and not job.overwrite:
            what = "made of another input, configuration or version" if ours else "not made by such a run"
            return Finished(_failed(job, f"{job.place} exists, {what}: choose another folder or add --overwrite"))
        with_row = _made(job, key, begun)
    except Exception as error:
        row = _failed(job, _reason(error), begun)
        with suppress(LassoMotionError):
            write_row(row_file(job.folder, job.result), row)
        return Finished(row)
    return Finished(with_row)


def lost_job(job: ArchiveJob, reason: str) -> Finished:
    """The row of a recording whose process was lost."""
    row = _failed(job, reason)
    write_row(row_file(job.folder, job.result), row)
    return Finished(row)


def clear_abandoned(folder: Path, answered: Collection[str]) -> None:
    """Remove what is left half done in a folder of results, and nobody is at.

    Args:
        folder: of all results.
        answered: the results that have been answered for, done or not. Of others only what processes of this machine
            have left that are no more.
    """
    for staged in folder.rglob(".*.unfinished"):
        if (found := _STAGED.fullmatch(staged.name)) is None:
            continue
        result = str((staged.parent / found["result"]).relative_to(folder))
        gone = found["host"] == socket.gethostname() and not Path(f"/proc/{found['pid']}").exists()
        if result in answered or gone:
            shutil.rmtree(staged, ignore_errors=True)


@cache
def code_version() -> str:
    """The package's version, with a digest of its code: a checkout changes while its version stays."""
    digest = hashlib.sha256()
    for package in (lasso_motion_ros, msg_adapters):
        root = Path(str(package.__file__)).parent
        for module in sorted(root.rglob("*.py")):
            digest.update(str(module.relative_to(root)).encode() + module.read_bytes())
    return f"{version()}+{digest.hexdigest()[:12]}"


def job_key(work: Work) -> str:
    """Hash of inputs, settings and version: two jobs of one key have one result.

    Raises:
        LassoMotionError: an input that cannot be read.
    """
    contents = [[_needed_digest(file) for file in _files(path)] for path in work.inputs]
    known = [code_version(), work.settings, contents]
    key = _blake2b()
    key.update(json.dumps(known, sort_keys=True).encode())
    return key.hexdigest()


def _made(job: ArchiveJob, key: str, begun: _Clock) -> ArchiveRow:
    """Make the result; the row is written first, and holds only together with a result of its digest."""
    # The result's own name stays: it stands in a recording's metadata.
    staged = job.place.with_name(f".{job.place.name}@{socket.gethostname()}@{os.getpid()}.unfinished")
    make_directory(staged)
    try:
        figures, remark = job.work.make(staged / job.place.name)
        row = ArchiveRow(
            job.recording,
            job.result,
            DONE,
            remark,
            key=key,
            digest=_needed_digest(staged / job.place.name),
            figures=figures,
            **begun.spent(),
        )
        write_row(row_file(job.folder, job.result), row)
        try:
            (staged / job.place.name).replace(job.place)
        except OSError as error:
            raise cannot_write(job.place, error) from error
        return row
    finally:
        shutil.rmtree(staged, ignore_errors=True)


def _peak_memory_kb() -> int:
    """This program's own; what `getrusage` tells begins with that of the process that has started it."""
    with suppress(OSError):  # a system without /proc
        text = Path("/proc/self/status").read_text(encoding="ascii", errors="replace")
        if (found := re.search(r"^VmHWM:\s*(\d+) kB$", text, re.MULTILINE)) is not None:
            return int(found[1])
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss


def _failed(job: ArchiveJob, reason: str, begun: _Clock | None = None) -> ArchiveRow:
    return ArchiveRow(job.recording, job.result, FAILED, reason, **(begun.spent() if begun is not None else {}))


class _Clock:
    """What a recording takes, from now on."""

    def __init__(self) -> None:
        self._wall, self._processor = time.perf_counter(), time.process_time()

    def spent(self) -> dict[str, Any]:
        """The fields of `ArchiveRow` that tell it."""
        return {
            "seconds": round(time.perf_counter() - self._wall, 3),
            "processor_s": round(time.process_time() - self._processor, 3),
            "peak_memory_mb": round(_peak_memory_kb() / 1024, 1),
            "host": socket.gethostname(),
        }


def _reason(error: Exception) -> str:
    text = " ".join(str(error).split())
    return text if isinstance(error, LassoMotionError) else f"{type(error).__name__}: {text}"


def _files(path: Path) -> Iterable[Path]:
    """The files of an input: of a bag directory, or a folder with a DICOM series, all that are in it."""
    return sorted(file for file in path.iterdir() if file.is_file()) if path.is_dir() else [path]


def _needed_digest(path: Path) -> str:
    digest = _digest(path)
    if digest is None:
        raise RecordingError(f"{path} cannot be read")
    return digest


def _blake2b() -> hashlib.blake2b:
    """Where the processor does not help, it takes two thirds of SHA-256's time, which would be a tenth of a pair's."""
    return hashlib.blake2b(digest_size=32)


def _digest(path: Path) -> str | None:
    try:
        with path.open("rb") as file:
            return hashlib.file_digest(file, _blake2b).hexdigest()
    except OSError:
        return None
