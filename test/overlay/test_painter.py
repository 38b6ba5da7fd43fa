"""The overlay picture: what stands where, in which colour and words."""

from dataclasses import replace

import numpy as np
import pytest
from support.rendering_inputs import ellipsoid_mesh, views

from lasso_motion_ros.config.overlay import OverlayStyleConfig
from lasso_motion_ros.core.errors import ConfigurationError
from lasso_motion_ros.geometry import transforms
from lasso_motion_ros.overlay import drawing
from lasso_motion_ros.overlay.painter import (
    LOOP_COLOUR,
    OverlayPainter,
    draw_overlay,
    static_banner,
)
from lasso_motion_ros.overlay.style import OverlayStyle, overlay_style
from lasso_motion_ros.overlay.windowing import window_image, window_limits

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
    picture = draw_overlay(grey_image(), VIEW, MESH, SHIFT)
    assert picture.shape == (512, 512, 3)
    assert picture.dtype == np.uint8
    assert tint(picture, centre_of(SHIFT), STYLE.compensated) > 8
    assert 1 < tint(picture, centre_of(np.eye(4)), STYLE.static) < tint(picture, centre_of(SHIFT), STYLE.compensated)
    # Elsewhere the film is untouched.
    np.testing.assert_array_equal(
        picture[100, 100:160], np.repeat(window_image(grey_image())[100, 100:160, None], 3, 1)
    )


def test_the_static_place_can_be_left_out():
    picture = draw_overlay(grey_image(), VIEW, MESH, SHIFT, style=replace(STYLE, show_static=False))
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
    assert static_banner("LOST: no lasso") == "STATIC OVERLAY – motion LOST: no lasso"
    assert static_banner("") == "STATIC OVERLAY – no motion"


def test_a_remark_is_printed_beside_a_motion():
    plain, remarked = (draw_overlay(grey_image(), VIEW, MESH, SHIFT, s) for s in ("", "DEGRADED: one plane only"))
    changed = (plain != remarked).any(axis=-1)
    assert changed.sum() > 50
    assert np.flatnonzero(changed.any(axis=1)).max() < 40


def test_twelve_bits_look_as_eight_do():
    eight = draw_overlay(grey_image(np.uint8), VIEW, MESH, SHIFT).astype(int)
    twelve = draw_overlay(grey_image(np.uint16), VIEW, MESH, SHIFT).astype(int)
    assert np.abs(eight - twelve).max() <= 3


def test_the_loop_is_drawn_where_it_projects():
    angle = np.linspace(0.0, 2.0 * np.pi, 64)
    loop = 0.03 * np.stack([np.cos(angle), 0.0 * angle, np.sin(angle)], axis=1)
    picture = draw_overlay(grey_image(), VIEW, MESH, SHIFT, loop=loop)
    for point in VIEW.project(loop[::8]):
        x, y = np.rint(point).astype(int)
        assert max(tint(picture, (x + dx, y), LOOP_COLOUR) for dx in (-1, 0, 1)) > 40


@pytest.mark.parametrize(
    ("drawing", "rim", "inside"), [("outline", True, False), ("fill", False, True), ("both", True, True)]
)
def test_drawing_styles(drawing, rim, inside):
    style = overlay_style(OverlayStyleConfig(drawing=drawing, show_static=False))
    picture = draw_overlay(grey_image(), VIEW, MESH, SHIFT, style=style)
    centre = centre_of(SHIFT)
    assert (tint(picture, centre, style.compensated) > 5) == inside
    # Strongest tint on the way out from the centre.
    strongest = max(tint(picture, centre + np.array([0.0, d]), style.compensated) for d in range(20, 60))
    assert (strongest > 60) == rim


def test_a_painter_that_keeps_its_static_layer_draws_the_same():
    painter = OverlayPainter(MESH)
    other = views()["oblique"]
    painter.draw(grey_image(), VIEW, SHIFT)
    painter.draw(grey_image(), other, SHIFT)
    for view in (VIEW, other):
        for motion in (SHIFT, None):
            expected = draw_overlay(grey_image(), view, MESH, motion, "LOST")
            np.testing.assert_array_equal(painter.draw(grey_image(), view, motion, "LOST"), expected)
    painter.style = replace(STYLE, fill=False)
    expected = draw_overlay(grey_image(), VIEW, MESH, None, style=painter.style)
    np.testing.assert_array_equal(painter.draw(grey_image(), VIEW, None), expected)


def test_a_gantry_that_moves_for_ever_keeps_memory_bounded():
    painter = OverlayPainter(MESH)
    for shift in range(30):
        painter.draw(grey_image(), VIEW.shifted(shift, 0), SHIFT)
    assert len(painter._still) <= 8


def test_the_picture_is_the_same_every_time():
    one, two = (draw_overlay(grey_image(), VIEW, MESH, SHIFT, "DEGRADED") for _ in range(2))
    np.testing.assert_array_equal(one, two)


def test_colours_are_read_from_the_configuration():
    assert overlay_style(OverlayStyleConfig(static_colour="#0a10ff")).static == (10, 16, 255)
    for bad in ("red", "#12345", "#12345g", "112233x"):
        with pytest.raises(ConfigurationError, match="#rrggbb"):
            overlay_style(OverlayStyleConfig(static_colour=bad))


def test_the_default_style_is_that_of_the_parameters():
    assert overlay_style(OverlayStyleConfig()) == OverlayStyle()


def test_windowing_spans_black_to_white_and_ignores_single_pixels():
    image = np.tile(np.linspace(1000, 3000, 256).astype(np.uint16), (256, 1))
    image[0, 0], image[0, 1] = 0, 65535
    low, high = window_limits(image)
    assert 1000 <= low < 1030
    assert 2970 < high <= 3000
    shown = window_image(image)
    assert shown.dtype == np.uint8
    assert shown[5, 0] == 0
    assert shown[5, -1] == 255
    # The middle of the window is mid-grey, by hand: (2000 − low) / (high − low) · 255.
    assert shown[5, 128] == pytest.approx((image[5, 128] - low) / (high - low) * 255.0, abs=1.0)


def test_windowing_survives_a_flat_image_and_given_limits():
    assert window_image(np.full((20, 20), 77, np.uint8)).max() == 0
    np.testing.assert_array_equal(
        window_image(np.array([[0, 50, 100, 200]], np.uint8), (50.0, 150.0)), [[0, 0, 128, 255]]
    )


def test_words_fit_the_picture_and_unusual_characters_become_plain():
    long = "a reason that goes on " * 10
    line = drawing.fit_text(long, 0.5, 300)
    assert line.endswith("...")
    assert drawing.text_size(line, 0.5)[0] <= 300
    assert drawing.text_size("±2° – 3 mm…", 0.5) == drawing.text_size("+/-2 deg - 3 mm...", 0.5)
    picture = np.zeros((64, 256, 3), np.uint8)
    drawing.draw_curve(picture, np.array([[np.nan, 0.0], [1e12, 5.0]]), (255, 0, 0))
    assert not picture.any()
