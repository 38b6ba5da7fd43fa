"""Parameters of the overlay node."""

from __future__ import annotations

from dataclasses import dataclass

from lasso_motion_ros.config.parameters import group, parameter
from lasso_motion_ros.config.stream import PlaneConfig, SyncConfig


@dataclass(frozen=True)
class OverlayStyleConfig:
    """How the overlay looks; all of it can be changed while the node runs."""

    drawing: str = parameter(
        "both", "what is drawn of the surface", choices=("outline", "fill", "both"), read_only=False
    )
    fill_opacity: float = parameter(0.30, "opacity of the fill at its rim", minimum=0.0, maximum=1.0, read_only=False)
    outline_width_px: float = parameter(
        2.0, "width of the outline, at a 1024-pixel image", unit="px", minimum=1.0, maximum=10.0, read_only=False
    )
    error_band: bool = parameter(
        True,
        "of a surface: a band about the compensated outline, in which each of its points lies with 95 % probability by"
        " the motion's covariance, as far as the tracker gives one (brost2009 does not)",
        read_only=False,
    )
    show_static: bool = parameter(True, "also draw the uncompensated place, faintly", read_only=False)
    compensated_colour: str = parameter("#4be08a", "colour of the compensated overlay, #rrggbb", read_only=False)
    static_colour: str = parameter("#8fb4d8", "colour of the uncompensated one beside it, #rrggbb", read_only=False)
    warning_colour: str = parameter("#ffb000", "colour where nothing is compensated, #rrggbb", read_only=False)
    projection_depth_mm: float = parameter(
        30.0,
        "thickness that is drawn with fill_opacity where a volume is shown as a projection",
        unit="mm",
        minimum=1.0,
        maximum=500.0,
        read_only=False,
    )


@dataclass(frozen=True)
class VolumeConfig:
    """What is shown of a medical volume."""

    display: str = parameter(
        "surface",
        "surface, or projection: a translucent projection of all that lies inside",
        choices=("surface", "projection"),
    )
    level: float = parameter(0.5, "value at which the surface lies; the default suits masks (0 and 1)")
    label: int = parameter(0, "show the surface of the voxels with this value instead; 0: use level", minimum=0)
    triangles: int = parameter(
        20_000, "a surface of more triangles is simplified to this many", minimum=1_000, maximum=500_000
    )


@dataclass(frozen=True)
class OverlayConfig:
    """All parameters of the overlay node."""

    volume_file: str = parameter(
        "",
        "what is drawn: a surface (STL, PLY, OBJ, VTK, VTP) or a volume (NIfTI, NRRD, MHA, a folder with a DICOM"
        " series)",
    )
    registration: str = parameter(
        "0 0 0 0 0 0 1",
        "transform from volume (LPS) to world at the reference pair, metres: x y z and a quaternion x y z w, or the 16"
        " numbers of a 4x4 matrix, row by row; or a text file that holds either",
    )
    units: str = parameter(
        "",
        "unit of the file's coordinates; required for a surface, mm by default for a volume",
        choices=("", "mm", "m"),
    )
    axes: str = parameter(
        "",
        "axes of a surface file: LPS (+x left, +y posterior, +z cranial) or RAS; by default as the file states"
        " (SPACE=RAS), else LPS",
        choices=("", "lps", "ras"),
    )
    volume: VolumeConfig = group(VolumeConfig)
    motion_wait_s: float = parameter(
        0.05, "longest time for which an image waits for its pair's motion", unit="s", minimum=0.0, maximum=5.0
    )
    motion_timeout_s: float = parameter(
        1.0, "a motion older than this is no longer applied", unit="s", minimum=0.0, maximum=60.0
    )
    world_frame: str = parameter(
        "patient_table", "frame fixed to the table top, in which motion and registration are given"
    )
    niceness: int = parameter(
        5,
        "niceness of the thread that draws, so that a tracker on the same machine goes first",
        minimum=0,
        maximum=19,
    )
    plane_a: PlaneConfig = group(PlaneConfig)
    plane_b: PlaneConfig = group(PlaneConfig)
    sync: SyncConfig = group(SyncConfig)
    style: OverlayStyleConfig = group(OverlayStyleConfig)
