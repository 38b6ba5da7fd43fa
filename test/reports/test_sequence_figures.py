"""Plots: what they show is what they were given."""

import numpy as np
import pytest

from lasso_motion_ros.core.errors import RecordingError
from lasso_motion_ros.reports.figure_panels import ABSENT_COLOUR, MISSING_COLOUR, save_figure, share_scale
from lasso_motion_ros.reports.sequence_figures import PairFlags, error_figure, motion_figure

TIMES = np.arange(6) / 3.0
TRUE = np.column_stack([TIMES, -2.0 * TIMES, 10.0 * np.sin(TIMES)])
FOUND = TRUE + 0.2
FOUND[3] = np.nan


def lines(axis, label):
    return next(line for line in axis.get_lines() if line.get_label() == label)


def legend(figure):
    return [text.get_text() for text in figure.axes[0].get_legend().get_texts()]


def test_motion_is_plotted_per_axis_on_one_scale():
    figure = motion_figure(TIMES, FOUND, TRUE, title="a run")
    assert [axis.get_ylabel() for axis in figure.axes] == ["x (mm)", "y (mm)", "z (mm)"]
    assert figure.axes[-1].get_xlabel() == "time since the first pair (s)"
    assert len({axis.get_ylim() for axis in figure.axes}) == 1
    for number, axis in enumerate(figure.axes):
        np.testing.assert_array_equal(lines(axis, "truth").get_ydata(), TRUE[:, number])
        np.testing.assert_array_equal(lines(axis, "published").get_ydata(), FOUND[:, number])
    assert legend(figure) == ["truth", "published", "no pose"]


def test_motion_without_truth_shows_only_what_was_published():
    assert legend(motion_figure(TIMES, FOUND, None)) == ["published", "no pose"]


def test_errors_are_named_with_their_mean_over_the_tracked_pairs():
    errors = {"a": np.array([0.6, 0.2, 0.4, np.nan]), "b": np.array([0.5, 0.3, 0.3, np.nan])}
    reference = np.array([True, False, False, False])
    has_pose, in_place = np.array([True, True, True, False]), np.ones(4, dtype=bool)
    figure = error_figure(errors, PairFlags(reference, has_pose, in_place))
    # By hand: plane A (0.2 + 0.4) / 2 = 0.30, spread 0.10; the reference pair is left out.
    assert legend(figure)[:2] == ["plane A: 0.30 ± 0.10 mm", "plane B: 0.30 ± 0.00 mm"]
    assert "no pose" in legend(figure)
    assert "false pose" not in legend(figure)
    assert "mm" in figure.axes[0].get_ylabel()


def test_a_pose_without_a_lasso_is_marked_as_false():
    nothing = {"a": np.array([0.1, np.nan]), "b": np.array([0.1, np.nan])}
    flags = np.array([True, False])
    figure = error_figure(nothing, PairFlags(flags, np.array([True, True]), flags))
    assert {"lasso hidden or moved", "false pose"} <= set(legend(figure))
    np.testing.assert_array_equal(lines(figure.axes[0], "false pose").get_xdata(), [1])


def test_a_figure_is_written_the_same_each_time(tmp_path):
    for name in ("a.png", "b.png"):
        save_figure(motion_figure(TIMES, FOUND, TRUE), tmp_path / name)
    assert (tmp_path / "a.png").read_bytes() == (tmp_path / "b.png").read_bytes()
    assert (tmp_path / "a.png").read_bytes()[:8] == b"\x89PNG\r\n\x1a\n"
    with pytest.raises(RecordingError, match="cannot be written"):
        save_figure(motion_figure(TIMES, FOUND, TRUE), tmp_path / "missing" / "a.png")


def test_a_pair_without_lasso_that_rightly_got_no_pose_is_not_counted_as_missing():
    nothing = {"a": np.array([0.1, np.nan]), "b": np.array([0.1, np.nan])}
    flags = np.array([True, False])
    assert "no pose" not in legend(error_figure(nothing, PairFlags(flags, flags, flags)))


def test_figures_beside_each_other_have_one_scale():
    flags = PairFlags(np.array([True, False]), np.array([True, True]), np.array([True, True]))
    small, large = (error_figure({"a": np.array([0.1, v]), "b": np.array([0.1, v])}, flags) for v in (0.5, 6.0))
    top = large.axes[0].get_ylim()[1]
    assert small.axes[0].get_ylim()[1] < top
    share_scale([small, large])
    assert small.axes[0].get_ylim() == large.axes[0].get_ylim() == (0.0, top)


def test_where_no_lasso_is_in_its_place_no_pose_is_missing_from_the_motion():
    found = np.array([[0.0, 0.0, 0.0], [np.nan] * 3, [np.nan] * 3])
    figure = motion_figure(np.arange(3.0), found, np.zeros((3, 3)), np.array([True, False, True]))
    bands = {line.get_color(): list(line.get_xdata()) for line in figure.axes[1].lines if line.get_linewidth() == 5}
    assert bands == {ABSENT_COLOUR: [1.0, 1.0], MISSING_COLOUR: [2.0, 2.0]}
