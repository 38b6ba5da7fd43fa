"""What tracking an archive does with each recording."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from lasso_motion_ros.config.parameters import configuration_values
from lasso_motion_ros.config.stream import StreamConfig
from lasso_motion_ros.tools.archive_rows import Figure
from lasso_motion_ros.tools.offline_tracking import counts, track_recording
from lasso_motion_ros.tracking.tracker import TrackerState

ANSWERS = (TrackerState.TRACKING, TrackerState.DEGRADED, TrackerState.LOST, TrackerState.DISPLACED)


@dataclass(frozen=True)
class TrackingWork:
    """Tracks one recording; the arguments are those of `track_recording`."""

    recording: Path
    config: StreamConfig
    seeds: Path | None = None
    calibration: Path | None = None
    remap: Mapping[str, str] = field(default_factory=dict)
    automatic: bool = False

    @property
    def inputs(self) -> Sequence[Path]:
        """As `Work.inputs`."""
        return [path for path in (self.recording, self.seeds, self.calibration) if path is not None]

    @property
    def settings(self) -> Mapping[str, Any]:
        """As `Work.settings`."""
        return {
            "does": "track",
            "config": configuration_values(self.config),
            "given": [self.seeds is not None, self.calibration is not None],
            "remap": self.remap,
            "automatic": self.automatic,
        }

    def make(self, output: Path) -> tuple[Mapping[str, Figure], str]:
        """As `Work.make`."""
        summary = track_recording(
            self.recording,
            output,
            self.config,
            seeds=self.seeds,
            calibration=self.calibration,
            remap=self.remap,
            automatic=self.automatic,
        )
        told = counts(summary)
        figures: dict[str, Figure] = {name: told[name] for name in ("pairs", "half_pairs", "poses")}
        figures |= {state.value: told["states"].get(state.value, 0) for state in ANSWERS}
        figures["problems"] = sum(one["count"] for one in told["problems"])
        return figures, summary.damage or ""
