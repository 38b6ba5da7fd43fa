"""One result on one recording, with all that a report shows."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

from lasso_motion_ros.evaluation.measures import PairEstimate, PairScore, Truth
from lasso_motion_ros.evaluation.same_pair import of_pair
from lasso_motion_ros.evaluation.summary import MEAN_ROW

Array = npt.NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Timing:
    """How long answers took.

    Attributes:
        what: which times these are, in words.
        milliseconds: (N,) one a pair.
    """

    what: str
    milliseconds: Array


@dataclass(frozen=True, eq=False)
class Evaluated:
    """One result on one recording.

    Attributes:
        recording: the recording's name.
        result: the result's name beside others of the same recording: that of a configuration or a file.
        path: the recording, for its images.
        truth: what is known of it.
        estimates: what was published.
        scores: the measures, pair by pair.
        timing: how long the answers took, or None if unknown.
        configuration: all parameters by full name, or None if unknown.
    """

    recording: str
    result: str
    path: Path
    truth: Truth
    estimates: Sequence[PairEstimate]
    scores: Sequence[PairScore]
    timing: Timing | None = None
    configuration: Mapping[str, bool | int | float | str] | None = None

    def estimate(self, stamp_ns: int) -> PairEstimate | None:
        """What was published for the pair with this stamp, or None."""
        return of_pair(self.estimates, stamp_ns)

    @property
    def times_s(self) -> Array:
        """(N,) time of each pair since the first, seconds."""
        return np.array([1e-9 * (score.stamp_ns - self.scores[0].stamp_ns) for score in self.scores])


def row_names(results: Sequence[Evaluated]) -> list[str]:
    """A name for each result's row: the recording's, with the result's where a recording has several."""
    several = {one.recording for one in results if len({r.result for r in results if r.recording == one.recording}) > 1}
    return [f"{one.recording} · {one.result}" if one.recording in several else one.recording for one in results]


def mean_groups(results: Sequence[Evaluated]) -> dict[str, list[str]]:
    """Rows over which a mean is taken, by the mean row's name: those of one configuration, of different recordings."""
    rows = list(zip(row_names(results), results, strict=True))
    groups: dict[str, list[str]] = {}
    several = len({one.result for one in results}) > 1 and len({one.recording for one in results}) < len(results)
    for name, one in rows:
        groups.setdefault(f"mean · {one.result} (counts: sum)" if several else MEAN_ROW, []).append(name)
    return {name: members for name, members in groups.items() if len(members) > 1}
