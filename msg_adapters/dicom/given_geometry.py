"""What a user says about the geometry of a DICOM pair where the objects are silent or wrong: a small YAML."""

from __future__ import annotations

from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any, Literal

from lasso_motion_ros.core.errors import ConfigurationError
from lasso_motion_ros.core.plain_yaml import read_plain_yaml
from lasso_motion_ros.core.suggestions import did_you_mean
from lasso_motion_ros.geometry.frames import PLANES, Plane

GEOMETRY_HELP = """\
geometry file (YAML): what the objects lack or have wrong, for both planes or one; every entry may be left out
  both:
    source_detector_mm: 1200          # instead of (0018,1110)
    source_isocentre_mm: 785          # instead of (0018,1111), (0018,9402)
    imager_pixel_spacing_mm: [0.2, 0.2]   # row, column; instead of (0018,1164)
    use_pixel_spacing: isocentre      # take (0028,0030) for it: it holds at the isocentre, or on the detector
    frame_time_ms: 66.7               # instead of (0018,1063), (0018,1065)
    patient_position: HFS             # the angles are those of a patient who lies head first, supine
    mirrored: true                    # the display as seen facing the patient; false: from behind
    increments: offsets               # (0018,1520): offsets from frame 1; steps: from frame to frame
  plane_a:
    isocentre_px: [511.5, 511.5]      # x, y of the pixel on which the isocentre is projected
    primary_deg: -30                  # RAO negative, LAO positive; of frame 1
    secondary_deg: 0                  # CAUD negative, CRAN positive; of frame 1
    rotation_deg: 0                   # of the picture against a heads-up display, clockwise
"""


@dataclass(frozen=True)
class GivenGeometry:
    """One plane's entries; None where nothing is said. What each means: `GEOMETRY_HELP`."""

    source_detector_mm: float | None = None
    source_isocentre_mm: float | None = None
    imager_pixel_spacing_mm: tuple[float, float] | None = None
    use_pixel_spacing: Literal["isocentre", "detector"] | None = None
    frame_time_ms: float | None = None
    patient_position: Literal["HFS"] | None = None
    mirrored: bool | None = None
    increments: Literal["offsets", "steps"] | None = None
    isocentre_px: tuple[float, float] | None = None
    primary_deg: float | None = None
    secondary_deg: float | None = None
    rotation_deg: float | None = None


_WORDS = {
    "use_pixel_spacing": ("isocentre", "detector"),
    "patient_position": ("HFS",),
    "increments": ("offsets", "steps"),
}
_PAIRS = ("imager_pixel_spacing_mm", "isocentre_px")
_POSITIVE = ("source_detector_mm", "source_isocentre_mm", "imager_pixel_spacing_mm", "frame_time_ms")


def read_geometry_file(path: Path | None) -> dict[Plane, GivenGeometry]:
    """Both planes' entries of a geometry file; without a file nothing is given.

    Raises:
        ConfigurationError: a file that cannot be read, an unknown key, or a value of another kind.
    """
    content = {} if path is None else read_plain_yaml(path)
    sections = ("both", *(f"plane_{plane}" for plane in PLANES))
    try:
        if not isinstance(content, dict):
            raise ConfigurationError(f"expected {', '.join(sections)}, found no such mapping")
        for section, entries in content.items():
            if section not in sections:
                raise ConfigurationError(f"unknown key {section!r} {did_you_mean(str(section), sections)}".rstrip())
            if not isinstance(entries, dict):
                raise ConfigurationError(f"{section}: expected a mapping, found {entries!r}")
        return {
            plane: GivenGeometry(**{**_entries(content, "both"), **_entries(content, f"plane_{plane}")})
            for plane in PLANES
        }
    except ConfigurationError as error:
        raise ConfigurationError(f"{path}: {error}") from error


def _entries(content: dict[str, Any], section: str) -> dict[str, Any]:
    known = [one.name for one in fields(GivenGeometry)]
    entries: dict[str, Any] = {}
    for key, value in content.get(section, {}).items():
        if key not in known:
            raise ConfigurationError(f"{section}: unknown key {key!r} {did_you_mean(str(key), known)}".rstrip())
        entries[key] = _value(f"{section}.{key}", key, value)
    return entries


def _value(place: str, key: str, value: Any) -> Any:
    if key in _WORDS:
        if value not in _WORDS[key]:
            raise ConfigurationError(f"{place}: expected {' or '.join(_WORDS[key])}, found {value!r}")
        return value
    if key == "mirrored":
        if not isinstance(value, bool):
            raise ConfigurationError(f"{place}: expected true or false, found {value!r}")
        return value
    values = value if key in _PAIRS and isinstance(value, list) else [value]
    numeric = [one for one in values if isinstance(one, (int, float)) and not isinstance(one, bool)]
    if len(numeric) != (2 if key in _PAIRS else 1) or not all(abs(one) < float("inf") for one in numeric):
        raise ConfigurationError(f"{place}: expected {'two numbers' if key in _PAIRS else 'a number'}, found {value!r}")
    if key in _POSITIVE and not all(one > 0 for one in numeric):
        raise ConfigurationError(f"{place}: must be above zero, found {value!r}")
    return tuple(float(one) for one in numeric) if key in _PAIRS else float(numeric[0])
