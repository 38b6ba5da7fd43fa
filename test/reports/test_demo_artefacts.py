"""The demonstration's results: honest about what arrived and what did not."""

import json
from dataclasses import replace

import numpy as np
import pytest
from support.rendering_inputs import ellipsoid_mesh, views

from lasso_motion_ros.core.errors import RecordingError
from lasso_motion_ros.evaluation.measures import PairEstimate, PairTruth, Truth
from lasso_motion_ros.geometry import transforms
from lasso_motion_ros.geometry.frames import Frame, FramePair
from lasso_motion_ros.reports.demo_artefacts import CELL_PX, DemoRun, demo_picture, write_demo_artefacts
from lasso_motion_ros.reports.picture_grid import STRIP_PX

av = pytest.importorskip("av", reason="pip install 'lasso_motion_ros[video]'")

PERIOD_NS, OFFSET_NS = 266_666_667, 40_000_000
VIEWS = {"a": views()["plain"], "b": views()["oblique"]}
ANGLE = np.linspace(0.0, 2.0 * np.pi, 100)
LOOP = 0.01 * np.stack([np.cos(ANGLE), 0.3 * np.sin(ANGLE), np.sin(ANGLE)], axis=1)
OVERLAY_COLOUR = (11, 222, 33)
# One millimetre along x, always the same: so the centre's error is exactly 1 mm.
ERROR = transforms.rigid((0.0, 0.0, 0.0), (0.001, 0.0, 0.0))


def run(pairs=5, unanswered=()):
    frames, truths, estimates = [], [], []
    overlays = {"a": {}, "b": {}}
    rng = np.random.default_rng(1)
    for number in range(pairs):
        stamp = 1_760_000_000_000_000_000 + number * PERIOD_NS
        motion = transforms.rigid((0.0, 0.0, 0.0), (0.0, 0.0, 0.002 * number))
        shown = {
            plane: Frame(stamp + delay, rng.integers(50, 200, (512, 512)).astype(np.uint8), VIEWS[plane])
            for plane, delay in (("a", 0), ("b", OFFSET_NS))
        }
        frames.append(FramePair(stamp, shown["a"], shown["b"]))
        centrelines = {plane: VIEWS[plane].project(transforms.apply(motion, LOOP)) for plane in "ab"}
        truths.append(PairTruth(stamp, motion, motion, centrelines, VIEWS))
        if number in unanswered:
            continue
        found = ERROR @ motion if number else np.eye(4)
        loop = transforms.apply(found, LOOP)
        estimates.append(PairEstimate(stamp, "TRACKING", found, found, None, loop, frames[0].stamp_ns))
        for plane in "ab":
            overlays[plane][shown[plane].stamp_ns] = np.full((512, 512, 3), OVERLAY_COLOUR, np.uint8)
    mesh = ellipsoid_mesh((0.02, 0.018, 0.019), rows=40, columns=21)
    return DemoRun("a test", frames, estimates, overlays, mesh, Truth(truths, LOOP, LOOP[:20]))


def cell(picture, row, column):
    top, left = STRIP_PX + row * (CELL_PX + STRIP_PX + 4), column * (CELL_PX + 4)
    return picture[top : top + CELL_PX, left : left + CELL_PX]


def test_the_right_column_is_what_arrived():
    picture = demo_picture(run(), 2)
    for row in (0, 1):
        np.testing.assert_array_equal(cell(picture, row, 1), np.broadcast_to(OVERLAY_COLOUR, (CELL_PX, CELL_PX, 3)))
        # Left the film with the static surface: neither the received picture nor bare grey.
        left = cell(picture, row, 0).astype(int)
        assert np.ptp(left, axis=-1).max() > 20
        assert not (left == OVERLAY_COLOUR).all(axis=-1).any()


def test_an_overlay_that_did_not_arrive_is_missed_in_the_picture():
    some = run()
    del some.overlays["b"][some.pairs[2].b.stamp_ns]
    picture = demo_picture(some, 2)
    assert (cell(picture, 0, 1) == OVERLAY_COLOUR).all()
    missing = cell(picture, 1, 1)
    assert not (missing == OVERLAY_COLOUR).all(axis=-1).any()
    assert (missing[3, 3] == (255, 92, 80)).all()


def test_a_plane_that_was_not_played_is_said():
    some = run()
    pairs = list(some.pairs)
    pairs[1] = FramePair(pairs[1].stamp_ns, pairs[1].a, None)
    picture = demo_picture(replace(some, pairs=pairs), 1)
    assert cell(picture, 1, 0)[200:].max() <= 170
    assert (cell(picture, 1, 1)[3, 3] == (170, 170, 170)).all()


def test_everything_is_written_and_the_figures_are_right(tmp_path):
    found = write_demo_artefacts(run(), tmp_path)
    assert {path.name for path in tmp_path.iterdir()} == {
        "overlay.mp4", "motion.png", "error_2d.png", "table.txt", "table.json",
    }  # fmt: skip
    assert found.summary.poses == 4
    assert found.summary.missing == 0
    assert found.summary.centre_error_mm == pytest.approx(1.0)
    assert found.summary.centre_jitter_mm == pytest.approx(0.0, abs=1e-6)
    # Static error by hand: mean of 2, 4, 6 and 8 mm.
    assert found.summary.static_error_mm == pytest.approx(5.0)
    record = json.loads(found.table_json.read_text())
    assert record["recordings"]["a test"]["summary"]["centre_error_mm"] == pytest.approx(1.0)
    assert "a test" in found.table_text.read_text()
    with av.open(str(found.video)) as container:
        stream = container.streams.video[0]
        frames = list(container.decode(stream))
    assert len(frames) == 5
    # Real time: 3.75 pictures a second.
    assert frames[4].pts * frames[4].time_base == pytest.approx(4 / 3.75, abs=2e-3)


def test_a_pair_without_an_answer_counts_as_missing(tmp_path):
    found = write_demo_artefacts(run(unanswered=(3,)), tmp_path)
    assert found.summary.missing == 1
    assert found.summary.poses == 3


def test_without_truth_there_is_no_table(tmp_path):
    found = write_demo_artefacts(replace(run(2), truth=None), tmp_path)
    assert found.summary is None
    assert found.table_text is None
    assert found.video.exists()
    assert found.motion_plot.exists()
    assert not (tmp_path / "table.txt").exists()


def test_nothing_played_and_no_place_to_write_are_said(tmp_path):
    with pytest.raises(RecordingError, match="no image pair"):
        write_demo_artefacts(replace(run(), pairs=[]), tmp_path)
    with pytest.raises(RecordingError, match="cannot be written"):
        write_demo_artefacts(run(), tmp_path / "missing")
