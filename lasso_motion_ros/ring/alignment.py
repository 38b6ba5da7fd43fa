"""Sub-pixel alignment of the ring's template with all planes at once (Gauss–Newton, after Lucas and Kanade).

Each plane has its own two-dimensional shift of the loop's centre, because the planes need not be exposed at
the same time nor calibrated to each other; what the planes share is the ring's own tilt, spin and size, held
by priors, since a small circle shows them only weakly.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt

from lasso_motion_ros.core.compiled import has_kernels
from lasso_motion_ros.geometry.frames import Plane
from lasso_motion_ros.geometry.transforms import rotation_from_vector
from lasso_motion_ros.ring.gauss_newton import TUNING, descend
from lasso_motion_ros.ring.loop_views import LoopViews, PlaneFit
from lasso_motion_ros.ring.strip import HALF_WIDTH
from lasso_motion_ros.ring.template import RingTemplate
from lasso_motion_ros.ring.working_image import PIXEL_MM, SOFT_REACH_MM, WorkingImage

Array = npt.NDArray[np.float64]


@dataclass(frozen=True)
class RingPrior:
    """How far the ring may tilt, spin and stretch by itself (standard deviations).

    Attributes:
        turn_rad: tilt about any axis, and spin.
        stretch: relative change of size.
    """

    turn_rad: float
    stretch: float


@dataclass(frozen=True, eq=False)
class Alignment:
    """The loop in one pair.

    Attributes:
        likeness: per plane that took part, its correlation relative to what is usual.
        turn: (3,) rotation vector of the ring about its centre since the seed pair, rad.
        stretch: natural logarithm of the ring's size relative to the seed pair.
        correlations: mean of the planes' correlations, look by look on the way.
        is_given_up: whether it was left before it was done, since no loop is there.
        views: the planes as last sampled; not looked at again.
        covariance: (N, N) of the parameters, prior included: planes' shifts, m, then turn, rad, and stretch.
    """

    likeness: dict[Plane, float]
    turn: Array
    stretch: float
    correlations: tuple[float, ...]
    is_given_up: bool
    views: LoopViews
    covariance: Array

    @property
    def turn_covariance(self) -> Array:
        """(3, 3) rad²."""
        return self.covariance[-4:-1, -4:-1]

    @property
    def centres(self) -> dict[Plane, Array]:
        """Per plane that took part, (3,) a world point on the ray on which the loop's centre was seen."""
        return dict(zip(self.likeness, self.views.centres, strict=True))

    @cached_property
    def planes(self) -> dict[Plane, PlaneFit]:
        """Fit of each plane that took part, worked out when asked for: most candidates are discarded unread."""
        return dict(zip(self.likeness, self.views.fits(self.covariance), strict=True))


def align(
    images: dict[Plane, WorkingImage],
    template: RingTemplate,
    arms: Array,
    starts: dict[Plane, Array],
    prior: RingPrior,
    turn: Array | None = None,
    stretch: float = 0.0,
) -> Alignment:
    """Align the ring's template with the images.

    Args:
        images: the planes that take part, one or two.
        template: what the ring looks like in them.
        arms: (L, 3) the loop's curve about its centre at the seed pair, metres.
        starts: per plane, (3,) the centre to start from, within about half a millimetre in that plane's image.
        prior: of the ring's own motion.
        turn: (3,) rotation vector to start from.
        stretch: logarithm of size to start from.
    """
    planes = tuple(images)
    centres = np.stack([starts[plane] for plane in planes])
    ring = np.array([*(np.zeros(3) if turn is None else turn), stretch])
    precision = np.array([prior.turn_rad] * 3 + [prior.stretch]) ** -2
    views: LoopViews
    if has_kernels():
        from lasso_motion_ros.ring.compiled_views import CompiledLoopViews

        views = CompiledLoopViews(images, template, centres)
        descent = views.descend(arms, ring, precision)
    else:
        views = LoopViews(images, template, centres)
        descent = descend(views, arms, ring, precision)
    return Alignment(
        likeness=dict(zip(planes, views.likeness.tolist(), strict=True)),
        turn=descent.ring[:3],
        stretch=float(descent.ring[3]),
        correlations=descent.correlations,
        is_given_up=descent.is_given_up,
        views=views,
        covariance=descent.covariance,
    )


def align_from_afar(
    images: dict[Plane, WorkingImage],
    template: RingTemplate,
    arms: Array,
    starts: dict[Plane, Array],
    prior: RingPrior,
    turn: Array,
    stretch: float,
) -> Alignment | None:
    """Align in blurred images first, from 0.8 mm and 9° off, say; then as `align` does, with the same arguments.

    Returns:
        The alignment, or None where the blurred images show no loop.
    """
    loose = RingPrior(TUNING.afar_prior * prior.turn_rad, TUNING.afar_prior * prior.stretch)
    ring = arms @ rotation_from_vector(turn).T * np.exp(stretch)
    # An alignment may sample beside the curve, shift it and turn it in every step, and what it samples is blurred.
    farthest_mm = TUNING.largest_step_mm + TUNING.largest_turn_rad * 1e3 * float(np.linalg.norm(ring, axis=1).max())
    reach_mm = HALF_WIDTH * PIXEL_MM + TUNING.iterations * farthest_mm + SOFT_REACH_MM
    soft = {plane: image.about(starts[plane] + ring, reach_mm).softened() for plane, image in images.items()}
    first = align(soft, template.softened(), arms, starts, loose, turn, stretch)
    if first.is_given_up:
        return None
    return align(
        images,
        template,
        arms,
        first.centres,
        prior,
        first.turn,
        first.stretch,
    )
