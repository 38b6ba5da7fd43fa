"""The page's words for directions in the patient: where the axes of the motion point, and where the detectors stand."""

from __future__ import annotations

from typing import Any

from lasso_motion_ros.config.tracker import POSTURES
from lasso_motion_ros.config.web import AUTO_AXES, UNKNOWN_AXES
from lasso_motion_ros.geometry.frames import PLANES, Plane
from lasso_motion_ros.geometry.patient_axes import SUPINE, axis_names, gantry_words, patient_axes, shows_supine_patient
from lasso_motion_ros.geometry.projection import Projection


class PatientView:
    """Names directions, as far as the world's axes are known.

    Args:
        axes: where in the patient the world's axes point, as in `patient_axes`; `auto`: as a supine patient's, where
            both calibrations look like it; `unknown`.

    Attributes:
        posture: how the patient lies, as the tracker was told; of another than a supine patient `auto` knows nothing.

    Raises:
        ConfigurationError: axes that are none.
    """

    def __init__(self, axes: str) -> None:
        self._axes = axes
        self._given = None if axes in (AUTO_AXES, UNKNOWN_AXES) else patient_axes(axes)
        self._supine = patient_axes(SUPINE)
        self._projections: dict[Plane, Projection] = {}
        self.posture = POSTURES[0]

    def take(self, plane: Plane, projection: Projection) -> None:
        """Take a plane's newest calibration."""
        self._projections[plane] = projection

    def words(self) -> dict[str, Any]:
        """`axes`: where +x, +y and +z point, or None; `angles`: of each plane, or None. Ready for JSON."""
        letters = self._known()
        if letters is None:
            return {"axes": None, "angles": dict.fromkeys(PLANES)}
        axes = patient_axes(letters)
        angles = {plane: gantry_words(projection, axes) for plane, projection in self._projections.items()}
        return {"axes": axis_names(letters), "angles": {plane: angles.get(plane) for plane in PLANES}}

    def _known(self) -> str | None:
        if self._given is not None:
            return self._axes
        if self._axes == UNKNOWN_AXES or self.posture != POSTURES[0] or len(self._projections) < len(PLANES):
            return None
        both = self._projections["a"], self._projections["b"]
        return SUPINE if shows_supine_patient(both, self._supine) else None
