"""The template of the seed pair, and where exactly each plane shows the ring there."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from lasso_motion_ros.geometry.frames import PLANES, Plane
from lasso_motion_ros.motion.motion_model import Estimate
from lasso_motion_ros.ring.alignment import RingPrior, align
from lasso_motion_ros.ring.detection import Detection, DetectionTuning
from lasso_motion_ros.ring.loop_model import LoopModel, offsets_of
from lasso_motion_ros.ring.strip import strip_along
from lasso_motion_ros.ring.template import RingTemplate, TemplateTuning
from lasso_motion_ros.ring.working_image import WholeImages, WorkingImage

Array = npt.NDArray[np.float64]

ROUNDS = 4
# The curve was fitted to this very pair: the ring neither turns nor stretches in it.
STILL = RingPrior(turn_rad=0.01, stretch=0.005)
# About the ring, of the seed pair that is kept: an alignment in it goes no further.
KEPT_MM = 6.0


@dataclass(frozen=True, eq=False)
class SeedView:
    """What the seed pair shows about the ring, kept to be looked at again.

    All motion is told from where the ring lay in this one pair. What its noise has put the first template off by is an
    error of every later pose alike; the template that many pairs have made tells that place better.

    Attributes:
        model: the ring at the seed pair.
        images: both planes', about the ring.
        worth: what the planes' evidence is worth.
    """

    model: LoopModel
    images: dict[Plane, WorkingImage]
    worth: DetectionTuning

    @staticmethod
    def of(model: LoopModel, whole: WholeImages, worth: DetectionTuning) -> SeedView:
        """The seed pair, whose images are about the ring at least."""
        images = {}
        for plane, frame in whole.frames.items():
            shift = model.shift(plane, frame.projection)
            image = whole.at(plane, model.centre, shift, bright=model.bright).about(model.points, KEPT_MM)
            # Its own pixels: a part of the whole would keep the whole.
            images[plane] = replace(image, values=image.values.copy(), noise=image.noise.copy(), grey=image.grey.copy())
        return SeedView(model, images, worth)

    def displacement(self, template: RingTemplate) -> Estimate:
        """Where a template lies in the seed pair, from the model's place, and how well that is known."""
        at_home = dict.fromkeys(PLANES, self.model.centre)
        alignment = align(self.images, template, self.model.arms, at_home, STILL)
        precision, sum_ = np.zeros((3, 3)), np.zeros(3)
        for fit in alignment.planes.values():
            weight = np.linalg.inv(fit.covariance + self.worth.systematic_m**2 * np.eye(2))
            precision += fit.across.T @ weight @ fit.across
            sum_ += fit.across.T @ weight @ (fit.across @ (fit.centre - self.model.centre))
        covariance: Array = np.linalg.inv(precision).astype(np.float64)
        return Estimate(covariance @ sum_, covariance)


def seed_template(
    model: LoopModel, whole: WholeImages, tuning: TemplateTuning, worth: DetectionTuning
) -> tuple[SeedView, RingTemplate, Detection]:
    """Build the template, and register it with the seed pair as with any other.

    Without that, what the template lies off in the seed pair would be a constant error of every later pose. The planes'
    electrodes come to lie on each other by it, too, so that the profile they share gets clearer from round to round.

    Args:
        model: the ring's curve from the clicks.
        whole: the seed pair's, both planes.
        tuning: how the template is made.
        worth: what the planes' evidence is worth.

    Returns:
        The seed pair with the model, its planes' offsets corrected; the template; and the ring as it is seen there.
    """
    projections = {plane: frame.projection for plane, frame in whole.frames.items()}
    shifts = {plane: model.shift(plane, projections[plane]) for plane in PLANES}
    for _ in range(ROUNDS):
        images = {plane: whole.at(plane, model.centre, shifts[plane], bright=model.bright) for plane in PLANES}
        along = {plane: strip_along(model.points, image.projection) for plane, image in images.items()}
        strips = {plane: along[plane].sample(image) for plane, image in images.items()}
        shown = {plane: image.evidence_at(along[plane].pixels) for plane, image in images.items()}
        template = RingTemplate(strips, shown, tuning)
        seen = Detection(align(images, template, model.arms, dict.fromkeys(PLANES, model.centre), STILL), worth)
        for plane, fit in seen.alignment.planes.items():
            project = projections[plane].project
            shifts[plane] = shifts[plane] + np.asarray(project(fit.centre) - project(model.centre))
    model = replace(model, offsets=offsets_of(shifts, projections, model.centre))
    return SeedView.of(model, whole, worth), template, seen
