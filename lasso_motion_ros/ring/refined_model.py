"""The ring's model from many pairs: its curve, and what it looks like along it.

Clicks and one pair tell the curve to a few tenths of a millimetre, worse where the dose is low, and an electrode that
lies half a millimetre beside the curve shows a third less of itself. Many pairs laid on each other tell it better. No
click holds the curve then; where along the wire it begins and ends is still what the clicks said.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from lasso_motion_ros.geometry.frames import Plane, Seed
from lasso_motion_ros.ring.detection import DetectionTuning
from lasso_motion_ros.ring.looks import Look, Looks
from lasso_motion_ros.ring.loop_model import LoopModel
from lasso_motion_ros.ring.seed_curves import TUNING, model_beside
from lasso_motion_ros.ring.seed_images import SeedImages
from lasso_motion_ros.ring.seed_template import SeedView, seed_template
from lasso_motion_ros.ring.strip import strip_along
from lasso_motion_ros.ring.template import RingTemplate, TemplateTuning
from lasso_motion_ros.ring.working_image import Image, WholeImages
from lasso_motion_ros.seeding.outlines import is_lasso_size

_NO_CLICKS = Seed(np.zeros((0, 2)), np.zeros((0, 2)))


def refined_model(
    model: LoopModel, looks: Looks, tuning: TemplateTuning, worth: DetectionTuning
) -> tuple[SeedView, RingTemplate] | None:
    """The model that many looks tell.

    None where they are too few, where the seed pair's side has been left, and where they show no lasso.

    Args:
        model: with which the ring was found in them.
        looks: at it.
        tuning: how the template is made and learned.
        worth: what the planes' evidence is worth.

    Returns:
        The seed pair with the new model, and the template that all looks make along its curve.
    """
    mean = looks.mean(model)
    if mean is None:
        return None
    images = SeedImages(mean, bright=model.bright)
    shifts = {plane: model.shift(plane, projection) for plane, projection in images.projections.items()}
    curve, log_odds = model_beside(model.points, images, shifts, _NO_CLICKS, 1.0, len(model.points))
    if log_odds < TUNING.smallest_log_odds or not is_lasso_size(curve.radius_mm):
        return None
    new = seed_template(curve, WholeImages(mean.frames), tuning, worth)[0].model
    # Each look by itself: what the mean shows stands out more than any pair will show.
    template = RingTemplate.of_many([_shown(look, new) for look in (looks.first, *looks.later)], tuning)
    return SeedView.of(new, WholeImages(looks.first.pair.frames), worth), template


def _shown(look: Look, model: LoopModel) -> tuple[Mapping[Plane, Image], Mapping[Plane, Image]]:
    """Per plane, the strip of a look along a model's curve, and the evidence there."""
    whole = WholeImages(look.pair.frames)
    strips, shown = {}, {}
    for plane, frame in look.pair.frames.items():
        points = look.moved(plane, model.points)
        image = whole.at(plane, points.mean(axis=0), model.shift(plane, frame.projection), bright=model.bright)
        along = strip_along(points, image.projection)
        strips[plane], shown[plane] = along.sample(image), image.evidence_at(along.pixels)
    return strips, shown
