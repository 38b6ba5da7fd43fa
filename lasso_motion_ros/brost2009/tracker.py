"""The published method's tracker: a model from the clicks, then features and registration for each pair."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from lasso_motion_ros.brost2009.features import distance_map
from lasso_motion_ros.brost2009.model import reconstruct_model
from lasso_motion_ros.brost2009.registration import PlaneDistances, register
from lasso_motion_ros.config.tracker import TrackerConfig
from lasso_motion_ros.core.errors import TrackingError
from lasso_motion_ros.geometry.frames import PLANES, Frame, FramePair, Plane, Seed
from lasso_motion_ros.geometry.transforms import apply, inverse
from lasso_motion_ros.seeding.outlines import is_bright, outlines, require_both_planes, require_lasso_size
from lasso_motion_ros.tracking.stages import Stages, no_stages
from lasso_motion_ros.tracking.tracker import TrackerState, TrackResult

Array = npt.NDArray[np.float64]


class Brost2009Tracker:
    """3-D ellipse from clicks, then rigid registration of it to Otsu-thresholded lines, pair by pair.

    As published it never says that it has lost the catheter: every pair with both planes gets a pose. A pair
    that lacks a plane gets none (LOST), since the method is defined on two views.

    Args:
        config: the parameters, of which those of the published method count.
        stages: told of each stage of the work on a pair.
    """

    def __init__(self, config: TrackerConfig, stages: Stages = no_stages) -> None:
        self._config, self._stages = config, stages
        self._bright = False
        self._model: Array | None = None  # (L, 3) at the seed's phase
        self._motion = np.eye(4)  # from the seed's phase to the last pair's
        self._reference = np.eye(4)  # from the seed's phase to the reference's
        self._reference_stamp_ns = 0
        self._stamp_ns = 0

    def initialise(self, pair: FramePair, seed: Seed) -> TrackResult:
        """Build the model from the clicks on `pair`; its motion is the identity, its phase the reference.

        Raises:
            SeedError: too few clicks, clicks outside the image, a loop that is not the size of a lasso, or a pair that
                lacks a plane.
            ReconstructionError: no 3-D ellipse explains the clicks.
        """
        projections = require_both_planes(pair)
        bright = is_bright(pair, seed, self._config)
        paths = outlines(pair, seed, self._config, bright=bright)
        found = reconstruct_model(projections, paths, self._config.model)
        require_lasso_size(1e3 * float(np.linalg.norm(found.ellipse.semi_major)))
        self._model = found.ellipse.points(self._config.model.points)
        self._bright = bright
        self._motion = self._reference = np.eye(4)
        self._reference_stamp_ns = self._stamp_ns = pair.stamp_ns
        return self._result(dict.fromkeys(PLANES, found.reprojection_px))

    def track(self, pair: FramePair) -> TrackResult:
        """Register the model to the next pair, starting from the last one's motion.

        Raises:
            TrackingError: no model yet.
        """
        if self._model is None:
            raise TrackingError("there is no model to track: seed the tracker first")
        self._stamp_ns = pair.stamp_ns
        if pair.missing:
            missing = pair.missing[0].upper()
            return TrackResult(
                stamp_ns=pair.stamp_ns,
                state=TrackerState.LOST,
                reason=f"plane {missing} is missing and the method needs both",
                motion=None,
                covariance=None,
                loop=None,
                reference_stamp_ns=self._reference_stamp_ns,
            )
        centre = apply(self._motion, self._model).mean(axis=0)
        with self._stages("features"):
            planes = []
            for frame in pair.frames.values():
                expected = frame.projection.project(centre)
                distances = distance_map(frame, expected, self._config.features, bright=self._bright)
                planes.append(PlaneDistances(frame.projection, distances))
        with self._stages("registration"):
            self._motion, residuals = register(self._model, self._motion, planes, self._config.registration)
        return self._result(dict(zip(PLANES, residuals, strict=True)))

    def prepare(self, frame: Frame) -> None:
        """Nothing: both planes are registered at once."""

    def learn(self) -> None:
        """Nothing: the model stays as it is."""

    def leave_out(self, pair: FramePair) -> None:
        """Nothing: each pair is looked at by itself."""

    def reset(self) -> None:
        """Forget model and motion."""
        self._model = None

    def reconfigure(self, config: TrackerConfig) -> None:
        """Go on with other tuning parameters; the model is kept."""
        self._config = config

    def set_reference(self) -> None:
        """Make the present phase the reference.

        Raises:
            TrackingError: no model yet.
        """
        if self._model is None:
            raise TrackingError("there is no motion to refer to: seed the tracker first")
        self._reference, self._reference_stamp_ns = self._motion, self._stamp_ns

    def _result(self, residual_px: dict[Plane, float]) -> TrackResult:
        model = self._model
        if model is None:
            raise TrackingError("there is no model to track: seed the tracker first")
        closed = np.vstack([model, model[:1]])
        return TrackResult(
            stamp_ns=self._stamp_ns,
            state=TrackerState.TRACKING,
            reason="",
            motion=self._motion @ inverse(self._reference),
            covariance=None,
            loop=apply(self._motion, closed),
            reference_stamp_ns=self._reference_stamp_ns,
            residual_px=residual_px,
        )
