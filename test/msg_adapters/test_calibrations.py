"""CameraInfo and projection: what is honoured, what is refused, each with a message that names the field."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from support.message_inputs import MESSAGES, projection

from lasso_motion_ros.core.errors import MessageError
from lasso_motion_ros.geometry.carm import carm_projection
from msg_adapters.calibrations import decode_camera_info, encode_camera_info

# f = 1000 px, principal point (50, 40), looking along +z from 0.8 m before the origin.
HAND = np.array([[1000.0, 0.0, 50.0, 40.0], [0.0, 1000.0, 40.0, 32.0], [0.0, 0.0, 1.0, 0.8]])
ROTATED = projection("a").matrix


def info(matrix: Any = HAND, **fields: Any) -> Any:
    standard = {"width": 100, "height": 80, "p": np.asarray(matrix, dtype=float).reshape(-1)}
    return MESSAGES.make("sensor_msgs/msg/CameraInfo", standard | fields)


def roi(x: int, y: int, width: int, height: int) -> dict[str, int]:
    return {"x_offset": x, "y_offset": y, "width": width, "height": height}


def test_hand_worked_projection() -> None:
    decoded = decode_camera_info(info(), (80, 100))
    assert decoded.source == pytest.approx([0.0, 0.0, -0.8])
    # 8 mm right and 4 mm down at 0.8 m: 1000 · 0.008 / 0.8 = 10 px and 5 px from the principal point.
    assert decoded.project(np.array([0.008, 0.004, 0.0])) == pytest.approx([60.0, 45.0])


@pytest.mark.parametrize("scale", [1.0, -1.0, 3e-7, -2e5])
@pytest.mark.parametrize("mirrored", [True, False])
def test_scale_and_sign_mean_nothing(scale: float, mirrored: bool) -> None:
    view = carm_projection(
        0.4,
        -0.3,
        source_detector_m=1.2,
        source_object_m=0.8,
        pixel_size_m=2e-4,
        width=100,
        height=80,
        mirrored=mirrored,
    )
    decoded = decode_camera_info(info(scale * view.matrix))
    assert decoded.matrix == pytest.approx(view.matrix)


@pytest.mark.parametrize("mirrored", [True, False])
def test_what_is_encoded_decodes_and_k_and_r_agree_with_p(mirrored: bool) -> None:
    view = carm_projection(
        -0.5,
        0.2,
        source_detector_m=1.2,
        source_object_m=0.8,
        pixel_size_m=2e-4,
        width=100,
        height=80,
        mirrored=mirrored,
    )
    message = MESSAGES.make("sensor_msgs/msg/CameraInfo", encode_camera_info(view, {}))
    assert decode_camera_info(message, (80, 100)).matrix == pytest.approx(view.matrix)
    product = message.k.reshape(3, 3) @ message.r.reshape(3, 3)
    assert product / np.linalg.norm(product[2]) == pytest.approx(view.matrix[:, :3])
    assert np.linalg.det(message.r.reshape(3, 3)) == pytest.approx(1.0)


def test_binning_keeps_pixel_centres() -> None:
    decoded = decode_camera_info(info(binning_x=2, binning_y=4), (20, 50))
    # Full pixels 10 and 11 are binned pixel 5: its centre is at 10.5.
    point = np.array([(10.5 - 50) * 0.8e-3, (9.5 - 40) * 0.8e-3, 0.0])
    assert decoded.project(point) == pytest.approx([5.0, 2.0])


def test_region_of_interest_shifts_and_binning_goes_on_top() -> None:
    point = np.array([(30.5 - 50) * 0.8e-3, (26.5 - 40) * 0.8e-3, 0.0])
    decoded = decode_camera_info(info(roi=roi(20, 10, 60, 40)), (40, 60))
    assert decoded.project(point) == pytest.approx([10.5, 16.5])
    decoded = decode_camera_info(info(roi=roi(20, 10, 60, 40), binning_x=2, binning_y=2), (20, 30))
    assert decoded.project(point) == pytest.approx([5.0, 8.0])


@pytest.mark.parametrize(
    ("message", "text"),
    [
        (info(d=np.array([0.0, -0.2])), "d: expected all zero"),
        (info(d=np.array([np.nan])), "d: expected all zero"),
        (info(np.zeros(12)), "p: expected a projection matrix, found all zero"),
        (info(np.where(HAND == 40.0, np.nan, HAND)), "p: expected 12 finite values"),
        (info(np.where(HAND == 40.0, np.inf, HAND)), "p: expected 12 finite values"),
        (info(ROTATED * [[1], [0], [1]]), "p: the projection matrix is singular"),
        (info(ROTATED[[0, 2, 2]]), "p: the projection matrix is singular"),
        (info(HAND * [1, 1, 1, 1000]), "found 800 m; the matrix looks like millimetres, metres are expected"),
        (info(ROTATED * [1, 1, 1, 100]), "found 78.5 m; the matrix looks like centimetres"),
        (info(HAND * [1, 1, 1, 5]), "p: expected the source 0.3 to 2 m from the world origin, found 4 m"),
        (info(HAND * [1, 1, 1, 0.1]), "found 0.08 m"),
        (info(np.hstack([HAND[:, :3], [[-120.0], [0], [0]]])), "p: a stereo-style matrix"),
        (info(-2 * np.hstack([HAND[:, :3], [[-120.0], [0], [0]]])), "p: a stereo-style matrix"),
        (info(np.hstack([HAND[:, :3], np.zeros((3, 1))])), "p: a plain camera matrix"),
        (info(width=0), "width, height: expected 1 to 8192"),
        (info(height=100_000), "width, height: expected 1 to 8192"),
        (info(roi=roi(50, 0, 60, 80)), "roi: expected a region inside 100×80, found 60×80 at (50, 0)"),
        (info(roi=roi(5, 0, 0, 0)), "roi: expected a region"),
        (info(binning_x=200), "binning_x, binning_y"),
    ],
)
def test_refusals_name_the_field_and_what_was_expected(message: Any, text: str) -> None:
    with pytest.raises(MessageError) as caught:
        decode_camera_info(message)
    assert text in str(caught.value)


def test_another_image_size_is_refused() -> None:
    with pytest.raises(MessageError, match=r"for an image of 100×80 .*the image has 80×100"):
        decode_camera_info(info(), (100, 80))
    with pytest.raises(MessageError, match="50×40"):
        decode_camera_info(info(binning_x=2, binning_y=2), (80, 100))


def test_plain_camera_matrix_takes_its_pose_from_outside() -> None:
    asked = []

    def extrinsics(frame_id: str, stamp_ns: int) -> np.ndarray[Any, Any]:
        asked.append((frame_id, stamp_ns))
        pose = np.eye(4)
        pose[2, 3] = 0.8
        return pose

    plain = info(
        np.hstack([HAND[:, :3], np.zeros((3, 1))]), header={"frame_id": "plane_a", "stamp": {"sec": 1, "nanosec": 2}}
    )
    assert decode_camera_info(plain, extrinsics=extrinsics).matrix == pytest.approx(HAND)
    assert asked == [("plane_a", 1_000_000_002)]


def test_a_view_along_an_axis_is_not_taken_for_a_stereo_matrix() -> None:
    assert decode_camera_info(info(HAND)).source[2] == pytest.approx(-0.8)
    moved = HAND.copy()
    moved[0, 3] -= 100.0  # the source 0.1 m to the right
    assert decode_camera_info(info(moved)).source == pytest.approx([0.1, 0.0, -0.8])


def test_a_crop_keeps_the_detectors_width_in_the_images_own_pixels() -> None:
    """Of 100 detector columns, 60 are read out and joined in pairs: the whole detector would have 50."""
    decoded = decode_camera_info(info(roi=roi(20, 10, 60, 40), binning_x=2, binning_y=2), (20, 30))
    assert (decoded.width, decoded.detector_width) == (30, 50.0)
    assert decode_camera_info(info()).detector_width == 100.0


def test_binning_that_leaves_no_rank_is_refused_as_a_message() -> None:
    """A focal length of a billionth of a pixel: of full rank before binning, and not after."""
    tiny = ROTATED / np.linalg.norm(ROTATED[2, :3])
    tiny = np.vstack(
        [2e-28 * tiny[0] / np.linalg.norm(tiny[0, :3]), 2e-28 * tiny[1] / np.linalg.norm(tiny[1, :3]), tiny[2]]
    )
    decode_camera_info(info(tiny))
    with pytest.raises(MessageError, match="p: with binning 16×1 and roi: the projection matrix is singular"):
        decode_camera_info(info(tiny, binning_x=16))
