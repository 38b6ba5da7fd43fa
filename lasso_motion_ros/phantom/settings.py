"""The table of all phantom settings: name, default, unit, range, meaning, as nested dataclasses.

Vectors are in the patient's axes (x left, y posterior, z cranial). `scenario.py` reads and checks YAML against it.
"""

# ruff: noqa: RUF009 (`setting` returns a dataclass field; the checker cannot see that)

from __future__ import annotations

from dataclasses import dataclass, field

from lasso_motion_ros.phantom.lab_settings import BystanderSettings, Incident, WorkSettings
from lasso_motion_ros.phantom.setting_fields import Vector, setting


@dataclass(frozen=True)
class PlaneSettings:
    """One plane's C-arm angles."""

    lao_deg: float = setting(0.0, "rotation, LAO positive, RAO negative", unit="deg", minimum=-180, maximum=180)
    cranial_deg: float = setting(0.0, "tilt, CRAN positive, CAUD negative", unit="deg", minimum=-60, maximum=60)
    roll_deg: float = setting(0.0, "rotation of the picture on its detector", unit="deg", minimum=-180, maximum=180)


@dataclass(frozen=True)
class GeometrySettings:
    """The biplane C-arm."""

    plane_a: PlaneSettings = field(default_factory=lambda: PlaneSettings(lao_deg=-30.0))
    plane_b: PlaneSettings = field(default_factory=lambda: PlaneSettings(lao_deg=60.0))
    size_px: int = setting(1024, "side of the square image", unit="px", choices=(128, 256, 512, 1024))
    field_mm: float = setting(195.0, "side of the field on the detector", unit="mm", minimum=80, maximum=400)
    source_detector_mm: float = setting(1200.0, "source to detector (SID)", unit="mm", minimum=600, maximum=1500)
    source_object_mm: float = setting(785.0, "source to iso-centre (SOD)", unit="mm", minimum=400, maximum=1200)
    mirrored: bool = setting(True, "display as seen facing the patient; false: seen from the source")


@dataclass(frozen=True)
class LassoSettings:
    """The circumferential mapping catheter."""

    centre_mm: Vector = setting(
        (12.0, 2.0, 8.0), "centre of the loop at the first pair", unit="mm", minimum=-60, maximum=60
    )
    normal: Vector = setting((0.75, -0.1, 0.65), "axis of the loop; any length but zero", minimum=-10, maximum=10)
    spin_deg: float = setting(0.0, "where along the loop its tip lies", unit="deg", minimum=-360, maximum=360)
    diameter_mm: float = setting(20.0, "diameter", unit="mm", minimum=10, maximum=35)
    aspect: float = setting(1.0, "shorter by longer axis", minimum=0.6, maximum=1.0)
    turns: float = setting(0.95, "length of the loop; below 1 it is open, above it overlaps", minimum=0.6, maximum=1.5)
    helix_mm: float = setting(1.4, "rise along the axis from tip to shaft", unit="mm", minimum=0, maximum=8)
    electrodes: int = setting(10, "ring electrodes on the loop", minimum=0, maximum=24)
    pair_spacing: float = setting(
        0.5,
        "from the first to the second electrode of a pair, by the distance of two pairs: 0.5 even, 0.25 for 2-6-2 mm",
        minimum=0.1,
        maximum=0.5,
    )
    electrode_length_mm: float = setting(1.0, "length of an electrode", unit="mm", minimum=0.5, maximum=4)
    electrode_diameter_mm: float = setting(1.24, "its outer diameter", unit="mm", minimum=0.7, maximum=3)
    contrast: float = setting(1.0, "attenuation of wire and electrodes, by the usual one", minimum=0.1, maximum=3)
    bulge: float = setting(
        0.0, "the loop's radius swells and shrinks by this share, thrice a turn", minimum=0, maximum=0.2
    )
    saddle_mm: float = setting(
        0.0, "it bends out of its plane by this much, twice a turn", unit="mm", minimum=0, maximum=5
    )
    tilt_deg: float = setting(
        0.0, "own tilt with the heartbeat, which the atrium has not", unit="deg", minimum=0, maximum=10
    )
    stretch: float = setting(0.0, "own change of diameter with the heartbeat", minimum=0, maximum=0.1)
    seat_mm: float = setting(
        0.0, "to and fro against the atrium on which it lies, at most", unit="mm", minimum=0, maximum=3
    )
    seat_period_s: float = setting(8.0, "once to and fro", unit="s", minimum=2, maximum=60)
    seat_direction: Vector = setting((0.0, 0.0, 1.0), "which way; any length but zero", minimum=-10, maximum=10)


@dataclass(frozen=True)
class BreathingSettings:
    """Respiratory motion of the heart."""

    amplitude_mm: float = setting(12.0, "excursion from end-expiration", unit="mm", minimum=0, maximum=40)
    direction: Vector = setting((0.08, -0.25, -1.0), "direction of inspiration; any length", minimum=-10, maximum=10)
    period_s: float = setting(
        4.5, "length of a breath; of a jet ventilator's stroke", unit="s", minimum=0.2, maximum=12
    )
    start: float = setting(0.0, "part of the first breath that has passed at the first pair", minimum=0, maximum=1)
    hysteresis_mm: float = setting(
        0.0, "half width of the loop between the ways in and out", unit="mm", minimum=0, maximum=10
    )
    irregularity: float = setting(0.0, "relative spread of depth and period of the breaths", minimum=0, maximum=0.5)
    drift_mm_per_min: float = setting(0.0, "drift of end-expiration", unit="mm/min", minimum=-30, maximum=30)
    rotation_deg: float = setting(0.0, "rotation of the heart at full inspiration", unit="deg", minimum=-10, maximum=10)
    rotation_axis: Vector = setting((1.0, 0.2, 0.1), "its axis; any length", minimum=-10, maximum=10)


@dataclass(frozen=True)
class HeartSettings:
    """The heartbeat."""

    rate_bpm: float = setting(66.0, "beats a minute", unit="1/min", minimum=30, maximum=200)
    variability: float = setting(0.03, "relative spread of the beats' lengths", minimum=0, maximum=0.4)
    amplitude_mm: float = setting(0.8, "translation of the atrium in systole", unit="mm", minimum=0, maximum=10)
    strength_spread: float = setting(
        0.0, "relative spread of the beats' strengths, as in fibrillation", minimum=0, maximum=1
    )
    direction: Vector = setting((-0.5, 0.4, -0.75), "its direction; any length", minimum=-10, maximum=10)


@dataclass(frozen=True)
class ImagingSettings:
    """Tube, detector and display."""

    quanta: float = setting(40.0, "mean quanta a pixel behind the patient", unit="1/px", minimum=1, maximum=500)
    scatter: float = setting(0.35, "scattered by primary quanta behind the grid", minimum=0, maximum=3)
    focal_spot_mm: float = setting(0.6, "width of the focal spot", unit="mm", minimum=0, maximum=2)
    detector_blur_px: float = setting(
        0.8, "detector's blur (sigma); noise is blurred with it", unit="px", minimum=0, maximum=5
    )
    electronic_noise: float = setting(0.8, "read-out noise", unit="quanta", minimum=0, maximum=50)
    lag: float = setting(0.03, "part of a frame that remains in the next", minimum=0, maximum=0.8)
    brightness_drift: float = setting(
        0.02, "relative change of the dose by the exposure control", minimum=0, maximum=0.5
    )
    gamma: float = setting(0.6, "exponent of the display curve", minimum=0.2, maximum=1.5)
    edge_enhancement: float = setting(0.0, "strength of the unsharp mask", minimum=0, maximum=4)
    polarity: str = setting("dark", "the catheter against its background", choices=("dark", "bright"))
    bits: int = setting(12, "8: mono8; 12: mono16 up to 4095", unit="bit", choices=(8, 12))
    collimator: Vector = setting(
        (0.0, 0.0, 0.0, 0.0), "covered part of the field at left, top, right, bottom", minimum=0, maximum=0.45
    )


@dataclass(frozen=True)
class CalibrationSettings:
    """How far the published matrices are from those rendered with, in each plane, in random directions."""

    angle_deg: float = setting(0.0, "rotation about the iso-centre", unit="deg", minimum=0, maximum=3)
    shift_mm: float = setting(0.0, "translation of the gantry", unit="mm", minimum=0, maximum=10)
    shift_px: float = setting(0.0, "translation of the picture", unit="px", minimum=0, maximum=20)
    swapped: bool = setting(False, "each plane is published with the other one's matrix")


@dataclass(frozen=True)
class ClickSettings:
    """The user's clicks in the first pair."""

    noise_px: float = setting(1.5, "standard deviation of a click, each axis", unit="px", minimum=0, maximum=20)
    fewest: int = setting(8, "clicks a plane, at least", minimum=6, maximum=100)
    most: int = setting(14, "clicks a plane, at most", minimum=6, maximum=100)


@dataclass(frozen=True)
class DistractorSettings:
    """What else looks like a line or a ring."""

    sternal_wires: int = setting(0, "wire cerclages in the sternum", minimum=0, maximum=8)
    ecg_leads: int = setting(0, "leads with their electrodes on the skin", minimum=0, maximum=6)
    oesophageal_probe: bool = setting(False, "temperature probe behind the atrium")
    second_ring: bool = setting(False, "another ring catheter, in another vein")
    coronary_sinus: bool = setting(True, "decapolar catheter in the coronary sinus")
    ablation: bool = setting(True, "ablation catheter with an 8F tip")
    ablation_offset_mm: Vector = setting(
        (2.0, -18.0, -14.0), "its tip, from the loop's centre", unit="mm", minimum=-60, maximum=60
    )


EVENT_KINDS = ("hide", "remove", "move", "drop", "table_pan", "gantry_turn", "zoom")


@dataclass(frozen=True)
class Event:
    """Something that happens at certain pairs (numbered from 0)."""

    kind: str = setting("hide", "what happens", choices=EVENT_KINDS)
    first: int = setting(1, "first pair concerned", minimum=1, maximum=100000)
    last: int = setting(0, "last pair concerned: hide and drop end there, motions arrive there; 0: first", minimum=0)
    plane: str = setting("both", "plane concerned by drop, gantry_turn, zoom", choices=("a", "b", "both"))
    shift_mm: Vector = setting((0.0, 0.0, 0.0), "move, table_pan: by how much", unit="mm", minimum=-200, maximum=200)
    turn_deg: Vector = setting(
        (0.0, 0.0, 0.0), "move: rotation vector of the loop", unit="deg", minimum=-180, maximum=180
    )
    lao_deg: float = setting(0.0, "gantry_turn: change of the angle", unit="deg", minimum=-180, maximum=180)
    cranial_deg: float = setting(0.0, "gantry_turn: change of the tilt", unit="deg", minimum=-60, maximum=60)
    factor: float = setting(1.0, "zoom: magnification", minimum=0.5, maximum=3.0)
    calibrated: bool = setting(True, "table_pan, gantry_turn, zoom: the published matrices follow")

    @property
    def end(self) -> int:
        """Last pair concerned."""
        return max(self.first, self.last)


@dataclass(frozen=True)
class Scenario:
    """One biplane sequence."""

    name: str = setting("unnamed", "short name; by default that of the file")
    description: str = setting("", "what is hard about it")
    pairs: int = setting(30, "biplane pairs", minimum=1, maximum=100000)
    rate_hz: float = setting(3.0, "pairs a second", unit="Hz", minimum=0.5, maximum=30)
    plane_b_offset: float = setting(0.0, "exposure of B after A, in frame periods", minimum=0, maximum=0.5)
    seed: int = setting(1, "seed of all that is random", minimum=0, maximum=2**31 - 1)
    geometry: GeometrySettings = field(default_factory=GeometrySettings)
    lasso: LassoSettings = field(default_factory=LassoSettings)
    breathing: BreathingSettings = field(default_factory=BreathingSettings)
    heart: HeartSettings = field(default_factory=HeartSettings)
    imaging: ImagingSettings = field(default_factory=ImagingSettings)
    calibration_error: CalibrationSettings = field(default_factory=CalibrationSettings)
    distractors: DistractorSettings = field(default_factory=DistractorSettings)
    clicks: ClickSettings = field(default_factory=ClickSettings)
    ablation_work: WorkSettings = field(default_factory=WorkSettings)
    bystanders: BystanderSettings = field(default_factory=BystanderSettings)
    events: tuple[Event, ...] = ()
    incidents: tuple[Incident, ...] = ()
    exact_place: bool = setting(
        False, "the ring's own displacement, not the published geometry, says whether it is in its place"
    )
