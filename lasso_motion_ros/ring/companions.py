"""Companions of the ring: what else in view moves with the heart, and so tells whether the ring is in its place.

A catheter in the coronary sinus, a lead or a clip moves with breath and beat much as the ring does. A ring that a hand
moves, or that slides along its vein, leaves them: even along the way of breathing, where its own past cannot tell a
slide from a deeper breath. Which of the things beside the ring move so is not known before, and is learned
(`plane_companions`).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from lasso_motion_ros.geometry.frames import FramePair, Plane
from lasso_motion_ros.geometry.projection import Projection
from lasso_motion_ros.ring.companion_patches import CompanionGrid, find_patches
from lasso_motion_ros.ring.companion_slide import CompanionSlide
from lasso_motion_ros.ring.detection import Detection
from lasso_motion_ros.ring.loop_model import LoopModel
from lasso_motion_ros.ring.plane_companions import CompanionTuning, PlaneCompanions, Sighting, is_same_view

Array = npt.NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class _Look:
    """A pair in which the companions were looked for.

    Attributes:
        time_s: of the pair, seconds.
        pair: its images.
        detection: where the ring was taken to be.
        sightings: per plane whose view is known.
    """

    time_s: float
    pair: FramePair
    detection: Detection
    sightings: Mapping[Plane, Sighting]

    @property
    def log_odds(self) -> float:
        """That the ring is in its place."""
        return sum(one.log_odds for one in self.sightings.values())


class Companions:
    """What moves with the heart beside the ring, in both planes.

    Args:
        tuning: what it is worth.

    Attributes:
        slide: how far the ring has slid from them by the last pair.
    """

    def __init__(self, tuning: CompanionTuning) -> None:
        self._tuning = tuning
        self._planes: dict[Plane, PlaneCompanions] = {}
        self._unlearned: _Look | None = None
        self._last: _Look | None = None
        self._last_view: dict[Plane, Projection] = {}
        self._last_s = 0.0
        self.slide = CompanionSlide.first(tuning.slide)

    def anew(self, time_s: float) -> Companions:
        """Those of a ring that belongs elsewhere from a time on: to be looked for, and learned, again."""
        anew = Companions(self._tuning)
        anew._last_s = time_s
        return anew

    def find(self, pair: FramePair, model: LoopModel, centres: Mapping[Plane, Array]) -> None:
        """Look for companions in planes that show the ring in its place.

        Args:
            pair: that shows it.
            model: the ring.
            centres: per plane, (3,) a world point on the ray to the ring's centre.
        """
        for plane, centre in centres.items():
            frame = pair.frames[plane]
            grid = CompanionGrid.of(frame, model.centre, bright=model.bright)
            seen = frame.projection.shifted(*model.shift(plane, frame.projection))
            ring = seen.project(model.points - model.centre + centre)
            patches = find_patches(frame, grid, ring, self._tuning.patches)
            self._planes[plane] = PlaneCompanions(patches, grid, centre, frame.projection, self._tuning)

    def look(
        self, time_s: float, pair: FramePair, detection: Detection, foretold: Array, *, is_believed: bool
    ) -> float:
        """Look for them in a pair.

        Args:
            time_s: of the pair, seconds.
            pair: its images.
            detection: where the ring is taken to be.
            foretold: (3,) where its centre was foretold to be, world metres.
            is_believed: it is believed to be there: then that tells how far it has slid.

        Returns:
            Natural logarithm of the odds that the ring is in its place; 0 where nothing is known to move with it.
        """
        sightings = {
            plane: self._planes[plane].look(pair.frames[plane], fit.centre, foretold)
            for plane, fit in detection.planes.items()
            if plane in self._planes and self._planes[plane].is_same_view(pair.frames[plane].projection)
        }
        if is_believed:
            shown = [one.slid for one in sightings.values() if one.slid is not None]
            self.slide, self._last_s = self.slide.after(time_s - self._last_s, shown), time_s
        self._last = _Look(time_s, pair, detection, sightings)
        return self._last.log_odds

    @property
    def deny(self) -> bool:
        """Whether they deny that the ring was in its place in the last pair that showed it."""
        return self._last is not None and self._last.log_odds < self._tuning.denied

    def accept(self) -> None:
        """Take the ring to have been in its place in the last look: it is to be learned from (`learn`)."""
        self._unlearned = self._last

    def take_centre(self, by: Array) -> None:
        """Take note that another point is the ring's centre from now on, (3,) m from the one before."""
        for plane in self._planes.values():
            plane.take_centre(by)

    def learn(self, model: LoopModel) -> None:
        """Learn from the last look that was accepted, if that is not done yet: that pair's answer does not wait for it.

        Args:
            model: the ring.
        """
        look, self._unlearned = self._unlearned, None
        if look is None:
            return
        tuning = self._tuning
        is_denied = look.log_odds < tuning.denied
        for plane, sighting in look.sightings.items():
            self._planes[plane].weigh(sighting, tuning.denied_step if is_denied else tuning.least_step)
            if not is_denied:
                self._planes[plane].learn(look.time_s, sighting)
        if is_denied:
            return
        for plane, fit in look.detection.planes.items():
            projection = look.pair.frames[plane].projection
            before, self._last_view[plane] = self._last_view.get(plane), projection
            if plane in self._planes and self._planes[plane].is_same_view(projection):
                continue
            if before is not None and is_same_view(before, projection, fit.centre, tuning):
                # The C-arm has come to rest in another view.
                self.find(look.pair, model, {plane: fit.centre})
