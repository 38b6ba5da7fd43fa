"""A ring that is proposed, with nothing but its place."""

from __future__ import annotations

import numpy as np
from support.breathing_lasso import pair
from support.lasso_inputs import CURVE

from lasso_motion_ros.geometry.frames import Seed
from lasso_motion_ros.initialisation.distinctness import Distinctness
from lasso_motion_ros.initialisation.judgement import Judgement
from lasso_motion_ros.initialisation.proposal import Proposal

JUDGEMENT = Judgement(1.0, 1.0, 1.0, 30.0, 1.0, 2.3, 20.0, 1.1, 40.0, 0.0, Distinctness(18.0, 20.0, 1.2))


def ring(x: float) -> Proposal:
    """At x metres from the drawn lasso."""
    clicks = np.zeros((6, 2))
    return Proposal(pair(0), Seed(clicks, clicks), CURVE + np.array([x, 0.0, 0.0]), JUDGEMENT, 0, "")
