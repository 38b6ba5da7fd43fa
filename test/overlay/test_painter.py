"""The overlay picture: what stands where, in which colour and words."""

from dataclasses import replace

import numpy as np
import pytest
from support.rendering_inputs import ellipsoid_mesh, views

from lasso_motion_ros.config.overlay import OverlayStyleConfig
from lasso_motion_ros.geometry import transforms
from lasso_motion_ros.overlay.painter import (
    LOOP_COLOUR,
    OverlayPainter,
    static_banner,
)
from lasso_motion_ros.overlay.style import OverlayStyle, overlay_style
from lasso_motion_ros.overlay.windowing import window_image

VIEW = views()["plain"]
MESH = ellipsoid_mesh((0.012, 0.010, 0.011), rows=80, columns=41)
SHIFT = transforms.rigid((0.0, 0.0, 0.0), (0.03, 0.0, 0.01))
STYLE = OverlayStyle()


def grey_image(dtype=np.uint8):
    # A ramp across the whole window, so that windowing leaves mid-grey in the middle.
    ramp = np.linspace(0.2, 0.8, 512) * (4095 if dtype == np.uint16 else 255)
    return np.broadcast_to(ramp, (512, 512)).astype(dtype)


def tint(picture, at, colour):
    """How far a pixel is from grey, along a colour's own hue: 0 for grey, positive for that colour."""
    x, y = np.rint(at).astype(int)
    pixel = picture[y, x].astype(float)
    hue = np.array(colour) - np.mean(colour)
    return float((pixel - pixel.mean()) @ hue / np.linalg.norm(hue))


def centre_of(motion):
    return VIEW.project(transforms.apply(motion, np.zeros(3)))


def test_compensated_and_static_places_have_their_own_colours():
    picture = OverlayPainter(MESH).draw(grey_image(), VIEW, SHIFT)
    assert picture.shape == (512, 512, 3)
    assert picture.dtype == np.uint8
    assert tint(picture, centre_of(SHIFT), STYLE.compensated) > 8
    assert 1 < tint(picture, centre_of(np.eye(4)), STYLE.static) < tint(picture, centre_of(SHIFT), STYLE.compensated)
    # Elsewhere the film is untouched.
    np.testing.assert_array_equal(
        picture[100, 100:160], np.repeat(window_image(grey_image())[100, 100:160, None], 3, 1)
    )


def test_the_static_place_can_be_left_out():
    picture = OverlayPainter(MESH, replace(STYLE, show_static=False)).draw(grey_image(), VIEW, SHIFT)
    assert tint(picture, centre_of(np.eye(4)), STYLE.static) == pytest.approx(0.0, abs=1e-9)


def test_without_motion_the_picture_warns_and_shows_the_static_place_only():
    loop = MESH.vertices[:80]
    painter = OverlayPainter(MESH)
    compensated = painter.draw(grey_image(), VIEW, SHIFT)
    picture = painter.draw(grey_image(), VIEW, None, "LOST: too few electrodes are seen", loop=loop)
    np.testing.assert_array_equal(picture[2, 2], STYLE.warning)
    np.testing.assert_array_equal(picture[300, 0], STYLE.warning)
    assert tint(picture, centre_of(np.eye(4)), STYLE.warning) > 8
    # Nothing is left of the compensated place, nor of the loop.
    x, y = np.rint(centre_of(SHIFT)).astype(int)
    assert np.ptp(picture[y, x]) == 0
    assert not (picture == LOOP_COLOUR).all(axis=-1).any()
    assert (compensated[:30] != picture[:30]).any()
    # Dark words stand on the bar.
    assert (picture[:30].max(axis=-1) < 60).sum() > 100


def test_the_banner_says_why():
    assert static_banner("LOST: no lasso") == "STATIC OVERLAY – LOST: no lasso"
    assert static_banner("") == "STATIC OVERLAY – no motion"


def test_a_remark_is_printed_beside_a_motion():
    plain, remarked = (
        OverlayPainter(MESH).draw(grey_image(), VIEW, SHIFT, s) for s in ("", "DEGRADED: one plane only")
    )
    changed = (plain != remarked).any(axis=-1)
    assert changed.sum() > 50
    assert np.flatnonzero(changed.any(axis=1)).max() < 40


def test_twelve_bits_look_as_eight_do():
    eight = OverlayPainter(MESH).draw(grey_image(np.uint8), VIEW, SHIFT).astype(int)
    twelve = OverlayPainter(MESH).draw(grey_image(np.uint16), VIEW, SHIFT).astype(int)
    assert np.abs(eight - twelve).max() <= 3


def test_the_loop_is_drawn_where_it_projects():
    angle = np.linspace(0.0, 2.0 * np.pi, 64)
    loop = 0.03 * np.stack([np.cos(angle), 0.0 * angle, np.sin(angle)], axis=1)
    picture = OverlayPainter(MESH).draw(grey_image(), VIEW, SHIFT, loop=loop)
    for point in VIEW.project(loop[::8]):
        x, y = np.rint(point).astype(int)
        assert max(tint(picture, (x + dx, y), LOOP_COLOUR) for dx in (-1, 0, 1)) > 40


@pytest.mark.parametrize(
    ("drawing", "rim", "inside"), [("outline", True, False), ("fill", False, True), ("both", True, True)]
)
def test_drawing_styles(drawing, rim, inside):
    style = overlay_style(OverlayStyleConfig(drawing=drawing, show_static=False))
    picture = OverlayPainter(MESH, style).draw(grey_image(), VIEW, SHIFT)
    centre = centre_of(SHIFT)
    assert (tint(picture, centre, style.compensated) > 5) == inside
    # Strongest tint on the way out from the centre.
    strongest = max(tint(picture, centre + np.array([0.0, d]), style.compensated) for d in range(20, 60))
    assert (strongest > 60) == rim


def test_a_painter_that_keeps_its_static_mask_draws_the_same():
    painter = OverlayPainter(MESH)
    other = views()["oblique"]
    painter.draw(grey_image(), VIEW, SHIFT)
    painter.draw(grey_image(), other, SHIFT)
    for view in (VIEW, other):
        for motion in (SHIFT, None):
            expected = OverlayPainter(MESH).draw(grey_image(), view, motion, "LOST")
            np.testing.assert_array_equal(painter.draw(grey_image(), view, motion, "LOST"), expected)
    painter.style = replace(STYLE, fill=False)
    expected = OverlayPainter(MESH, painter.style).draw(grey_image(), VIEW, None)
    np.testing.assert_array_equal(painter.draw(grey_image(), VIEW, None), expected)


def test_a_gantry_that_moves_for_ever_keeps_memory_bounded():
    painter = OverlayPainter(MESH)
    for shift in range(30):
        painter.draw(grey_image(), VIEW.shifted(shift, 0), SHIFT)
    assert len(painter._still) <= 8


def test_the_picture_is_the_same_every_time():
    one, two = (OverlayPainter(MESH).draw(grey_image(), VIEW, SHIFT, "DEGRADED") for _ in range(2))
    np.testing.assert_array_equal(one, two)
