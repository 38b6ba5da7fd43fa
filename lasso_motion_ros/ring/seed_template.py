"""The template of the seed pair, and where exactly each plane shows the ring there."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from lasso_motion_ros.geometry.frames import PLANES, Frame, Plane
from lasso_motion_ros.ring.alignment import RingPrior, align
from lasso_motion_ros.ring.detection import Detection, DetectionTuning
from lasso_motion_ros.ring.loop_model import LoopModel, offsets_of
from lasso_motion_ros.ring.strip import strip_along
from lasso_motion_ros.ring.template import RingTemplate, TemplateTuning
from lasso_motion_ros.ring.working_image import working_image

ROUNDS = 4
# The curve was fitted to this very pair: the ring neither turns nor stretches in it.
STILL = RingPrior(turn_rad=0.01, stretch=0.005)


def seed_template(
    model: LoopModel, frames: dict[Plane, Frame], tuning: TemplateTuning, worth: DetectionTuning
) -> tuple[LoopModel, RingTemplate, Detection]:
    """Build the template, and register it with the seed pair as with any other.

    Without that, what the template lies off in the seed pair would be a constant error of every later pose. The planes'
    electrodes come to lie on each other by it, too, so that the profile they share gets clearer from round to round.

    Args:
        model: the ring's curve from the clicks.
        frames: the seed pair's, both planes.
        tuning: how the template is made.
        worth: what the planes' evidence is worth.

    Returns:
        The model with its planes' offsets corrected, the template, and the ring as it is seen in the seed pair.
    """
    projections = {plane: frame.projection for plane, frame in frames.items()}
    shifts = {plane: model.shift(plane, projections[plane]) for plane in PLANES}
    for _ in range(ROUNDS):
        images = {
            plane: working_image(frames[plane], model.centre, bright=model.bright, shift=shifts[plane])
            for plane in PLANES
        }
        along = {plane: strip_along(model.points, image.projection) for plane, image in images.items()}
        strips = {plane: along[plane].sample(image) for plane, image in images.items()}
        shown = {plane: image.evidence_at(along[plane].pixels) for plane, image in images.items()}
        template = RingTemplate(strips, shown, tuning)
        seen = Detection(align(images, template, model.arms, dict.fromkeys(PLANES, model.centre), STILL), worth)
        for plane, fit in seen.alignment.planes.items():
            project = projections[plane].project
            shifts[plane] = shifts[plane] + np.asarray(project(fit.centre) - project(model.centre))
    return replace(model, offsets=offsets_of(shifts, projections, model.centre)), template, seen
