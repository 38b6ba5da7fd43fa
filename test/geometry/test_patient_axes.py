"""Directions in the patient, and a C-arm's angles by their clinical names."""

from __future__ import annotations

import numpy as np
import pytest

from lasso_motion_ros.core.errors import ConfigurationError
from lasso_motion_ros.geometry.carm import carm_projection
from lasso_motion_ros.geometry.patient_axes import (
    SUPINE,
    axis_names,
    gantry_angles,
    gantry_words,
    patient_axes,
    shows_supine_patient,
)
from lasso_motion_ros.geometry.projection import Projection

LPS = patient_axes(SUPINE)


def view(lao_deg: float, cranial_deg: float = 0.0, **other: object) -> Projection:
    return carm_projection(
        np.radians(lao_deg), np.radians(cranial_deg),
        source_detector_m=1.2, source_object_m=0.78, pixel_size_m=0.3e-3, width=512, height=512, **other,
    )  # fmt: skip


def test_lps_turns_to_ras_about_the_long_axis() -> None:
    np.testing.assert_array_equal(patient_axes("LPS"), np.diag([-1.0, -1.0, 1.0]))
    np.testing.assert_array_equal(patient_axes("ras"), np.eye(3))
    np.testing.assert_array_equal(patient_axes("SLP") @ [1, 0, 0], [0, 0, 1])
    assert axis_names("LPS") == ("left", "posterior", "head")
    assert axis_names("ilp") == ("feet", "left", "posterior")


@pytest.mark.parametrize(("axes", "words"), [("LAS", "left-handed"), ("LLS", "a letter each"), ("LP", "found 'LP'")])
def test_axes_that_are_none_are_refused(axes: str, words: str) -> None:
    with pytest.raises(ConfigurationError, match=words):
        patient_axes(axes)


@pytest.mark.parametrize(
    ("angles", "words"),
    [((0, 0), "AP"), ((-30, 5), "RAO 30° CRAN 5°"), ((90, 0), "LAO 90°"), ((45.4, -20.6), "LAO 45° CAUD 21°"),
     ((0.3, 20), "AP CRAN 20°"), ((-0.4, -0.4), "AP")],
)  # fmt: skip
def test_a_view_is_named_as_in_the_lab(angles: tuple[float, float], words: str) -> None:
    assert gantry_words(view(*angles), LPS) == words


def test_neither_mirror_nor_scale_nor_another_world_changes_the_angles() -> None:
    expected = np.radians([-30.0, 12.0])
    mirrored, plain = view(-30, 12), view(-30, 12, mirrored=False)
    scaled = Projection(-3.0 * mirrored.matrix, 512, 512)
    turned = Projection(mirrored.matrix @ np.diag([-1.0, -1.0, 1.0, 1.0]), 512, 512)  # of a world in RAS
    for projection, axes in ((mirrored, "LPS"), (plain, "LPS"), (scaled, "LPS"), (turned, "RAS")):
        np.testing.assert_allclose(gantry_angles(projection, patient_axes(axes)), expected, atol=1e-12)


@pytest.mark.parametrize("pair", [(-30, 60), (0, 90), (-45, 45), (-60, 30), (-10, 100), (-10, 80)])
def test_the_usual_pairs_are_a_supine_patients_either_way_round(pair: tuple[float, float]) -> None:
    a, b = view(pair[0], 10), view(pair[1], -10)
    assert shows_supine_patient((a, b), LPS)
    assert shows_supine_patient((b, a), LPS)


@pytest.mark.parametrize("axes", ["RAS", "ALS", "PRS", "SLP", "LIP"])
def test_in_a_world_of_other_axes_they_are_not(axes: str) -> None:
    """What LPS would make of it: a patient on the belly, or on the side, or with the head somewhere else."""
    turn = np.eye(4)
    turn[:3, :3] = LPS.T @ patient_axes(axes)
    a, b = (Projection(view(lao).matrix @ turn, 512, 512) for lao in (-30, 60))
    assert not shows_supine_patient((a, b), LPS)
    assert shows_supine_patient((a, b), patient_axes(axes))
    assert gantry_words(a, patient_axes(axes)) == "RAO 30°"
