"""Devices beside the ring in a lab: echo probe, star-shaped catheter, twin lasso, pacing catheter, skin electrodes."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from lasso_motion_ros.geometry.projection import Projection
from lasso_motion_ros.geometry.transforms import apply, rotation_from_vector
from lasso_motion_ros.phantom.bodies import Body, Rays
from lasso_motion_ros.phantom.catheters import (
    MATERIAL,
    SEPTUM,
    body_segments,
    build_loop,
    electrode,
    followed,
    lasso_shaft,
    loop_segments,
    spline,
)
from lasso_motion_ros.phantom.lab_settings import BystanderSettings
from lasso_motion_ros.phantom.settings import LassoSettings
from lasso_motion_ros.phantom.tubes import Segments, chain, joined

Array = npt.NDArray[np.float64]

SPLINES, SPLINE_ELECTRODES = 5, 4
SPLINE_LENGTH_M = 17e-3


@dataclass(frozen=True)
class DeviceMaterials:
    """Attenuation in excess of the surroundings', 1/m.

    Attributes:
        braid: an endoscope's steel braid, as if it filled the tube.
        hollow: what is taken off again inside it.
        transducer: the echo probe's array and its board.
        housing: the tip's plastic and wiring.
        snap: a skin electrode's metal button.
        gel: the pad round it.
        lead: its copper wire.
    """

    braid: float = 95.0
    hollow: float = -62.0
    transducer: float = 210.0
    housing: float = 45.0
    snap: float = 420.0
    gel: float = 24.0
    lead: float = 260.0


DEVICE = DeviceMaterials()


def echo_probe(diameter_m: float, motion: Array, hand_m: Array) -> Segments:
    """A transoesophageal probe: a steel-braided endoscope that ends in a dense, wider tip behind the atrium.

    Args:
        diameter_m: of its tip; the endoscope is a fifth thinner.
        motion: (4, 4) the heart's motion from end-expiration, of which the oesophagus takes half.
        hand_m: (3,) how far the examiner has moved it.
    """
    knots = np.array([[0, 26, 200], [2, 30, 110], [5, 34, 60], [8, 36, 24], [10, 37, -6]]) * 1e-3
    shares = (0.0, 0.15, 0.35, 0.5, 0.5)
    moved = [followed(knot, share, motion) + hand_m for knot, share in zip(knots, shares, strict=True)]
    curve = spline(np.stack(moved), 2.0e-3)
    radius = 0.5 * diameter_m
    tip, neck, body = curve[-18:], curve[-21:-17], curve[:-17]
    return joined(
        [
            chain(body, 0.8 * radius, DEVICE.braid),
            chain(body, 0.66 * radius, DEVICE.hollow),
            chain(neck, 0.9 * radius, DEVICE.braid),
            chain(tip, radius, DEVICE.housing),
            # The array and its board fill the middle of the housing.
            chain(tip[3:15], 0.62 * radius, DEVICE.transducer),
            chain(tip[6:10], 0.8 * radius, DEVICE.transducer),
        ]
    )


def star_catheter(hub: Array, towards: Array, motion: Array) -> Segments:
    """Five thin splines with four electrodes each, spread like a star from a shaft over the septum.

    Args:
        hub: (3,) where the splines part, metres, moved with the heart already.
        towards: (3,) unit vector, the shaft's direction at the hub.
        motion: (4, 4) the heart's motion from end-expiration.
    """
    helper = np.eye(3)[np.argmin(np.abs(towards))]
    first = np.cross(towards, helper)
    first /= np.linalg.norm(first)
    second = np.cross(towards, first)
    parts: list[Segments] = []
    reach = np.linspace(0.0, 1.0, 14)[:, None]
    for index in range(SPLINES):
        angle = 2.0 * np.pi * index / SPLINES + 0.35 * np.sin(2.3 * index)
        aside = np.cos(angle) * first + np.sin(angle) * second
        # They lean forward and droop outward, each a little otherwise.
        forward = (0.45 + 0.12 * np.cos(1.7 * index)) * reach - 0.35 * reach**2
        curve = hub + SPLINE_LENGTH_M * (np.sin(1.25 * reach) / np.sin(1.25) * aside + forward * towards)
        parts.append(body_segments(curve, 0.5e-3))
        for number in range(SPLINE_ELECTRODES):
            # 2-6-2 mm from the tip on.
            at = 1.0e-3 + 1e-3 * (0.0, 2.0, 8.0, 10.0)[number]
            parts.append(electrode(curve[::-1], at, 1.0e-3, 0.55e-3, MATERIAL.ring))
    knots = [hub, hub - 8.0e-3 * towards, apply(motion, SEPTUM + np.array([-1.0, 3.0, 4.0]) * 1e-3)]
    knots += [followed(np.array(place) * 1e-3, share, motion) for place, share in _CAVA]
    parts.append(body_segments(spline(np.asarray(knots)), 1.15e-3))
    return joined(parts)


_CAVA = (((-27, 0, -62), 0.6), ((-28, 4, -120), 0.15), ((-27, 8, -190), 0.0))


class TwinLasso:
    """A second lasso of the same kind in the neighbouring vein; it differs in place, tilt and spin only."""

    def __init__(self, settings: LassoSettings, bystanders: BystanderSettings, random: np.random.Generator) -> None:
        axis = random.normal(size=3)
        turn = np.radians(bystanders.twin_tilt_deg) * axis / np.linalg.norm(axis)
        self._settings = dataclasses.replace(
            settings,
            centre_mm=tuple(np.asarray(settings.centre_mm) + bystanders.twin_offset_mm),
            normal=tuple(rotation_from_vector(turn) @ np.asarray(settings.normal)),
            spin_deg=float(random.uniform(0.0, 360.0)),
        )
        self.loop = build_loop(self._settings, SEPTUM)

    def segments(self, since_first: Array, motion: Array) -> Segments:
        """It and its shaft; motions (4, 4) of the heart since the first pair, and from end-expiration."""
        points = apply(since_first, self.loop.points)
        shaft = body_segments(lasso_shaft(points, self.loop.normal, motion), 0.75e-3)
        return joined([loop_segments(points, self._settings), shaft])


def pacing_catheter(motion: Array, contraction: float) -> Segments:
    """A 5F quadripolar catheter from the inferior vena cava to the right ventricle's apex."""
    knots = np.array(
        [[-30, 0, -190], [-30, -4, -110], [-33, -16, -52], [-16, -38, -36], [12, -60, -40], [32, -70, -50]]
    )
    shares = (0.0, 0.15, 0.6, 1.0, 1.0, 1.0)
    pulls = (0.0, 0.0, 0.1, 0.4, 0.8, 1.0)
    beat = contraction * np.array([-3.0e-3, 2.0e-3, 3.0e-3])
    moved = [
        followed(knot * 1e-3, share, motion) + pull * beat
        for knot, share, pull in zip(knots, shares, pulls, strict=True)
    ]
    curve = spline(np.stack(moved))[::-1]
    parts = [body_segments(curve, 0.83e-3), electrode(curve, 1.0e-3, 2.0e-3, 0.9e-3, MATERIAL.large_ring)]
    parts += [electrode(curve, at, 1.0e-3, 0.88e-3, MATERIAL.large_ring) for at in (7.0e-3, 12.0e-3, 17.0e-3)]
    return joined(parts)


def skin_discs(
    projections: list[Projection], trunk: Body, centre: Array, count: int, random: np.random.Generator
) -> Segments:
    """Skin electrodes with their leads, each somewhere within 40 mm of the ring as one of the planes sees it.

    Args:
        projections: of the planes, at the first pair.
        trunk: the skin.
        centre: (3,) of the ring, metres.
        count: how many.
        random: draws plane, place, and front or back.
    """
    parts: list[Segments] = []
    for _ in range(count):
        projection = projections[int(random.integers(len(projections)))]
        direction = centre + random.uniform(-0.04, 0.04, 3) - projection.source
        direction = direction / np.linalg.norm(direction)
        enter, leave = trunk.interval(Rays(projection.source, direction[:, None], (1, 1)))
        at = projection.source + direction * float(enter[0] if random.integers(2) else leave[0])
        outward = at - trunk.centre
        outward[2] = 0.0
        outward /= np.linalg.norm(outward)
        gel = np.stack([at, at + 1.5e-3 * outward])
        snap = np.stack([at + 1.5e-3 * outward, at + 4.5e-3 * outward])
        parts += [chain(gel, 14.0e-3, DEVICE.gel), chain(snap, 4.6e-3, DEVICE.snap)]
        aside = np.cross(outward, (0.0, 0.0, 1.0))
        way = np.array([[0.0, 0.0], [0.004, 0.02], [random.uniform(-0.02, 0.04), 0.07], [0.05, 0.16]])
        lead = snap[1] + way[:, :1] * aside + way[:, 1:] * np.array([0.0, 0.0, 1.0])
        parts.append(chain(spline(lead, 2.0e-3), 0.55e-3, DEVICE.lead))
    return joined(parts)
