"""Parameters of the overlay node."""

from __future__ import annotations

from dataclasses import dataclass, field

from lasso_motion_ros.config.parameters import parameter
from lasso_motion_ros.config.stream import SyncConfig


@dataclass(frozen=True)
class OverlayStyleConfig:
    """How the overlay looks; every entry can be changed while the node runs."""

    drawing: str = parameter(
        "both", "what is drawn of the surface", choices=("outline", "fill", "both"), read_only=False
    )
    fill_opacity: float = parameter(0.30, "opacity of the fill at its rim", minimum=0.0, maximum=1.0, read_only=False)
    outline_width_px: float = parameter(
        2.0, "width of the outline, at a 1024-pixel image", unit="px", minimum=1.0, maximum=10.0, read_only=False
    )
    show_static: bool = parameter(True, "draw the uncompensated place faintly beside the compensated", read_only=False)
    compensated_colour: str = parameter("#4be08a", "colour at the compensated place, #rrggbb", read_only=False)
    static_colour: str = parameter("#8fb4d8", "colour at the static place beside it, #rrggbb", read_only=False)
    warning_colour: str = parameter("#ffb000", "colour of all that is not compensated, #rrggbb", read_only=False)
    projection_depth_mm: float = parameter(
        30.0,
        "thickness that gets fill_opacity where a volume is shown as projection",
        unit="mm",
        minimum=1.0,
        maximum=500.0,
        read_only=False,
    )


@dataclass(frozen=True)
class VolumeConfig:
    """What is shown of a medical volume."""

    display: str = parameter(
        "surface", "its surface, or a translucent projection of all that lies inside", choices=("surface", "projection")
    )
    level: float = parameter(0.5, "the surface lies where the values cross this; the default suits masks (0 and 1)")
    label: int = parameter(0, "the surface of the voxels with this value, instead of level; 0: none", minimum=0)
    triangles: int = parameter(
        20_000, "a surface of more triangles is simplified to this many", minimum=1_000, maximum=500_000
    )


@dataclass(frozen=True)
class OverlayConfig:
    """All parameters of the overlay node."""

    volume_file: str = parameter(
        "",
        "what is drawn: a surface (STL, PLY, OBJ, VTK, VTP) or a volume (NIfTI, NRRD, MHA, a folder with a DICOM "
        "series)",
    )
    registration: str = parameter(
        "0 0 0 0 0 0 1",
        "volume (LPS) to world at the reference pair, metres: x y z and quaternion x y z w, or the 16 numbers of a 4x4 "
        "matrix, row by row; or a text file that holds them",
    )
    units: str = parameter(
        "",
        "unit of the file's coordinates; must be given for a surface, mm if not given for a volume",
        choices=("", "mm", "m"),
    )
    axes: str = parameter(
        "",
        "a surface file's axes: LPS (+x left, +y posterior, +z cranial) or RAS; if not given, as the file states "
        "(SPACE=RAS), else LPS",
        choices=("", "lps", "ras"),
    )
    volume: VolumeConfig = field(default_factory=VolumeConfig)
    motion_wait_s: float = parameter(
        0.05, "an image waits this long for its pair's motion", unit="s", minimum=0.0, maximum=5.0
    )
    motion_timeout_s: float = parameter(
        1.0, "a motion older than this is not applied any more", unit="s", minimum=0.0, maximum=60.0
    )
    world_frame: str = parameter("patient_table", "frame fixed to the table top; the frame of motion and registration")
    niceness: int = parameter(
        5,
        "how far the thread that draws stands back for other programs, a tracker on the same machine above all",
        minimum=0,
        maximum=19,
    )
    sync: SyncConfig = field(default_factory=SyncConfig)
    style: OverlayStyleConfig = field(default_factory=OverlayStyleConfig)
