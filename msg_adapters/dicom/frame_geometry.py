"""The geometry of one frame, whichever kind of object it was read from, and the projection that it gives."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from lasso_motion_ros.core.errors import RecordingError
from lasso_motion_ros.geometry.carm import carm_projection
from lasso_motion_ros.geometry.projection import Projection
from msg_adapters.dicom.objects import tag_name

# No C-arm is smaller or larger: outside of it a unit is wrong.
SOURCE_DETECTOR_MM = (300.0, 2000.0)


@dataclass(frozen=True)
class FrameGeometry:
    """One frame.

    Attributes:
        primary_deg: of the detector, RAO negative, LAO positive.
        secondary_deg: CAUD negative, CRAN positive.
        rotation_deg: of the picture against a heads-up display, clockwise.
        source_detector_mm: SID.
        source_isocentre_mm: SOD.
        spacing_mm: (row, column): between rows and between columns of the picture, on the detector.
        isocentre_px: (x, y) of the pixel on which the iso-centre is projected.
        mirrored: the display is as seen facing the patient.
        table_mm: (3,) of the table top towards the patient's left, back and head, against the reference position.
    """

    primary_deg: float
    secondary_deg: float
    rotation_deg: float
    source_detector_mm: float
    source_isocentre_mm: float
    spacing_mm: tuple[float, float]
    isocentre_px: tuple[float, float]
    mirrored: bool
    table_mm: tuple[float, float, float]

    def projection(self, width: int, height: int, table_reference_mm: tuple[float, float, float]) -> Projection:
        """From metres in the world, which is fixed to the table top, to the picture's pixels.

        Args:
            width: of the picture, pixels.
            height: of the picture, pixels.
            table_reference_mm: where the table is while world and iso-centre coincide.

        Raises:
            RecordingError: distances that no C-arm has.
        """
        low, high = SOURCE_DETECTOR_MM
        if not low <= self.source_detector_mm <= high:
            raise RecordingError(
                f"{tag_name('DistanceSourceToDetector')}: expected {low:g} to {high:g} mm,"
                f" found {self.source_detector_mm:g}"
            )
        if not 0.2 * self.source_detector_mm <= self.source_isocentre_mm < self.source_detector_mm:
            raise RecordingError(
                f"source to iso-centre: expected less than the {self.source_detector_mm:g} mm to the detector, and not"
                f" less than a fifth of it, found {self.source_isocentre_mm:g} mm"
            )
        moved = 1e-3 * (np.asarray(self.table_mm) - np.asarray(table_reference_mm))
        row, column = self.spacing_mm
        return carm_projection(
            np.radians(self.primary_deg),
            np.radians(self.secondary_deg),
            source_detector_m=1e-3 * self.source_detector_mm,
            source_object_m=1e-3 * self.source_isocentre_mm,
            pixel_size_m=(1e-3 * column, 1e-3 * row),
            width=width,
            height=height,
            mirrored=self.mirrored,
            iso_centre=-moved,
            roll_rad=np.radians(self.rotation_deg),
            principal_point=self.isocentre_px,
        )
