"""Every parameter of the product, declared once: default, unit, range, meaning.

The dataclasses below are the one table from which the ROS parameter declarations, `config/*.yaml` and the
documentation come. A configuration file is ROS 2 parameter YAML, the same for node and command.
"""

from __future__ import annotations

from dataclasses import dataclass, field

from lasso_motion_ros.config.parameters import parameter, tuning
from lasso_motion_ros.motion.breathing_prior import POSTURES


@dataclass(frozen=True)
class PathConfig:
    """Minimal path between the clicks."""

    line_sigma_mm: float = parameter(
        0.25, "scale of the line filter under the path cost, at the iso-centre", unit="mm", minimum=0.05, maximum=2.0
    )
    cost_floor: float = parameter(
        0.05, "cost of a pixel on a perfect line, relative to one off any line", minimum=1e-3, maximum=1.0
    )


@dataclass(frozen=True)
class ModelConfig:
    """The 3-D model of the loop."""

    points: int = parameter(100, "points on the model curve (L) of the published method", minimum=16, maximum=1000)


@dataclass(frozen=True)
class FeatureConfig:
    """Feature images of the published method."""

    roi_px: int = parameter(400, "side of the region of interest, at a 1024-pixel image", unit="px", minimum=64)
    sigma_min_px: float = parameter(
        1.5, "smallest scale of the line filter, at a 1024-pixel image", unit="px", minimum=0.5, maximum=10.0
    )
    sigma_max_px: float = parameter(
        3.0, "largest scale of the line filter, at a 1024-pixel image", unit="px", minimum=0.5, maximum=20.0
    )
    scales: int = parameter(3, "number of scales, spaced geometrically", minimum=1, maximum=8)


@dataclass(frozen=True)
class RegistrationConfig:
    """Best-neighbour registration of the published method."""

    normal_search_px: int = parameter(
        5,
        "each model point takes the smallest distance within ± this along the normal",
        unit="px",
        minimum=0,
        maximum=40,
    )
    translation_step_mm: float = parameter(2.0, "first step of the translation", unit="mm", minimum=0.01)
    rotation_step_deg: float = parameter(2.0, "first step of the rotation", unit="deg", minimum=0.01)
    smallest_step: float = parameter(
        0.02, "steps are halved until below this fraction of the first", minimum=1e-4, maximum=1.0
    )


@dataclass(frozen=True)
class SyncConfig:
    """How images of the two planes are paired, by their stamps."""

    jitter_s: float = parameter(0.005, "a B this much earlier than its A still belongs to it", unit="s", minimum=0.0)
    plane_b_offset_s: float = parameter(
        -1.0, "known time from A's to B's exposure; negative: unknown, pair by the half-period rule", unit="s"
    )


@dataclass(frozen=True)
class HeartbeatConfig:
    """How the heartbeat is kept out of `motion`; `motion_raw` keeps it."""

    mode: str = parameter(
        "none",
        "none: motion is motion_raw; gate: motion is updated in a window of the beat only, by R peaks;"
        " filter: the heartbeat is estimated and taken away, by R peaks or, at enough pairs a second, without",
        choices=("none", "gate", "filter"),
    )
    window_start: float = parameter(
        0.45, "gate: the window opens at this part of the beat, counted from its R peak", minimum=0.0, maximum=1.0
    )
    window_end: float = parameter(
        0.8, "gate: it closes; below window_start it reaches over the R peak", minimum=0.0, maximum=1.0
    )
    slowest_bpm: float = parameter(
        45.0, "filter without R peaks: slowest heart looked for", unit="1/min", minimum=20.0, maximum=240.0
    )
    fastest_bpm: float = parameter(
        110.0,
        "filter without R peaks: fastest heart looked for; more than twice as many pairs a minute are needed",
        unit="1/min",
        minimum=20.0,
        maximum=240.0,
    )
    excursion_mm: float = parameter(
        0.8, "filter: size of the heartbeat's motion, roughly", unit="mm", minimum=0.05, maximum=10.0
    )


@dataclass(frozen=True)
class RingConfig:
    """How far the ring may move by itself, beside its translation (standard deviations)."""

    turn_deg: float = parameter(2.5, "tilt about any axis, and spin", unit="deg", minimum=0.1, maximum=20.0)
    stretch: float = parameter(0.02, "relative change of size", minimum=0.001, maximum=0.2)


@dataclass(frozen=True)
class SearchConfig:
    """Where the loop is looked for."""

    near_mm: float = tuning(
        12.0, "about the prediction, beyond its own uncertainty; where this fails, everywhere", unit="mm", minimum=2.0
    )
    candidates: int = tuning(4, "places aligned and judged before giving up", minimum=1, maximum=20)


@dataclass(frozen=True)
class JudgementConfig:
    """When a fit is believed."""

    smallest_likeness: float = tuning(
        0.65, "correlation with the loop's appearance, relative to what this dose allows", minimum=0.0, maximum=1.0
    )
    smallest_visible: float = tuning(0.6, "share of the loop that looks as expected", minimum=0.0, maximum=1.0)
    full_visible: float = tuning(0.8, "share below which the state is DEGRADED", minimum=0.0, maximum=1.0)
    faint_likeness: float = tuning(
        0.3, "likeness that is enough where the other plane and the motion agree", minimum=0.0, maximum=1.0
    )
    clear_likeness: float = tuning(0.8, "likeness for a pose that rests on one plane", minimum=0.0, maximum=1.0)
    one_plane_s: float = tuning(3.0, "longest time that one plane alone carries a pose", unit="s", minimum=0.0)
    degraded_gap_mm: float = tuning(0.8, "disagreement of the planes: DEGRADED", unit="mm", minimum=0.05)
    lost_gap_mm: float = tuning(1.6, "disagreement of the planes: LOST", unit="mm", minimum=0.1)
    degraded_turn_deg: float = parameter(
        6.0,
        "turn of the ring since the seed, as a C-arm that moved unsaid makes it: DEGRADED",
        unit="deg",
        minimum=1.0,
    )
    lost_turn_deg: float = parameter(8.0, "likewise: LOST", unit="deg", minimum=1.0)
    largest_speed_mm_s: float = tuning(65.0, "faster is a jump, not a breath", unit="mm/s", minimum=1.0)
    jump_allowance_mm: float = tuning(2.0, "moved at once without being a jump", unit="mm", minimum=0.0)
    longest_jump_interval_s: float = tuning(1.5, "pause after which speed tells nothing", unit="s", minimum=0.0)
    displaced_mm: float = tuning(8.0, "off the breathing curve: DISPLACED", unit="mm", minimum=1.0)
    repeatable_mm: float = tuning(
        4.0,
        "off the curve and across its axis: DISPLACED, once breaths have repeated within a quarter of it",
        unit="mm",
        minimum=1.0,
    )
    deeper_breath_mm: float = tuning(
        20.0, "a breath may go this far beyond the ones before, if foreseeable", unit="mm", minimum=0.0
    )
    longest_breath_s: float = tuning(9.0, "by then a whole breath has been seen", unit="s", minimum=1.0, maximum=30.0)


@dataclass(frozen=True)
class TrackerConfig:
    """All that the tracker's method depends on."""

    method: str = parameter(
        "appearance", "tracking method: ours, or the published one", choices=("appearance", "brost2009")
    )
    polarity: str = parameter("auto", "the catheter against its background", choices=("auto", "dark", "bright"))
    posture: str = parameter(
        "supine",
        "how the patient lies: the direction in which breathing is expected to move the heart until that has been seen"
        " (head at the top of the images, detectors above the patient, plane A the more frontal); unknown: none",
        choices=POSTURES,
    )
    path: PathConfig = field(default_factory=PathConfig)
    model: ModelConfig = field(default_factory=ModelConfig)
    features: FeatureConfig = field(default_factory=FeatureConfig)
    registration: RegistrationConfig = field(default_factory=RegistrationConfig)
    ring: RingConfig = field(default_factory=RingConfig)
    search: SearchConfig = field(default_factory=SearchConfig)
    judgement: JudgementConfig = field(default_factory=JudgementConfig)


@dataclass(frozen=True)
class ProductConfig(TrackerConfig):
    """The tracker's parameters and those of the stream around it.

    What concerns the live node alone (how it starts, how it subscribes) stands here too, since one file serves the
    node and the offline command, which has no use for it.
    """

    world_frame: str = parameter("patient_table", "frame fixed to the table top; the frame of every pose published")
    seed_buffer_pairs: int = parameter(32, "past pairs kept for seeds with an older stamp", minimum=1, maximum=1000)
    autostart: bool = parameter(True, "the node configures and activates itself")
    image_reliability: str = parameter(
        "auto",
        "how the node subscribes to images; auto: as the publisher offers",
        choices=("auto", "reliable", "best_effort"),
    )
    stamp_source: str = parameter(
        "header",
        "what the node takes for an image's time of exposure; arrival: its receipt, for sources whose stamps are zero"
        " or whose clocks disagree (CameraInfo then holds until the next)",
        choices=("header", "arrival"),
    )
    seeds_file: str = parameter(
        "", "YAML file with the clicks of both planes, for unattended runs (see lasso-motion track --help)"
    )
    image_depth: int = parameter(10, "images a plane that may wait in the node's subscription", minimum=1, maximum=100)
    sync: SyncConfig = field(default_factory=SyncConfig)
    heartbeat: HeartbeatConfig = field(default_factory=HeartbeatConfig)


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


@dataclass(frozen=True)
class WebConfig:
    """All parameters of the node behind the page."""

    host: str = parameter("127.0.0.1", "address that the page is served on; the default lets this machine in only")
    port: int = parameter(8080, "TCP port of the page; 0: any that is free", minimum=0, maximum=65535)
    allowed_hosts: str = parameter("", "further host names by which browsers may ask for the page, separated by blanks")
    tracker: str = parameter("lasso_tracker", "name of the tracker node, whose services are called")
    overlay: str = parameter("lasso_overlay", "name of the overlay node, whose style is changed")
    answer_wait_s: float = parameter(
        0.15, "a pair waits this long for the tracker's answer before it is shown", unit="s", minimum=0.0, maximum=5.0
    )
    world_frame: str = parameter("patient_table", "frame fixed to the table top; the frame of motion and catheter")
    sync: SyncConfig = field(default_factory=SyncConfig)
