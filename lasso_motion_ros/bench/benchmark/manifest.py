"""What a benchmark consists of: its version, its sequences, and the digest of each of its files."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from lasso_motion_ros.core.errors import RecordingError

NAME = "biplane-lasso"
VERSION = "1"
"""Raised when simulator, event classes or counting change: figures of two versions do not compare."""
LICENCE = "CC0-1.0"
MANIFEST_FILE, CARD_FILE, LICENCE_FILE = "manifest.json", "README.md", "LICENSE.txt"
RECORDINGS, TRUTH = "recordings", "truth"
OWNED = (MANIFEST_FILE, CARD_FILE, LICENCE_FILE, RECORDINGS, TRUTH)
"""Names in a benchmark's directory."""

_EPOCH_S = 1_760_000_000
_SPAN_S = 3650 * 86400  # ROS stamps end in 2038
_SEQUENCE_S = 120  # longer than any sequence


@dataclass(frozen=True)
class BenchmarkSequence:
    """One sequence of a benchmark.

    Attributes:
        name: of its files, `003`.
        description: its event classes in words, its frame rate, its dose.
        since: first pair from which on each of its event classes holds, by name.
        rate_hz: pairs a second.
        stamps_ns: of its pairs; the clicks are on the first, which is the reference.
        files: SHA-256 of each of its files, by the path below the benchmark's directory.
    """

    name: str
    description: str
    since: Mapping[str, int]
    rate_hz: float
    stamps_ns: tuple[int, ...]
    files: Mapping[str, str]


@dataclass(frozen=True)
class Manifest:
    """What a benchmark consists of.

    Attributes:
        version: of the benchmark.
        seed: from which its sequences were drawn.
        sequences: in order.
        files: SHA-256 of the files that belong to no sequence, by name.
        made_with: versions of what rendered it, by name.
    """

    version: str
    seed: int
    sequences: tuple[BenchmarkSequence, ...]
    files: Mapping[str, str]
    made_with: Mapping[str, str]

    @property
    def identity(self) -> str:
        """What a result says that it belongs to; the same however many sequences were exported."""
        return identity(self.version, self.seed)

    @property
    def pairs(self) -> int:
        """How many pairs it has."""
        return sum(len(one.stamps_ns) for one in self.sequences)

    def record(self) -> dict[str, Any]:
        """As JSON values."""
        head = {"benchmark": NAME, "identity": self.identity, "licence": LICENCE}
        return head | asdict(self)


def identity(version: str, seed: int) -> str:
    """The name of a version drawn from a seed."""
    return f"{NAME}/{version}/seed-{seed}"


def start_ns(version: str, seed: int, index: int) -> int:
    """Stamp of a sequence's first pair.

    No two sequences share a stamp, of whatever version or seed: a pose's stamp alone says to which pair it belongs, and
    a result of another benchmark is noticed.
    """
    digest = hashlib.sha256(identity(version, seed).encode()).digest()
    begin_s = _EPOCH_S + int.from_bytes(digest[:8], "big") % _SPAN_S
    return (begin_s + _SEQUENCE_S * index) * 1_000_000_000


def file_digest(path: Path) -> str:
    """SHA-256 of a file, as hexadecimal digits.

    Raises:
        RecordingError: it cannot be read.
    """
    try:
        with path.open("rb") as file:
            return hashlib.file_digest(file, "sha256").hexdigest()
    except OSError as error:
        raise RecordingError(f"{path} cannot be read: {error.strerror}") from error


def read_manifest(directory: Path) -> Manifest:
    """The manifest of an exported benchmark.

    Raises:
        RecordingError: there is none, it is damaged, or it is of a version that is counted in another way.
    """
    path = directory / MANIFEST_FILE
    if not path.is_file():
        raise RecordingError(f"{directory}: no {MANIFEST_FILE} in it: expected what `benchmark export` has written")
    try:
        found = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise RecordingError(f"{path}: not a benchmark's manifest: {error}") from error
    if not isinstance(found, dict) or found.get("benchmark") != NAME:
        raise RecordingError(f"{path}: not the manifest of a {NAME} benchmark")
    if found.get("version") != VERSION:
        raise RecordingError(
            f"{path}: version {found.get('version')!r} of the benchmark; this package scores version {VERSION!r}"
        )
    try:
        sequences = tuple(
            BenchmarkSequence(
                str(one["name"]),
                str(one["description"]),
                {str(name): int(first) for name, first in one["since"].items()},
                float(one["rate_hz"]),
                tuple(int(stamp) for stamp in one["stamps_ns"]),
                dict(one["files"]),
            )
            for one in found["sequences"]
        )
        if not sequences or not all(one.stamps_ns for one in sequences):
            raise ValueError("a sequence without pairs, or none at all")
        return Manifest(VERSION, int(found["seed"]), sequences, dict(found["files"]), dict(found["made_with"]))
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        raise RecordingError(f"{path}: damaged: {type(error).__name__}: {error}") from error
