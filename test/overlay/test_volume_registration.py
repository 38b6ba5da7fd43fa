"""The overlay's registration as text."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from lasso_motion_ros.core.errors import ConfigurationError
from lasso_motion_ros.core.output_checks import check_outputs
from lasso_motion_ros.overlay.volume_registration import parse_registration, read_registration

QUARTER_TURN_ABOUT_Z = [[0, -1, 0, 0.1], [1, 0, 0, 0.2], [0, 0, 1, 0.3], [0, 0, 0, 1]]


@pytest.mark.parametrize(
    "text",
    [
        "0.1 0.2 0.3 0 0 0.70710678 0.70710678",
        "0.1, 0.2, 0.3, 0, 0, 0.70710678, 0.70710678",
        "0 -1 0 0.1  1 0 0 0.2  0 0 1 0.3  0 0 0 1",
    ],
)
def test_both_forms(text: str) -> None:
    np.testing.assert_allclose(parse_registration(text), QUARTER_TURN_ABOUT_Z, atol=1e-7)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "found 0 numbers"),
        ("1 2 3", "found 3 numbers"),
        ("0 0 0 0 0 0 x", "could not convert"),
        ("0 0 0 0 0 0 nan", "not finite"),
        ("0 0 0 0 0 0 2", "length 2, not 1"),
        ("1000 0 0 0 0 1000 0 0 0 0 1000 0 0 0 0 1", "not a rigid transform"),
        ("-1 0 0 0 0 1 0 0 0 0 1 0 0 0 0 1", "not a rigid transform"),
        ("1 0 0 0 0 1 0 0 0 0 1 0 5 0 0 1", "not a rigid transform"),
    ],
)
def test_what_is_no_rigid_transform_is_refused(text: str, message: str) -> None:
    with pytest.raises(ConfigurationError, match=message):
        parse_registration(text)


def test_a_file_may_hold_the_numbers(tmp_path: Path) -> None:
    path = tmp_path / "to world.txt"
    path.write_text("# from the workstation\n0 -1 0 0.1\n1 0 0 0.2  # metres\n0 0 1 0.3\n0 0 0 1\n", encoding="utf-8")
    np.testing.assert_array_equal(read_registration(str(path)), QUARTER_TURN_ABOUT_Z)
    np.testing.assert_array_equal(read_registration("0 0 0 0 0 0 1"), np.eye(4))


def test_a_file_that_is_none_and_one_with_bad_numbers_are_named(tmp_path: Path) -> None:
    with pytest.raises(ConfigurationError, match=r"nowhere\.txt: neither numbers nor a readable file"):
        read_registration("nowhere.txt")
    path = tmp_path / "bad.txt"
    path.write_text("1 2 3")
    with pytest.raises(ConfigurationError, match=r"bad\.txt: .*found 3 numbers"):
        read_registration(str(path))


def test_what_has_no_end_is_no_registration() -> None:
    with pytest.raises(ConfigurationError, match="/dev/zero: neither numbers nor a readable file"):
        read_registration("/dev/zero")


def test_a_matrix_with_all_its_digits_is_no_path():
    numbers = " ".join(f"{value:.17e}" for value in np.eye(4).ravel())
    assert len(numbers) > 255  # longer than any name of a file
    np.testing.assert_array_equal(read_registration(numbers), np.eye(4))
    check_outputs([], [Path(numbers)], overwrite=False)
