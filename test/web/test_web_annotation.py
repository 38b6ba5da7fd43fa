"""Centrelines drawn in the page: into a copy, in order of time, replacing what was drawn before."""

from __future__ import annotations

import signal
import subprocess
import sys
import threading
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("aiohttp", reason="needs the web extra")

from support.drawn_recording import SIDE, loop, projections, shift, stamp, write_input

from lasso_motion_ros.cli.main import main
from lasso_motion_ros.core.errors import MessageError, RecordingError
from lasso_motion_ros.evaluation.recorded_input import read_truth
from lasso_motion_ros.geometry.transforms import apply
from lasso_motion_ros.web.annotation import Annotation
from msg_adapters import topics
from msg_adapters.messages import stamp_to_ns
from msg_adapters.poses import decode_pose
from msg_adapters.recordings.annotated_recording import AnnotatedRecording, Changes
from msg_adapters.recordings.reader import RecordingReader
from msg_adapters.seeds import decode_polygon

MOTIONS_MM = [0.0, 2.0, 4.0]
PAGE = 1
CURVE = [[10.0, 20.0], [30.25, 40.0], [50.0, 20.0]]


def drawing(index: int, a: list, b: list, closed: bool = False) -> dict:
    return {"index": index, "closed": closed, "a": a, "b": b, "curve_a": a, "curve_b": b}


def centrelines(path: Path, plane: str) -> dict[int, np.ndarray]:
    topic = topics.true_centreline_topic(plane).recorded_name
    return {
        stamp_to_ns(one.message.header.stamp): decode_polygon(one.message)
        for one in RecordingReader(path).messages([topic])
    }


@pytest.fixture
def bare(tmp_path: Path) -> Path:
    return write_input(tmp_path / "bare.mcap", MOTIONS_MM, truth=False)


def test_a_drawn_pair_is_in_the_copy_beside_everything_else(bare: Path, tmp_path: Path) -> None:
    copy = tmp_path / "copy.mcap"
    source = Annotation(AnnotatedRecording(bare, copy))
    source.command("go", {"index": 1}, PAGE)
    assert {plane: one.stamp_ns for plane, one in source.picture("film", PAGE).planes.items()} == dict.fromkeys(
        "ab", stamp(1)
    )
    source.command("draw", drawing(1, CURVE, []), PAGE)
    assert (source.status(PAGE)["done"], source.status(PAGE)["unsaved"]) == (0, True)
    source.command("draw", drawing(1, CURVE, CURVE), PAGE)
    assert source.status(PAGE)["done"] == 1
    assert "Saved 2 centrelines" in source.command("save", {}, PAGE)
    assert not source.status(PAGE)["unsaved"]
    for plane in "ab":
        found = centrelines(copy, plane)
        assert list(found) == [stamp(1)]
        np.testing.assert_array_equal(found[stamp(1)], CURVE)
    before, after = (
        [(m.topic, m.log_time_ns, m.data) for m in RecordingReader(p).raw_messages()] for p in (bare, copy)
    )
    assert [entry for entry in after if "ground_truth" not in entry[0]] == before
    assert [entry[1] for entry in after] == sorted(entry[1] for entry in after)


def test_what_was_drawn_before_is_shown_and_replaced(tmp_path: Path) -> None:
    known = write_input(tmp_path / "known.mcap", MOTIONS_MM)
    copy = tmp_path / "copy.mcap"
    source = Annotation(AnnotatedRecording(known, copy))
    assert source.status(PAGE)["done"] == 3
    true = projections()["a"].project(apply(shift(0.0), loop()))
    np.testing.assert_allclose(source.status(PAGE)["curves"]["a"], true, atol=0.02)
    source.command("draw", drawing(2, CURVE, []), PAGE)
    source.command("save", {}, PAGE)
    found = centrelines(copy, "a")
    assert sorted(found) == [stamp(pair) for pair in range(3)]
    np.testing.assert_array_equal(found[stamp(2)], CURVE)
    np.testing.assert_allclose(found[stamp(1)], projections()["a"].project(apply(shift(2.0), loop())), atol=1e-3)
    assert len(centrelines(copy, "b")) == 3  # nothing was clicked there
    assert len(read_truth(copy).truth.pairs) == 3


def test_the_clicks_of_the_pair_before_can_be_taken_over(bare: Path, tmp_path: Path) -> None:
    source = Annotation(AnnotatedRecording(bare, tmp_path / "copy.mcap"))
    source.command("draw", drawing(0, CURVE, CURVE, closed=True), PAGE)
    source.command("go", {"index": 1, "copy": True}, PAGE)
    status = source.status(PAGE)
    assert (status["points"]["b"], status["closed"], status["index"], status["done"]) == (CURVE, True, 1, 2)


@pytest.mark.slow
def test_clicks_made_here_begin_the_tracking_from_the_copy_and_from_their_file(bare: Path, tmp_path: Path) -> None:
    copy, seeds = tmp_path / "copy.mcap", tmp_path / "seeds.yaml"
    without = {f"/plane_{plane}/seed": f"/old/{plane}" for plane in "ab"}
    source = Annotation(AnnotatedRecording(bare, copy, without))
    clicks = {p: projections()[p].project(apply(shift(2.0), loop()))[:-1:18].tolist() for p in "ab"}
    source.command("draw", drawing(0, clicks["a"][:5], clicks["b"]), PAGE)
    source.command("go", {"index": 1}, PAGE)
    source.command("draw", drawing(1, clicks["a"], clicks["b"][:5]), PAGE)
    assert not source.status(PAGE)["has_clicks"]
    with pytest.raises(RecordingError, match="Click 6 points or more along the loop, in both planes, first"):
        source.clicks_file({}, PAGE)
    source.command("draw", drawing(1, clicks["a"], clicks["b"]), PAGE)
    assert source.status(PAGE)["has_clicks"]
    seeds.write_text(source.clicks_file({}, PAGE))
    assert "and the clicks of pair 2 for track" in source.command("save", {}, PAGE)
    found = []
    for name, words in (("from_copy", [str(copy)]), ("from_file", [str(bare), "--seeds", str(seeds)])):
        result = tmp_path / f"{name}.mcap"
        assert main(["track", *words, "-o", str(result), "--quiet"]) == 0
        found.append(
            [decode_pose(one.message) for one in RecordingReader(result).messages([topics.MOTION.recorded_name])]
        )
    np.testing.assert_allclose(found[0], found[1], atol=2e-5)  # a file's hundredths of a pixel
    assert len(found[0]) == 2  # from the clicked pair on
    np.testing.assert_allclose([1e3 * motion[2, 3] for motion in found[0]], [0.0, 2.0], atol=0.2)


def test_the_page_is_answered_while_a_large_recording_is_copied(
    bare: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    writing, go_on, save = threading.Event(), threading.Event(), AnnotatedRecording.save

    def slow(recording: AnnotatedRecording, changes: Changes) -> None:
        writing.set()
        assert go_on.wait(30.0)
        save(recording, changes)

    monkeypatch.setattr(AnnotatedRecording, "save", slow)
    copy = tmp_path / "copy.mcap"
    source = Annotation(AnnotatedRecording(bare, copy))
    source.command("draw", drawing(0, CURVE, CURVE), PAGE)
    saving = threading.Thread(target=source.command, args=("save", {}, PAGE))
    saving.start()
    try:
        assert writing.wait(30.0)
        source.command("draw", drawing(1, CURVE, CURVE), PAGE)  # waits for nobody
        assert source.status(PAGE)["unsaved"]
    finally:
        go_on.set()
        saving.join()
    assert list(centrelines(copy, "a")) == [stamp(0)]  # as it was when it was saved
    assert source.status(PAGE)["unsaved"]


def test_a_recording_that_has_clicks_keeps_its_own(bare: Path, tmp_path: Path) -> None:
    copy = tmp_path / "copy.mcap"
    source = Annotation(AnnotatedRecording(bare, copy))
    source.command("draw", drawing(1, CURVE * 2, CURVE * 2), PAGE)
    assert "for track" not in source.command("save", {}, PAGE)
    seeds = [topics.seed_topic(plane).recorded_name for plane in "ab"]
    kept = [[stamp_to_ns(one.message.header.stamp) for one in RecordingReader(p).messages(seeds)] for p in (bare, copy)]
    assert kept[0] == kept[1] == [stamp(0)] * 2


def test_nothing_is_overwritten_unasked(bare: Path, tmp_path: Path) -> None:
    copy = tmp_path / "copy.mcap"
    copy.write_bytes(b"mine")
    with pytest.raises(RecordingError, match="exists: choose another name or add --overwrite"):
        Annotation(AnnotatedRecording(bare, copy))
    with pytest.raises(RecordingError, match="is an input, and no input is overwritten"):
        Annotation(AnnotatedRecording(bare, bare, overwrite=True))
    Annotation(AnnotatedRecording(bare, copy, overwrite=True)).save()
    assert copy.read_bytes() != b"mine"
    assert [path.name for path in tmp_path.iterdir() if path.name.startswith(".")] == []


@pytest.mark.parametrize("index", [-1, 3, 1.0, True, None])
def test_a_pair_that_is_not_there_is_refused(bare: Path, tmp_path: Path, index: object) -> None:
    with pytest.raises(MessageError, match="index: expected 0 to 2"):
        Annotation(AnnotatedRecording(bare, tmp_path / "copy.mcap")).command("go", {"index": index}, PAGE)


@pytest.mark.slow
def test_without_an_output_it_says_so_in_one_line(bare: Path) -> None:
    done = subprocess.run(
        [sys.executable, "-m", "lasso_motion_ros.cli.main", "web", "--annotate", str(bare)],
        capture_output=True, encoding="utf-8", check=False,
    )  # fmt: skip
    assert (done.returncode, done.stderr) == (
        2,
        "lasso-motion web: --annotate needs -o OUT.mcap, the copy to draw into\n",
    )


@pytest.mark.slow
def test_a_curve_is_drawn_in_the_browser_and_saved_at_the_end(bare: Path, tmp_path: Path) -> None:
    pytest.importorskip("selenium", reason="needs the dev extra")
    from support.browser import open_page, require_browser

    require_browser()
    copy = tmp_path / "copy.mcap"
    command = [sys.executable, "-m", "lasso_motion_ros.cli.main", "web", "--port", "0"]
    with subprocess.Popen(
        [*command, "--annotate", str(bare), "-o", str(copy)], stdout=subprocess.PIPE, encoding="utf-8"
    ) as server:
        assert server.stdout is not None
        url = server.stdout.readline().split(" at ")[1].split()[0]
        try:
            with open_page(url, tmp_path / "profile") as page:
                page.wait_for_state("DRAWING")
                page.press("n")
                page.wait_for(lambda: page.text("frame") == "2 of 3", "the second pair")
                true = {p: projections()[p].project(apply(shift(2.0), loop())) for p in "ab"}
                page.wait_for(lambda: np.any(page.pixels("a", "film")), "the film")
                for plane in "ab":
                    for point in true[plane][:-1:15]:
                        page.click(plane, point, SIDE)
                page.press("c")
                page.wait_for(lambda: "1 of 3 pairs drawn" in page.text("detail"), "the pair as drawn")
                assert page.complaints() == []
                hidden = "const a = document.querySelector('aside'); return a.scrollHeight - a.clientHeight"
                assert page.driver.execute_script(hidden) <= 0  # all is in sight on a laptop
        finally:
            server.send_signal(signal.SIGINT)
        assert server.wait(30) == 0
    for plane in "ab":
        (found,) = centrelines(copy, plane).values()
        # Twelve clicks at whole screen pixels, and a smooth curve through them: within a pixel of the ring.
        away = np.linalg.norm(found[:, None] - true[plane][None], axis=2)
        assert away.min(axis=1).max() < 1.5
        assert away.min(axis=0).max() < 1.5
        assert len(found) > 100
