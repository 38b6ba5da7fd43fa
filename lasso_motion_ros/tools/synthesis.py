"""Writes what the simulator renders into a recording, with seeds and exact truth."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable, Sequence
from pathlib import Path

from lasso_motion_ros.core.errors import ScenarioError
from lasso_motion_ros.core.progress import progress
from lasso_motion_ros.geometry.frames import PLANES
from lasso_motion_ros.phantom import Scenario, SimulatedPair, Simulator, available_scenarios, load_scenario
from lasso_motion_ros.tools.sequence_messages import (
    image_messages,
    r_peak_messages,
    reference_truth_messages,
    seed_messages,
    truth_messages,
    write_messages,
)
from msg_adapters.recordings.writer import RecordingWriter


def synthesise(
    output: Path,
    scenario: str,
    *,
    seed: int | None = None,
    pairs: int | None = None,
    volume: str | None = None,
    volume_centre_mm: Sequence[float] | None = None,
    overwrite: bool = False,
    quiet: bool = True,
) -> Scenario:
    """Render a scenario into a recording.

    Args:
        output: MCAP file to write.
        scenario: the name of a bundled scenario, or a YAML file.
        seed: instead of the scenario's.
        pairs: instead of the scenario's; events after the new end are left out.
        volume: CT volume as the patient's body.
        volume_centre_mm: (3,) the left atrium in it, LPS coordinates; None: its middle.
        overwrite: replace `output` if it exists.
        quiet: no progress bar.

    Returns:
        The scenario as rendered.

    Raises:
        LassoMotionError: a scenario or a volume that cannot be read, or an output that cannot be written.
    """
    rendered = adapted(load_scenario(scenario), seed=seed, pairs=pairs)
    body = None
    if volume is not None:
        from lasso_motion_ros.phantom.volume import volume_bodies

        body = volume_bodies(volume, volume_centre_mm)
    simulator = Simulator(rendered, body)
    shown = progress(simulator.pairs(), rendered.pairs, "rendering", quiet)
    write_recording(output, simulator, shown, overwrite=overwrite)
    return rendered


def list_scenarios() -> list[str]:
    """The bundled scenarios, a line each, and how many they are."""
    known = available_scenarios()
    width = max((len(name) for name in known), default=0)
    lines, total = [], 0
    for name, path in known.items():
        scenario = load_scenario(path)
        total += scenario.pairs
        size = f"{scenario.geometry.size_px}² {'mono8' if scenario.imaging.bits == 8 else 'mono16'}"
        lines.append(
            f"{name:{width}}  {scenario.pairs:3d} pairs at {scenario.rate_hz:g}/s  {size:12}  {scenario.description}"
        )
    return [*lines, f"{len(known)} scenarios, {total} pairs"]


def adapted(scenario: Scenario, *, seed: int | None = None, pairs: int | None = None) -> Scenario:
    """A scenario with another seed or length; events after the new end are left out.

    Raises:
        ScenarioError: a seed or a number of pairs that is not allowed.
    """
    if seed is not None:
        if not 0 <= seed < 2**31:
            raise ScenarioError(f"seed: expected 0 to {2**31 - 1}, found {seed}")
        scenario = dataclasses.replace(scenario, seed=seed)
    if pairs is not None:
        if pairs < 1:
            raise ScenarioError(f"frames: expected at least 1, found {pairs}")
        kept = tuple(event for event in scenario.events if event.first < pairs)
        scenario = dataclasses.replace(scenario, pairs=pairs, events=kept)
    return scenario


def write_recording(path: Path, simulator: Simulator, pairs: Iterable[SimulatedPair], *, overwrite: bool) -> None:
    """Write what the simulator yields, messages in the order of their stamps.

    Args:
        path: MCAP file to write.
        simulator: for seeds, reference loop, targets and R peaks.
        pairs: `simulator.pairs()`, or that with a progress bar around it.
        overwrite: whether an existing file is replaced.

    Raises:
        RecordingError: the file exists, or cannot be written.
    """
    peaks = simulator.r_peaks_ns()
    start_ns = {plane: simulator.stamp_ns(0, plane) for plane in PLANES}
    # B of one pair is exposed before A of the next: messages leave pair by pair, sorted within.
    with RecordingWriter(path, compression="zstd", overwrite=overwrite, whole=True) as writer:
        for pair in pairs:
            stamp_ns = pair.images.stamp_ns
            messages = image_messages(pair.images)
            messages += truth_messages(stamp_ns, pair.motion, pair.respiratory, pair.centrelines)
            if pair.index == 0:
                messages += seed_messages(simulator.seeds(), start_ns)
                messages += reference_truth_messages(start_ns["a"], simulator.reference_loop, simulator.targets)
            before = [peak for peak in peaks if peak <= stamp_ns]
            peaks = peaks[len(before) :]
            write_messages(writer, messages + r_peak_messages(before))
