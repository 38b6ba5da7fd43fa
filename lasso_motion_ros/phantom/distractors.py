"""Other things that look like a line or a ring: wires, leads, a probe, another ring catheter."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from lasso_motion_ros.geometry.transforms import apply
from lasso_motion_ros.phantom.catheters import (
    SEPTUM,
    body_segments,
    build_loop,
    followed,
    lasso_shaft,
    loop_segments,
    spline,
)
from lasso_motion_ros.phantom.settings import DistractorSettings, LassoSettings
from lasso_motion_ros.phantom.tubes import Segments, chain, joined

Array = npt.NDArray[np.float64]

STEEL_WIRE = 700.0


def distractor_segments(settings: DistractorSettings, motion: Array, breath: Array) -> Segments:
    """All distractors at one instant.

    Args:
        settings: which there are.
        motion: (4, 4) the heart's motion from end-expiration.
        breath: (3,) breathing's displacement of the heart, metres; the chest wall rises by a tenth of it.
    """
    lift = np.array([0.0, 0.12, -0.10]) * breath[2]
    parts: list[Segments] = []
    for index in range(settings.sternal_wires):
        parts.append(_moved(_sternal_wire(index), lift))
    for index in range(settings.ecg_leads):
        parts.append(_moved(_ecg_lead(index), lift))
    if settings.oesophageal_probe:
        parts.append(_oesophageal_probe(motion))
    if settings.second_ring:
        parts.append(_second_ring(motion))
    return joined(parts)


def _moved(segments: Segments, shift: Array) -> Segments:
    shifts = np.broadcast_to(shift, segments.start.shape)
    return segments.moved_by(shifts, shifts)


def _sternal_wire(index: int) -> Segments:
    """A 0.8 mm steel cerclage round the sternum with its twisted end at the front."""
    height = 62.0 - 26.0 * index
    angle = np.linspace(0.25, 2.0 * np.pi - 0.1, 60)
    wobble = 2.2 * np.sin(2.0 * angle + 1.3 * index)
    ring = np.stack([17.0 * np.sin(angle), -104.0 - 8.0 * np.cos(angle), height + wobble], axis=1)
    twist = np.linspace(0.0, 1.0, 26)
    tail = np.stack(
        [1.1 * np.sin(16.0 * twist) + 4.0 * twist, -112.5 - 1.1 * np.cos(16.0 * twist), height - 7.0 * twist], axis=1
    )
    return joined([chain(ring * 1e-3, 0.4e-3, STEEL_WIRE), chain(tail * 1e-3, 0.4e-3, STEEL_WIRE)])


def _ecg_lead(index: int) -> Segments:
    """A copper lead on the skin, ending in a snap electrode."""
    side = -1.0 if index % 2 else 1.0
    end = np.array([side * (28.0 + 11.0 * index), -104.0 + 3.0 * index, -26.0 - 9.0 * index])
    knots = end + np.array(
        [[0, 0, 0], [side * 6, 2, 14], [side * 22, 12, 30], [side * 26, 18, 75], [side * 60, 44, 120]]
    )
    snap = np.stack([end - np.array([0.0, 2.0, 0.0]), end + np.array([0.0, 1.0, 0.0])])
    return joined([chain(spline(knots * 1e-3, 1.5e-3), 0.55e-3, 260.0), chain(snap * 1e-3, 4.5e-3, 130.0)])


def _oesophageal_probe(motion: Array) -> Segments:
    """A 3 mm temperature probe behind the atrium, with its sensor at the end."""
    knots = np.array([[2, 27, 190], [3, 29, 110], [6, 30, 45], [9, 31, -14]]) * 1e-3
    curve = spline(
        np.stack([followed(knot, share, motion) for knot, share in zip(knots, (0.0, 0.2, 0.5, 0.5), strict=True)])
    )
    return joined([chain(curve, 1.5e-3, 70.0), chain(curve[-8:], 1.2e-3, 260.0)])


def _second_ring(motion: Array) -> Segments:
    """A second, smaller ring catheter in a right vein."""
    settings = LassoSettings(centre_mm=(-24.0, 8.0, 12.0), normal=(0.8, 0.45, 0.25), diameter_mm=15.0, turns=0.9)
    ring = build_loop(settings, SEPTUM)
    points = apply(motion, ring.points)
    shaft = body_segments(lasso_shaft(points, ring.normal, motion), 0.7e-3)
    return joined([loop_segments(points, settings), shaft])
