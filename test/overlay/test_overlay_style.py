"""The style that the parameters name."""

import pytest

from lasso_motion_ros.config.overlay import OverlayStyleConfig
from lasso_motion_ros.core.errors import ConfigurationError
from lasso_motion_ros.overlay.style import OverlayStyle, overlay_style


def test_colours_are_read_from_the_configuration():
    assert overlay_style(OverlayStyleConfig(static_colour="#0a10ff")).static == (10, 16, 255)
    for bad in ("red", "#12345", "#12345g", "112233x"):
        with pytest.raises(ConfigurationError, match="#rrggbb"):
            overlay_style(OverlayStyleConfig(static_colour=bad))


def test_the_default_style_is_that_of_the_parameters():
    assert overlay_style(OverlayStyleConfig()) == OverlayStyle()
