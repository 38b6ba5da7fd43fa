"""A procedural thorax about the left atrium: what is still, what the heart and the breath move.

Patient axes LPS (+x left, +y posterior, +z cranial) with the left atrium at the origin, in millimetres in the tables
below.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from lasso_motion_ros.geometry.transforms import rotation_from_vector
from lasso_motion_ros.phantom.bodies import Body, cylinder, ellipsoid
from lasso_motion_ros.phantom.tubes import Segments, chain, joined

Array = npt.NDArray[np.float64]


@dataclass(frozen=True)
class TissueAttenuation:
    """Linear attenuation coefficients of a monochromatic beam of about 60 keV, 1/m (NIST XCOM).

    Attributes:
        soft: soft tissue, as water.
        lung: inflated lung, about a quarter of water's density.
        trabecular: bone's inside.
        cortical: bone's shell; compact bone has about 60.
        blood: in the vessels of the lungs.
    """

    soft: float = 20.6
    lung: float = 5.6
    trabecular: float = 27.0
    cortical: float = 50.0
    blood: float = 21.4


TISSUE = TissueAttenuation()


@dataclass(frozen=True, eq=False)
class Additive:
    """A body that adds to the attenuation of what surrounds it.

    Attributes:
        body: where.
        attenuation: difference to the surroundings, 1/m.
    """

    body: Body
    attenuation: float


@dataclass(frozen=True, eq=False)
class Thorax:
    """All of the body at end-expiration.

    Attributes:
        trunk: skin; everything inside is soft tissue unless said otherwise.
        fixed: spine, sternum, fat and muscle: what breathing does not move.
        ribs: centrelines as segments, moved a little by breathing.
        cavities: the two halves of the chest, filled with lung except where something else lies.
        heart: chambers, moved with the heart; they displace lung.
        great_vessels: arch, descending aorta and mediastinum, hardly moved; they displace lung.
        domes: the halves of the diaphragm, moved along z; they displace lung.
        under_diaphragm: additive bodies that move with the domes (stomach gas).
        heart_fat: additive low-contrast lumps that move with the heart.
        airways: trachea and main bronchi, air.
        lung_vessels: arteries and veins in the lungs, moved more the lower they lie.
    """

    trunk: Body
    fixed: list[Additive]
    ribs: Segments
    cavities: list[Body]
    heart: list[Body]
    great_vessels: list[Body]
    domes: list[Body]
    under_diaphragm: list[Additive]
    heart_fat: list[Additive]
    airways: Segments
    lung_vessels: Segments


def build_thorax(random: np.random.Generator) -> Thorax:
    """A thorax of average proportions, its irregularities (vessels, lumps, rib angles) drawn from `random`."""
    cavities = [ellipsoid((-70, -3, 5), (72, 90, 165)), ellipsoid((72, -3, 5), (71, 90, 165))]
    heart = [
        ellipsoid((0, 0, 0), (33, 21, 26)),  # left atrium
        ellipsoid((34, -34, -24), (52, 33, 33), _turn(-0.55, 0.35)),  # left ventricle, towards the apex
        ellipsoid((58, -48, -38), (30, 24, 24), _turn(-0.5, 0.3)),  # apex
        ellipsoid((8, -55, -22), (42, 26, 34), _turn(-0.3, 0.2)),  # right ventricle
        ellipsoid((-34, -30, -12), (27, 28, 36)),  # right atrium
        ellipsoid((27, -13, 22), (17, 17, 19)),  # atrial appendage
        ellipsoid((16, -34, 36), (17, 19, 28), _turn(0.1, -0.5)),  # pulmonary trunk
        ellipsoid((-36, 8, 10), (22, 8, 7), _turn(0.3, 0.35)),  # pulmonary veins
        ellipsoid((-36, 6, -10), (20, 8, 7), _turn(0.3, -0.3)),
        ellipsoid((36, 8, 12), (20, 7, 7), _turn(-0.4, -0.4)),
        ellipsoid((36, 9, -9), (19, 7, 7), _turn(-0.4, 0.3)),
    ]
    heart += _bumps(random, heart[1:5], 14)
    great_vessels = [
        ellipsoid((-6, -32, 48), (17, 18, 48)),  # ascending aorta
        ellipsoid((8, -5, 84), (28, 34, 17)),  # arch
        ellipsoid((-30, -18, 70), (12, 12, 90), _turn(0.0, -0.05)),  # superior vena cava
        ellipsoid((-31, -4, -75), (15, 16, 60)),  # inferior vena cava
        ellipsoid((0, 27, 40), (19, 28, 150), _turn(0.0, 0.04)),  # oesophagus, nodes, fat before the spine
        ellipsoid((-6, 0, 115), (30, 46, 62)),  # upper mediastinum
    ]
    # Spine and descending aorta are no straight cylinders: their borders against the lung wander.
    great_vessels += [
        ellipsoid((-4 + random.normal(0, 2.5), 66, 52 * index), (random.uniform(21, 26), 34, 50))
        for index in range(-2, 3)
    ]
    great_vessels += [
        ellipsoid((22 + random.normal(0, 2), 45 + random.normal(0, 3), 60 * index), [*random.uniform(12, 15, 2), 58])
        for index in range(-2, 3)
    ]
    great_vessels += [
        ellipsoid((side * random.uniform(14, 30), random.uniform(-20, 40), z), random.uniform(9, 17, 3))
        for side, z in zip((-1, 1, -1, 1, -1, 1), (22, 30, 48, 58, 75, 90), strict=True)
    ]
    domes = [
        ellipsoid((-76, 2, -135), (84, 100, 92), _turn(0.0, 0.08)),
        ellipsoid((-48, -20, -128), (52, 70, 80), _turn(0.2, -0.1)),
        ellipsoid((74, 4, -140), (80, 98, 84), _turn(0.0, -0.06)),
        ellipsoid((30, -45, -125), (75, 60, 66), _turn(0.1, 0.1)),  # the heart's bed, with its fat
    ]
    under_diaphragm = [Additive(ellipsoid((66, -22, -92), (31, 22, 11), _turn(0.12, 0.1)), -0.75 * TISSUE.soft)]
    return Thorax(
        trunk=ellipsoid((0, 2, -20), (176, 116, 520)),
        fixed=_spine(random)
        + _sternum()
        + _lumps(random, count=60, spread_mm=(150, 105, 130), size_mm=(8, 34), hollow=0.6, attenuation=-5.0),
        ribs=_ribs(random),
        cavities=cavities,
        heart=heart,
        great_vessels=great_vessels,
        domes=domes,
        under_diaphragm=under_diaphragm,
        heart_fat=_lumps(random, count=18, spread_mm=(55, 45, 45), size_mm=(5, 15), hollow=0.0, attenuation=-3.6),
        airways=_airways(),
        lung_vessels=_lung_vessels(random),
    )


def _turn(about_z: float, about_y: float) -> Array:
    return np.asarray(rotation_from_vector((0.0, 0.0, about_z)) @ rotation_from_vector((0.0, about_y, 0.0)))


def _spine(random: np.random.Generator) -> list[Additive]:
    """Thirteen vertebrae, 24 mm apart."""
    vertebra = _vertebra()
    parts: list[Additive] = []
    for index in range(-6, 7):
        z = 24.0 * index + 5.0 + random.normal(0.0, 0.5)
        # The thoracic kyphosis: the spine bends forward above and below.
        y = 62.0 - 0.0009 * z * z
        x = -4.0 + random.normal(0.0, 0.7)
        tilt = rotation_from_vector((0.0018 * z + random.normal(0.0, 0.02), random.normal(0.0, 0.03), 0.0))
        for offset, body, value in vertebra:
            moved = body.shifted(1e-3 * (np.array([x, y, z]) + tilt @ np.asarray(offset)))
            parts.append(Additive(Body(moved.centre, tilt @ body.axes, body.cylinder), value))
    return parts


def _vertebra() -> list[tuple[tuple[float, float, float], Body, float]]:
    """One vertebra: per part its place in mm, its shape about there, and what it adds to soft tissue, 1/m."""
    spongy, compact = TISSUE.trabecular - TISSUE.soft, TISSUE.cortical - TISSUE.soft
    parts = [((0.0, 0.0, 0.0), cylinder((0, 0, 0), (16.0, 13.0, 9.5)), spongy)]
    for side in (-1.0, 1.0):
        parts += [
            # The body widens to its end plates, which are dense and a little curved.
            ((0.0, 0.0, side * 7.0), cylinder((0, 0, 0), (17.2, 14.2, 2.6)), 0.45 * spongy),
            ((0.0, 0.0, side * 9.0), ellipsoid((0, 0, 0), (17.5, 14.5, 1.6)), 0.22 * compact),
            ((side * 11.0, 18.0, 4.0), ellipsoid((0, 0, 0), (4.0, 9.0, 6.5)), 13.0),  # pedicle
            (
                (side * 24.0, 27.0, 3.0),
                ellipsoid((0, 0, 0), (15.0, 4.5, 5.0), _turn(side * 0.45, 0.0)),
                10.0,
            ),  # transverse
            ((side * 8.0, 25.0, -6.0), ellipsoid((0, 0, 0), (5.5, 4.0, 9.0)), 10.0),  # articular process
        ]
    parts.append(((0.0, 36.0, -12.0), ellipsoid((0, 0, 0), (3.0, 13.0, 13.0)), 10.0))  # spinous process
    return parts


def _bumps(random: np.random.Generator, on: list[Body], count: int) -> list[Body]:
    """Fat and trabeculae: flat lumps half sunk into the surfaces of bodies, which are no perfect ellipsoids."""
    bumps = []
    for index in range(count):
        body = on[index % len(on)]
        direction = random.normal(size=3)
        place = body.centre + 0.93 * body.axes @ (direction / np.linalg.norm(direction))
        turn = rotation_from_vector(random.uniform(-1.5, 1.5, 3))
        bumps.append(ellipsoid(place * 1e3, random.uniform(7.0, 19.0, 3), turn))
    return bumps


def _sternum() -> list[Additive]:
    return [
        Additive(ellipsoid((0, -104, 35), (17, 5.5, 75)), 6.0),
        Additive(ellipsoid((0, -108, 118), (28, 6, 26)), 6.0),
    ]


def _lumps(
    random: np.random.Generator,
    *,
    count: int,
    spread_mm: tuple[float, float, float],
    size_mm: tuple[float, float],
    hollow: float,
    attenuation: float,
) -> list[Additive]:
    """Ellipsoidal lumps of fat and muscle, uniform in a shell of a box (`hollow` of it empty, 0 for none)."""
    lumps: list[Additive] = []
    while len(lumps) < count:
        place = random.uniform(-1.0, 1.0, 3)
        size = random.uniform(*size_mm, 3)
        turn = rotation_from_vector(random.uniform(-1.5, 1.5, 3))
        value = attenuation * random.uniform(-0.7, 1.0)
        if np.hypot(place[0], place[1]) >= hollow and np.hypot(place[0], place[1]) <= 1.0:
            lumps.append(Additive(ellipsoid(place * np.asarray(spread_mm), size, turn), value))
    return lumps


def _ribs(random: np.random.Generator) -> Segments:
    """Thirteen pairs of ribs, a cortical shell about trabecular bone, sloping down to the front."""
    shell = 0.62 * (TISSUE.cortical - TISSUE.soft)
    parts = []
    for index in range(-6, 7):
        top = 24.0 * index + 12.0
        for side in (-1.0, 1.0):
            slope = 62.0 + random.normal(0.0, 3.0)
            angle = np.linspace(0.12, 2.55, 34)
            width = 150.0 - 0.0018 * (top - 20.0) ** 2
            x = side * (16.0 + (width - 16.0) * np.sin(angle) ** 0.9)
            y = 4.0 + 84.0 * np.cos(angle)
            z = top - slope * (angle / 2.55) ** 1.25 + random.normal(0.0, 1.0)
            curve = np.stack([x, y, np.broadcast_to(z, x.shape)], axis=1) * 1e-3
            bone, cartilage = curve[:29], curve[28:]
            parts.append(chain(bone, 5.4e-3, shell))
            parts.append(chain(bone, 4.3e-3, TISSUE.trabecular - TISSUE.soft - shell))
            parts.append(chain(cartilage, 5.0e-3, 3.0))
    return joined(parts)


def _airways() -> Segments:
    """Air in the trachea and the main bronchi; their tissue is the mediastinum's, so air subtracts it."""
    paths = (
        (((-3, 8, 190), (-3, 14, 100), (-3, 18, 62)), 8.0),
        (((-3, 18, 62), (-16, 20, 48), (-32, 20, 34)), 6.5),
        (((-3, 18, 62), (14, 22, 48), (36, 24, 36)), 5.6),
    )
    parts = []
    for points, radius in paths:
        curve = _smooth(np.asarray(points, dtype=np.float64), 14) * 1e-3
        parts.append(chain(curve, radius * 1e-3, -0.8 * TISSUE.soft))
    return joined(parts)


def _smooth(points: Array, samples: int) -> Array:
    """A quadratic Bézier curve through the first and last of three points, pulled to the middle one."""
    t = np.linspace(0.0, 1.0, samples)[:, None]
    return np.asarray((1 - t) ** 2 * points[0] + 2 * t * (1 - t) * points[1] + t**2 * points[2])


def _lung_vessels(random: np.random.Generator) -> Segments:
    """Branching trees from both hila, dividing until thinner than 0.6 mm; radii branch as Murray's law has them."""
    starts: list[Array] = []
    ends: list[Array] = []
    radii: list[float] = []
    for side, roots in ((-1.0, 11), (1.0, 11)):
        hilum = np.array([side * 40.0, 10.0, 12.0])
        for _ in range(roots):
            heading = random.normal(0.0, 1.0, 3) * np.array([0.45, 0.8, 1.0]) + np.array([side * 0.9, 0.0, -0.15])
            begin = hilum + random.normal(0.0, 6.0, 3)
            stack = [(begin, heading / np.linalg.norm(heading), random.uniform(2.4, 3.9))]
            while stack:
                place, direction, radius = stack.pop()
                length = random.uniform(5.0, 8.0) * radius**0.6
                pieces = max(2, int(length / 5.0))
                for _piece in range(pieces):
                    direction = direction + random.normal(0.0, 0.10, 3)
                    direction /= np.linalg.norm(direction)
                    target = place + direction * length / pieces
                    starts.append(place)
                    ends.append(target)
                    radii.append(radius)
                    place = target
                    radius *= 0.985
                # Out of the chest a vessel would lie over the wall.
                if abs(place[0] - side * 79.0) > 56.0 or abs(place[1]) > 76.0 or not -75.0 < place[2] < 130.0:
                    continue
                share = random.uniform(0.45, 0.8)
                for part in (share, 1.0 - share):
                    child = radius * part ** (1.0 / 2.3)
                    if child >= 0.6:
                        turned = direction + random.normal(0.0, 0.42, 3)
                        stack.append((place, turned / np.linalg.norm(turned), child))
    count = len(radii)
    attenuation = np.full(count, TISSUE.blood - TISSUE.lung)
    return Segments(np.asarray(starts) * 1e-3, np.asarray(ends) * 1e-3, np.asarray(radii) * 1e-3, attenuation)
