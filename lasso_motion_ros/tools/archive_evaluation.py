"""What `track` made of an archive, scored: by workers, each result by itself; the table and the report over all."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import closing
from dataclasses import asdict, dataclass
from pathlib import Path

from lasso_motion_ros.core.errors import LassoMotionError, RecordingError
from lasso_motion_ros.core.progress import Tally, tallying
from lasso_motion_ros.core.worker_pool import Lost, Pool
from lasso_motion_ros.evaluation.evaluated import Evaluated
from lasso_motion_ros.evaluation.measures import PairScore, score_pairs
from lasso_motion_ros.evaluation.recorded_input import read_estimates, read_truth
from lasso_motion_ros.evaluation.summary import summarise
from lasso_motion_ros.tools.archive import named
from lasso_motion_ros.tools.archive_rows import DONE, FAILED, Figure, needed_rows, read_rows


@dataclass(frozen=True)
class ArchivedResult:
    """One result of an archive.

    Attributes:
        name: what its row is called: the result's path in its folder, without suffix.
        recording: path of what it was made of.
        result: its own path.
        failure: why there is none; empty where there is one.
        sid_m: source–detector distance for millimetres on the detector, metres.
    """

    name: str
    recording: Path
    result: Path
    failure: str
    sid_m: float


@dataclass(frozen=True, eq=False)
class ScoredResult:
    """What comes of it.

    Attributes:
        archived: the result.
        scores: pair by pair; empty where it could not be scored.
        failure: why not; empty where it could.
        damage: what is wrong with the recording as a file, or empty.
    """

    archived: ArchivedResult
    scores: tuple[PairScore, ...] = ()
    failure: str = ""
    damage: str = ""

    def cells(self) -> dict[str, Figure]:
        """Its row of the summary table: the measures are those of `Summary`."""
        known: dict[str, Figure] = {
            "name": self.archived.name,
            "recording": str(self.archived.recording),
            "result": str(self.archived.result),
            "status": FAILED if self.failure else DONE,
            "reason": self.failure or self.damage,
        }
        return known | (asdict(summarise(self.scores)) if self.scores else {})

    def evaluated(self) -> Evaluated:
        """The same for the report, for which truth and result are read again.

        Raises:
            LassoMotionError: either cannot be read.
        """
        one = self.archived
        truth = read_truth(one.recording).truth
        return Evaluated(one.name, one.result.stem, one.recording, truth, read_estimates(one.result), self.scores)


def is_result_folder(path: Path) -> bool:
    """Whether a path is a folder that `track` has filled with an archive's results."""
    return path.is_dir() and bool(read_rows(path))


def archived_results(folders: Sequence[Path], sid_m: float) -> list[ArchivedResult]:
    """All results of folders, by name; those of several folders are told apart by the folder.

    Raises:
        RecordingError: a folder without results.
    """
    several = len(folders) > 1
    return [
        ArchivedResult(
            str((folder / row.result if several else Path(row.result)).with_suffix("")),
            Path(row.recording),
            (folder / row.result).absolute(),
            "" if row.status == DONE else row.reason,
            sid_m,
        )
        for folder in folders
        for row in needed_rows(folder)
    ]


def score_archive(
    results: Sequence[ArchivedResult], pool: Pool, say: Callable[[str], None], *, quiet: bool = True
) -> list[ScoredResult]:
    """Score results against the truth in their recordings; one that cannot be scored is said, and has no scores.

    Args:
        results: which.
        pool: who does it.
        say: takes a line for the user.
        quiet: no progress.

    Raises:
        RecordingError: none can be scored.
    """
    scored: dict[int, ScoredResult] = {}
    with tallying("evaluating", len(results), quiet) as tally, closing(pool.run(score_result, results)) as answers:
        for number, answer in answers:
            one = ScoredResult(results[number], failure=answer.reason) if isinstance(answer, Lost) else answer
            if one.failure or one.damage:
                say(named(str(one.archived.recording), one.failure or one.damage))
            scored[number] = one
            tally(Tally(pairs=len(one.scores), failed=bool(one.failure)))
    if all(one.failure for one in scored.values()):
        raise RecordingError("none of the archive's results could be scored")
    return [scored[number] for number in sorted(scored)]


def score_result(one: ArchivedResult) -> ScoredResult:
    """Score one result; what cannot be is said in its answer."""
    if one.failure:
        return ScoredResult(one, failure=one.failure)
    try:
        read = read_truth(one.recording)
        scores = score_pairs(read.truth, read_estimates(one.result), source_detector_m=one.sid_m)
    except LassoMotionError as error:
        return ScoredResult(one, failure=str(error))
    return ScoredResult(one, tuple(scores), damage=read.damage or "")
