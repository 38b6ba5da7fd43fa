"""What a tracker answered on a benchmark: its files, and each answer's sequence by the answer's stamp alone."""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import numpy.typing as npt

from lasso_motion_ros.bench.benchmark.manifest import Manifest
from lasso_motion_ros.core.errors import MessageError, RecordingError
from lasso_motion_ros.evaluation.measures import PairEstimate
from lasso_motion_ros.evaluation.recorded_input import read_estimates, read_latencies_ms
from lasso_motion_ros.evaluation.same_pair import is_same_pair
from lasso_motion_ros.tracking.tracker import TrackerState
from msg_adapters.messages import stamp_to_ns
from msg_adapters.pose_table import read_pose_table
from msg_adapters.poses import decode_covariance, decode_pose
from msg_adapters.recordings.reader import RecordingReader
from msg_adapters.topics import MOTION, MOTION_RAW, MOTION_WITH_COVARIANCE

STATES = tuple(state.value for state in TrackerState)
STATES_WITH_POSE = (TrackerState.TRACKING.value, TrackerState.DEGRADED.value)


@dataclass(frozen=True, eq=False)
class Answer:
    """What a tracker said of one pair.

    Attributes:
        where: file and line or stamp, for errors.
        estimate: pose, covariance and state.
    """

    where: str
    estimate: PairEstimate


@dataclass(frozen=True, eq=False)
class Entry:
    """What one tracker answered.

    Attributes:
        name: in the table.
        estimates: by sequence; one without a single answer is left out.
        latencies_ms: (N,) how long answers took; empty where the files do not tell.
        damage: what could not be read of its files.
    """

    name: str
    estimates: Mapping[str, Sequence[PairEstimate]]
    latencies_ms: npt.NDArray[np.float64]
    damage: tuple[str, ...]


def entry_files(given: Iterable[Path], manifest: Manifest) -> dict[str, list[Path]]:
    """The files of each tracker, by its name.

    A folder is one tracker's: its MCAP files, or where it has none, its CSV files. So are files of one folder that are
    named after sequences (`003.mcap`). Any other file is a tracker by itself.

    Args:
        given: files and folders.
        manifest: the benchmark's.

    Raises:
        RecordingError: a folder without results, something that is not there, or two trackers of one name.
    """
    sequences = {one.name for one in manifest.sequences}
    found: dict[str, list[Path]] = {}
    homes: dict[str, Path] = {}
    for path in given:
        if path.is_dir():
            home, files = path, sorted(path.glob("*.mcap")) or sorted(path.glob("*.csv"))
            if not files:
                raise RecordingError(f"{path}: no MCAP or CSV file in it: expected a tracker's results")
        elif path.is_file():
            home, files = (path.parent if path.stem in sequences else path), [path]
        else:
            raise RecordingError(f"{path}: there is no such file or folder")
        home = home.resolve()
        name = home.stem if home.is_file() else home.name
        if homes.setdefault(name, home) != home:
            raise RecordingError(
                f"{homes[name]} and {home} are both named {name}; results are told apart by these names"
            )
        found.setdefault(name, []).extend(file for file in files if file not in found.get(name, ()))
    return found


def read_entry(name: str, files: Sequence[Path], manifest: Manifest) -> Entry:
    """Read what a tracker answered.

    Args:
        name: of the tracker.
        files: its results.
        manifest: the benchmark's.

    Raises:
        RecordingError: a file that cannot be read, of another benchmark, with two answers for a pair, or with one for
            no pair; a pose in a state that has none.
        MessageError: a pose or a covariance that is none.
    """
    answers: list[Answer] = []
    latencies: list[float] = []
    damage: list[str] = []
    for file in files:
        if file.suffix == ".csv":
            of_file = _table_answers(file, manifest, latencies)
        else:
            of_file = _recorded_answers(file, latencies, damage)
        _check_benchmark(file, of_file, manifest)
        answers += of_file
    return Entry(name, _by_sequence(name, answers, manifest), np.array(latencies), tuple(damage))


def _table_answers(path: Path, manifest: Manifest, latencies: list[float]) -> list[Answer]:
    table = read_pose_table(path)
    if table.identity and table.identity != manifest.identity:
        raise RecordingError(f"{path}: poses of {table.identity}; this benchmark is {manifest.identity}")
    answers = []
    for row in table.rows:
        where = f"{path}: line {row.line}"
        _check_state(where, row.state, row.transform is not None)
        pose, covariance = row.transform, row.covariance
        answers.append(Answer(where, PairEstimate(row.stamp_ns, row.state, pose, pose, covariance)))
        latencies += [] if row.latency_ms is None else [row.latency_ms]
    return answers


def _recorded_answers(path: Path, latencies: list[float], damage: list[str]) -> list[Answer]:
    _check_recorded_poses(path, damage)
    answers = []
    for estimate in read_estimates(path):
        where = f"{path}: stamp {estimate.stamp_ns} ns"
        unknown = estimate.covariance is not None and not np.any(estimate.covariance)
        answers.append(Answer(where, replace(estimate, covariance=None) if unknown else estimate))
    latencies += read_latencies_ms(path).tolist()
    return answers


def _check_recorded_poses(path: Path, damage: list[str]) -> None:
    """Look at every pose of a recording: what is wrong with one is said with its topic and stamp."""
    reader = RecordingReader(path)
    names = {topic.recorded_name for topic in (MOTION_RAW, MOTION, MOTION_WITH_COVARIANCE)}
    if not names & set(reader.topics):
        raise RecordingError(f"{path}: no poses in it: expected {', '.join(sorted(names))}, or at least one of them")
    seen: set[tuple[str, int]] = set()
    for recorded in reader.messages(sorted(names)):
        stamp_ns = stamp_to_ns(recorded.message.header.stamp)
        where = f"{path}: {recorded.topic}: stamp {stamp_ns} ns"
        try:
            decode_pose(recorded.message)
            if recorded.topic == MOTION_WITH_COVARIANCE.recorded_name:
                decode_covariance(recorded.message)
        except MessageError as error:
            raise MessageError(f"{where}: {error}") from error
        if (recorded.topic, stamp_ns) in seen:
            raise RecordingError(f"{where}: two poses with this stamp: expected one a pair")
        seen.add((recorded.topic, stamp_ns))
    damage += [reader.damage] if reader.damage else []


def _check_state(where: str, state: str, has_pose: bool) -> None:
    if state and state not in STATES:
        raise RecordingError(f"{where}: state {state!r}: expected one of {', '.join(STATES)}, or none")
    if has_pose and state and state not in STATES_WITH_POSE:
        raise RecordingError(
            f"{where}: a pose in state {state}: a pose is given in {' and '.join(STATES_WITH_POSE)} only"
        )


def _check_benchmark(path: Path, answers: Sequence[Answer], manifest: Manifest) -> None:
    """Whether any answer of a file is this benchmark's."""
    places = _Places(manifest)
    if answers and not any(places.of(one.estimate.stamp_ns) for one in answers):
        raise RecordingError(
            f"{path}: none of its {len(answers)} stamps is that of a pair of {manifest.identity}: a result of another"
            " version or seed, or stamps that are not those of plane A's images"
        )


def _by_sequence(entry: str, answers: Iterable[Answer], manifest: Manifest) -> dict[str, list[PairEstimate]]:
    places = _Places(manifest)
    taken: dict[tuple[str, int], Answer] = {}
    found: dict[str, list[PairEstimate]] = {}
    for one in answers:
        place = places.of(one.estimate.stamp_ns)
        if place is None:
            raise RecordingError(f"{one.where}: no pair has this stamp{places.nearest(one.estimate.stamp_ns)}")
        sequence, pair = place
        if place in taken:
            raise RecordingError(
                f"{one.where}: pair {pair} of sequence {sequence} has an answer already: {taken[place].where}"
            )
        taken[place] = one
        found.setdefault(sequence, []).append(one.estimate)
    return {
        name: _on_one_reference(f"{entry}: sequence {name}", name, estimates, places)
        for name, estimates in found.items()
    }


def _on_one_reference(where: str, name: str, estimates: Sequence[PairEstimate], places: _Places) -> list[PairEstimate]:
    """The estimates of a sequence with its one reference, which a live recording may have heard after the first pose.

    A tracker whose reference were no pair, or each pair anew, would never be off.
    """
    told = {one.reference_ns for one in estimates if one.reference_ns is not None}
    of_sequence = {stamp: place for stamp in told if (place := places.of(stamp)) is not None and place[0] == name}
    if told and not of_sequence:
        raise RecordingError(f"{where}: its reference, {min(told)} ns, is the stamp of none of its pairs")
    if len(set(of_sequence.values())) > 1:
        raise RecordingError(f"{where}: the reference changes, to {max(of_sequence)} ns: expected one")
    return [replace(one, reference_ns=min(of_sequence, default=None)) for one in estimates]


class _Places:
    """Which sequence and pair a stamp belongs to."""

    def __init__(self, manifest: Manifest) -> None:
        known = sorted(
            (stamp, one.name, pair) for one in manifest.sequences for pair, stamp in enumerate(one.stamps_ns)
        )
        self._stamps = [stamp for stamp, _, _ in known]
        self._places = [(name, pair) for _, name, pair in known]

    def of(self, stamp_ns: int) -> tuple[str, int] | None:
        """Sequence and number of the pair, or None."""
        at = self._nearest(stamp_ns)
        return self._places[at] if is_same_pair(self._stamps[at], stamp_ns) else None

    def nearest(self, stamp_ns: int) -> str:
        """Which pair is nearest, in words."""
        at = self._nearest(stamp_ns)
        sequence, pair = self._places[at]
        return (
            f": pair {pair} of sequence {sequence} is nearest, {1e-6 * (stamp_ns - self._stamps[at]):+.0f} ms from it"
        )

    def _nearest(self, stamp_ns: int) -> int:
        after = bisect_left(self._stamps, stamp_ns)
        beside = [at for at in (after - 1, after) if 0 <= at < len(self._stamps)]
        return min(beside, key=lambda at: abs(self._stamps[at] - stamp_ns))
