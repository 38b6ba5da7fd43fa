"""What `import` and `render` do with each recording of an archive."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

from lasso_motion_ros.config.overlay import OverlayConfig
from lasso_motion_ros.config.parameters import configuration_values
from lasso_motion_ros.core.errors import RecordingError
from lasso_motion_ros.geometry.frames import PLANES
from lasso_motion_ros.reports.offline_overlay import OverlayView
from lasso_motion_ros.tools.archive_rows import Figure
from lasso_motion_ros.tools.dicom_import import ImportOptions, import_dicom
from lasso_motion_ros.tools.rendering import render_recording
from msg_adapters.dicom.pair_search import FoundPair


@dataclass(frozen=True)
class ImportWork:
    """Brings one pair of XA objects into a recording; the arguments are those of `import_dicom`."""

    pair: FoundPair
    options: ImportOptions

    @property
    def inputs(self) -> Sequence[Path]:
        """As `Work.inputs`."""
        return [*self.pair.paths, *([self.options.geometry] if self.options.geometry is not None else [])]

    @property
    def settings(self) -> Mapping[str, Any]:
        """As `Work.settings`."""
        return {"does": "import", **asdict(self.options), "geometry": self.options.geometry is not None}

    def make(self, output: Path) -> tuple[Mapping[str, Figure], str]:
        """As `Work.make`."""
        if self.pair.problem:
            raise RecordingError(self.pair.problem)
        imported = import_dicom(dict(zip(PLANES, self.pair.paths, strict=True)), output, self.options)
        frames = {f"frames_{plane}": len(stamps) for plane, stamps in imported.stamps_ns.items()}
        remarks = "; ".join(line for lines in imported.remarks.values() for line in lines)
        return {"pairs": min(frames.values()), **frames, "remarks": remarks}, ""


@dataclass(frozen=True)
class RenderWork:
    """Draws the overlay over one recording into a video; the arguments are those of `render_recording`."""

    recording: Path
    result: Path
    config: OverlayConfig
    view: OverlayView = "compensated"
    rate_hz: float | None = None
    remap: Mapping[str, str] = field(default_factory=dict)

    @property
    def inputs(self) -> Sequence[Path]:
        """As `Work.inputs`."""
        registration = Path(self.config.registration)
        files = [Path(self.config.volume_file), *([registration] if _is_file(registration) else [])]
        return [self.recording, self.result, *files]

    @property
    def settings(self) -> Mapping[str, Any]:
        """As `Work.settings`."""
        return {
            "does": "render",
            "config": configuration_values(self.config),
            "view": self.view,
            "rate_hz": self.rate_hz,
            "remap": self.remap,
        }

    def make(self, output: Path) -> tuple[Mapping[str, Figure], str]:
        """As `Work.make`."""
        summary = render_recording(
            self.recording,
            self.result,
            output,
            self.config,
            lambda line: None,
            view=self.view,
            rate_hz=self.rate_hz,
            remap=self.remap,
        )
        figures: dict[str, Figure] = {"pairs": len(summary.pairs), "compensated": summary.compensated}
        return {**figures, "problems": len(summary.problems)}, summary.damage or ""


def _is_file(path: Path) -> bool:
    try:
        return path.is_file()
    except OSError:  # numbers, too long for a name
        return False
