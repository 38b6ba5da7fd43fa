"""Rendered sequences on disk, so that a second run with another tracker need not render them again."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from functools import cache
from pathlib import Path
from typing import Any
from zipfile import BadZipFile

import numpy as np

from lasso_motion_ros.bench.suite import place_truth
from lasso_motion_ros.bench.suite.sequence import RenderedSequence, render_sequence
from lasso_motion_ros.core.errors import RecordingError
from lasso_motion_ros.core.output_files import make_directory
from lasso_motion_ros.evaluation.measures import PairTruth, Truth
from lasso_motion_ros.geometry.frames import PLANES, Frame, FramePair, Seed
from lasso_motion_ros.geometry.projection import Projection
from lasso_motion_ros.phantom import Scenario


class SequenceCache:
    """Renders sequences, each once; keeps them in a directory, some 15 MB each, if there is one.

    A file is named by its scenario and the simulator's own code, so that a change of either renders anew. It is
    written under another name first: what an interrupted run leaves behind is whole.

    Args:
        directory: where; made if need be. None keeps nothing.
    """

    def __init__(self, directory: Path | None) -> None:
        self._directory = directory
        if directory is not None:
            make_directory(directory)

    def sequence(self, scenario: Scenario) -> RenderedSequence:
        """The rendered scenario.

        Raises:
            RecordingError: the directory cannot be written.
        """
        if self._directory is None:
            # By way of the arrays, too: a matrix that is read is normalised once more, which may change its last bit.
            return _sequence(scenario, _arrays(render_sequence(scenario)))
        key = hashlib.sha256(repr(scenario).encode() + _simulator_code()).hexdigest()[:24]
        path = self._directory / f"{key}.npz"
        if not path.is_file():
            partial = self._directory / f"{key}.partial.npz"
            try:
                np.savez(partial, allow_pickle=False, **_arrays(render_sequence(scenario)))
                partial.replace(path)
            except OSError as error:
                raise RecordingError(f"{path}: cannot be written: {error.strerror}") from error
        # What was just rendered is read back as well: every run sees the same, to the last bit.
        try:
            with np.load(path, allow_pickle=False) as stored:
                return _sequence(scenario, stored)
        except (OSError, ValueError, KeyError, BadZipFile) as error:
            raise RecordingError(f"{path}: not a rendered sequence; delete it: {error}") from error


@cache
def _simulator_code() -> bytes:
    """A digest of all modules that decide what a rendered sequence looks like, and what its truth says."""
    package = Path(__file__).parents[2]
    digest = hashlib.sha256(Path(place_truth.__file__).read_bytes())
    for room in ("geometry", "phantom"):
        for module in sorted((package / room).glob("*.py")):
            digest.update(module.read_bytes())
    return digest.digest()


def _arrays(sequence: RenderedSequence) -> dict[str, Any]:
    truth = sequence.truth
    arrays: dict[str, Any] = {f"clicks_{plane}": sequence.seed.points(plane) for plane in PLANES}
    arrays["loop"], arrays["targets"] = truth.loop, truth.targets
    arrays["stamps_ns"] = np.array([pair.stamp_ns for pair in sequence.pairs], dtype=np.int64)
    for field in ("motion", "respiratory"):
        arrays[field] = np.stack([getattr(pair, field) for pair in truth.pairs])
    for index, (pair, true) in enumerate(zip(sequence.pairs, truth.pairs, strict=True)):
        for plane in PLANES:
            name = f"{plane}{index}"
            if (frame := pair.frame(plane)) is not None:
                arrays[f"pixels_{name}"] = frame.pixels
                arrays[f"matrix_{name}"] = frame.projection.matrix
                arrays[f"stamp_{name}"] = np.int64(frame.stamp_ns)
            if plane in true.centrelines:
                arrays[f"line_{name}"] = true.centrelines[plane]
            if plane in true.evidence:
                arrays[f"evidence_{name}"] = np.float64(true.evidence[plane])
        for flag in ("displaced", "due"):
            if (known := getattr(true, flag)) is not None:
                arrays[f"{flag}_{index}"] = np.bool_(known)
    return arrays


def _sequence(scenario: Scenario, stored: Mapping[str, Any]) -> RenderedSequence:
    pairs, truths = [], []
    motions, breaths = stored["motion"], stored["respiratory"]
    for index, stamp_ns in enumerate(stored["stamps_ns"].tolist()):
        frames: dict[str, Frame] = {}
        for plane in PLANES:
            if (name := f"pixels_{plane}{index}") in stored:
                pixels = stored[name]
                projection = Projection(stored[f"matrix_{plane}{index}"], pixels.shape[1], pixels.shape[0])
                frames[plane] = Frame(int(stored[f"stamp_{plane}{index}"]), pixels, projection)
        pairs.append(FramePair(stamp_ns, frames.get("a"), frames.get("b")))
        lines = {plane: stored[name] for plane in PLANES if (name := f"line_{plane}{index}") in stored}
        published = {plane: frame.projection for plane, frame in pairs[-1].frames.items()}
        evidence = {plane: float(stored[name]) for plane in PLANES if (name := f"evidence_{plane}{index}") in stored}
        displaced, due = (
            bool(stored[name]) if (name := f"{flag}_{index}") in stored else None for flag in ("displaced", "due")
        )
        truths.append(PairTruth(stamp_ns, motions[index], breaths[index], lines, published, displaced, due, evidence))
    truth = Truth(tuple(truths), stored["loop"], stored["targets"])
    return RenderedSequence(scenario, tuple(pairs), Seed(stored["clicks_a"], stored["clicks_b"]), truth)
