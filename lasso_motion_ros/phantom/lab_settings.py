"""Settings of what a lab has besides a still ring: a working ablation catheter, bystanders, incidents.

All defaults are "there is none", so that a scenario which names nothing of it stays as it is.
"""

# ruff: noqa: RUF009 (`setting` returns a dataclass field; the checker cannot see that)

from __future__ import annotations

from dataclasses import dataclass

from lasso_motion_ros.phantom.setting_fields import Vector, setting


@dataclass(frozen=True)
class WorkSettings:
    """How the ablation catheter works at the ring, where `distractors.ablation` has put one in."""

    works: bool = setting(False, "its tip walks round the ring; otherwise it rests at distractors.ablation_offset_mm")
    nearest_mm: float = setting(0.0, "tip from the loop's centreline, at least", unit="mm", minimum=0, maximum=40)
    farthest_mm: float = setting(6.0, "tip from the loop's centreline, at most", unit="mm", minimum=0, maximum=40)
    speed_mm_s: float = setting(8.0, "on the way from one place to the next", unit="mm/s", minimum=0.5, maximum=60)
    dwell_s: float = setting(3.0, "time at a place, on average", unit="s", minimum=0.1, maximum=60)
    drag_mm_s: float = setting(0.5, "creeps along the loop while it dwells", unit="mm/s", minimum=0, maximum=10)
    bounce_mm: float = setting(1.0, "lifts off the tissue in systole", unit="mm", minimum=0, maximum=6)
    tremor_mm: float = setting(0.4, "the hand's own unrest", unit="mm", minimum=0, maximum=4)
    tip_length_mm: float = setting(4.0, "length of the tip electrode", unit="mm", minimum=2, maximum=10)
    tip_diameter_mm: float = setting(2.66, "its diameter", unit="mm", minimum=1.5, maximum=4)


@dataclass(frozen=True)
class BystanderSettings:
    """Devices that lie in the field and are not the ring. Offsets are from the loop's centre at the first pair."""

    tee_probe: bool = setting(False, "transoesophageal echo probe behind the atrium")
    tee_diameter_mm: float = setting(12.0, "width of its tip", unit="mm", minimum=8, maximum=16)
    star: bool = setting(False, "star-shaped mapping catheter: five splines of four electrodes")
    star_offset_mm: Vector = setting((-14.0, -8.0, 6.0), "its hub", unit="mm", minimum=-60, maximum=60)
    star_drift_mm_s: float = setting(
        0.0, "it is led through the atrium at this speed", unit="mm/s", minimum=0, maximum=20
    )
    twin: bool = setting(False, "a second lasso of the same kind, in the neighbouring vein")
    twin_offset_mm: Vector = setting((2.0, 4.0, -24.0), "its centre", unit="mm", minimum=-60, maximum=60)
    twin_tilt_deg: float = setting(15.0, "its axis against the first one's", unit="deg", minimum=0, maximum=90)
    ecg_discs: int = setting(0, "dense electrodes on the skin, in the field of either plane", minimum=0, maximum=10)
    pacing: bool = setting(False, "quadripolar pacing catheter in the right ventricle")


INCIDENT_KINDS = (
    "cough",
    "apnoea",
    "breath_hold",
    "sigh",
    "shift",
    "slide",
    "withdraw",
    "resize",
    "contrast",
    "dose",
    "window",
    "shutter",
    "off",
)


@dataclass(frozen=True)
class Incident:
    """Something that happens at a time. (What happens at a numbered pair is an `Event`.)

    What lasts: apnoea (from the next end-expiration), breath_hold (from the next full inspiration), contrast, dose,
    window and off end after `duration_s`; cough is over by then. What arrives: shift, withdraw, resize and shutter
    are complete after it and stay. A slide goes on until then; 0: until the end. A sigh is the next whole breath.
    """

    kind: str = setting("cough", "what happens", choices=INCIDENT_KINDS)
    start_s: float = setting(1.0, "when, since the first pair", unit="s", minimum=0, maximum=100000)
    duration_s: float = setting(0.9, "how long", unit="s", minimum=0, maximum=100000)
    amount: float = setting(
        0.0,
        "cough, sigh, shift: mm; slide: mm/s; resize: factor of the diameter; contrast: attenuation, 1/m; "
        "dose: factor of the quanta; window: factor of the grey level",
        minimum=0,
        maximum=400,
    )
    direction: Vector = setting(
        (0.0, 0.0, 0.0), "shift, slide: direction, any length; slide: zero for out of the vein", minimum=-10, maximum=10
    )
    vessel: str = setting("vein", "contrast: where", choices=("vein", "coronary"))
    plane: str = setting("both", "dose, window, shutter, off: plane concerned", choices=("a", "b", "both"))
    covered: Vector = setting(
        (0.0, 0.0, 0.0, 0.0), "shutter: covered part of the field at left, top, right, bottom", minimum=0, maximum=0.45
    )

    def progress(self, time_s: float) -> float:
        """How much of what arrives has arrived: 0 before, 1 from start + duration on, smooth between."""
        if time_s <= self.start_s:
            return 0.0
        if time_s >= self.start_s + self.duration_s:
            return 1.0
        part = (time_s - self.start_s) / self.duration_s
        return part * part * (3.0 - 2.0 * part)

    def lasts(self, time_s: float) -> bool:
        """Whether it is on at a time."""
        return self.start_s <= time_s < self.start_s + self.duration_s

    def concerns(self, plane: str) -> bool:
        """Whether it is about this plane."""
        return self.plane in ("both", plane)
