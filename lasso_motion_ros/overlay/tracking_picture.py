"""The live picture of one plane: the image windowed for the eye, what is tracked in it, and the state in words."""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np
import numpy.typing as npt

from lasso_motion_ros.geometry.frames import Frame, UncalibratedFrame
from lasso_motion_ros.overlay.primitives import (
    WHITE,
    Colour,
    draw_loop,
    draw_text,
    fit_text,
    text_scale,
    text_size,
)
from lasso_motion_ros.overlay.windowing import RgbImage, grey_to_rgb, window_image
from lasso_motion_ros.tracking.tracker import TrackerState

Array = npt.NDArray[np.float64]

STATE_COLOURS: dict[TrackerState, Colour] = {
    TrackerState.INACTIVE: (170, 170, 170),
    TrackerState.WAITING_FOR_CALIBRATION: (120, 190, 255),
    TrackerState.WAITING_FOR_SEED: (120, 190, 255),
    TrackerState.TRACKING: (75, 224, 138),
    TrackerState.DEGRADED: (255, 176, 0),
    TrackerState.LOST: (255, 92, 80),
    TrackerState.DISPLACED: (255, 92, 80),
}
CLICK_COLOUR: Colour = (120, 190, 255)
PROPOSAL_COLOUR: Colour = (51, 230, 255)


def draw_tracking(
    frame: Frame | UncalibratedFrame,
    loop: Array | None,
    state: TrackerState | str,
    reason: str = "",
    *,
    clicks: Array | None = None,
    remark: str = "",
    proposed: Sequence[Array] = (),
) -> RgbImage:
    """One plane as `plane_x/tracking` shows it.

    Args:
        frame: image of any bit depth, with its geometry where that is known.
        loop: (N, 3) the catheter's curve now, world metres, or None. It is drawn only in a state that has a pose:
            an old curve would look like a result.
        state: the tracker's state.
        reason: why, in a few words; printed under the state.
        clicks: (M, 2) the user's clicks so far, pixels.
        remark: a further line under the reason.
        proposed: (N, 3) each, curves of rings that were found without clicks, world metres; drawn while there is
            no pose.

    Returns:
        (H, W, 3) uint8 RGB, of the image's size.
    """
    state = TrackerState(state)
    picture = grey_to_rgb(window_image(frame.pixels))
    colour = STATE_COLOURS[state]
    if loop is not None and state.has_pose and isinstance(frame, Frame):
        draw_loop(picture, frame.projection, loop, colour)
    if not state.has_pose and isinstance(frame, Frame):
        for curve in proposed:
            draw_loop(picture, frame.projection, curve, PROPOSAL_COLOUR)
    if clicks is not None:
        size = max(5, picture.shape[0] // 100)
        for x, y in np.rint(clicks[np.isfinite(clicks).all(axis=1)]).astype(int):
            cv2.drawMarker(picture, (int(x), int(y)), CLICK_COLOUR, cv2.MARKER_CROSS, size, 1, cv2.LINE_AA)
    _draw_state(picture, state, [line for line in (reason, remark) if line], colour)
    return picture


def _draw_state(picture: RgbImage, state: TrackerState, texts: list[str], colour: Colour) -> None:
    scale = text_scale(picture)
    large = 1.3 * scale
    words = state.value.replace("_", " ")
    margin = round(16 * scale) + 2
    word_width, word_height = text_size(words, large)
    lines = [fit_text(text, scale, picture.shape[1] - 3 * margin) for text in texts]
    width = max([word_width, *(text_size(line, scale)[0] for line in lines)]) + 2 * margin
    line_height = round(1.9 * text_size("Xg", scale)[1])
    height = word_height + 2 * margin + line_height * len(lines)
    # A darkened plate keeps words legible on lung without hiding what is under them.
    plate = picture[:height, :width]
    picture[:height, :width] = cv2.convertScaleAbs(plate, alpha=0.35)
    picture[:height, : max(3, margin // 3)] = colour
    draw_text(picture, words, (margin, margin + word_height), colour, large)
    for number, line in enumerate(lines, start=1):
        draw_text(picture, line, (margin, margin + word_height + number * line_height), WHITE, scale)
