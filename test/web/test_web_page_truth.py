"""What the page claims against the truth: tracker killed, stopped, hanging, restarted; images gone; server hanging."""

from __future__ import annotations

import os
import signal
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("rclpy", reason="needs ROS 2")
pytest.importorskip("aiohttp", reason="needs the web extra")
pytest.importorskip("selenium", reason="needs the dev extra")

from support.browser import Page, require_browser
from support.page_stage import Stage, open_stage

pytestmark = [pytest.mark.ros, pytest.mark.timeout(600)]

# What the page shows, taken 20 times a second in the page itself: a claim of a moment is a claim, too.
SAMPLER = """
const loopDrawn = (name) => {
  const marks = document.querySelector(`#plane-${name} canvas.marks`);
  const data = marks.getContext('2d').getImageData(0, 0, marks.width, marks.height).data;
  for (let i = 0; i < data.length; i += 4)
    if (data[i] > 200 && data[i + 1] > 180 && data[i + 2] < 120 && data[i + 3] > 200) return true;
  return false;
};
const overlay = (name) => document.querySelector(`#plane-${name} .count`).textContent === 'overlay';
const text = (id) => document.getElementById(id).textContent;
window.samples = [];
setInterval(() => window.samples.push({
  state: text('state'), alarm: text('alarm'), age: text('pose-age'), loop: loopDrawn('a') || loopDrawn('b'),
  overlays: [overlay('a'), overlay('b')],
  old: ['a', 'b'].map((name) => document.getElementById(`plane-${name}`).classList.contains('old')),
}), 50);
"""
POSE = ("TRACKING", "DEGRADED")


class Claims:
    """What the page has claimed since a moment."""

    def __init__(self, page: Page) -> None:
        self._page = page
        page.driver.execute_script(SAMPLER)

    def forget(self) -> None:
        self._page.driver.execute_script("window.samples = []")

    def taken(self) -> list[dict[str, Any]]:
        return list(self._page.driver.execute_script("return window.samples"))

    def during(self, seconds: float) -> list[dict[str, Any]]:
        """The samples of the next seconds."""
        self.forget()
        time.sleep(seconds)
        return self.taken()


@pytest.fixture(scope="module")
def stage(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Stage]:
    require_browser()
    directory = tmp_path_factory.mktemp("truth")
    with pytest.MonkeyPatch.context() as environment:
        environment.setenv("HANG", str(directory / "hang"))
        with open_stage(directory, tracker_module="support.hanging_tracker") as started:
            started.start_tracking()
            started.page.wait_for(lambda: started.page.text("pose-age").startswith("Last good pose 0."), "a fresh pose")
            yield started


@pytest.fixture(scope="module")
def claims(stage: Stage) -> Claims:
    return Claims(stage.page)


def agrees(sample: dict[str, Any]) -> bool:
    """Whether headline, alarm and what is drawn say the same."""
    if sample["state"] not in POSE:
        return not sample["loop"]
    if sample["state"] == "TRACKING":
        return not sample["alarm"]
    return True


def nothing_is_claimed(stage: Stage, claims: Claims, *headlines: str) -> list[dict[str, Any]]:
    """Wait for one of the headlines; from then on no pose is claimed, and all that is shown agrees."""
    page = stage.page
    page.wait_for_state(*headlines)
    page.wait_for(lambda: not claims_loop(page), "no loop")
    taken = claims.during(1.5)
    assert taken
    assert not [sample for sample in taken if sample["state"] in POSE or not agrees(sample)]
    assert all(sample["age"].startswith(("Last good pose ", "No pose yet")) for sample in taken)
    return taken


def claims_loop(page: Page) -> bool:
    return bool(page.driver.execute_script("return window.samples.at(-1)?.loop"))


def tracks_again(stage: Stage, claims: Claims) -> None:
    stage.page.wait_for_state("TRACKING")
    stage.page.wait_for(lambda: stage.page.text("pose-age").startswith("Last good pose 0."), "a fresh pose")
    stage.page.wait_for(lambda: stage.page.text("alarm") == "", "no alarm")
    claims.forget()


def test_images_of_both_planes_stop(stage: Stage, claims: Claims) -> None:
    stage.stream.stop()
    taken = nothing_is_claimed(stage, claims, "NO IMAGES", "LOST")
    assert "0." not in taken[-1]["age"]  # on a busy machine the last pose comes long after its images
    stage.page.wait_for(lambda: "No images" in stage.page.text("alarm"), "an alarm")
    stage.stream.start()
    tracks_again(stage, claims)


def test_one_plane_stops(stage: Stage, claims: Claims) -> None:
    stage.stream.planes = "a"
    stage.page.wait_for_state("DEGRADED", "LOST")
    stage.page.wait_for(lambda: "plane B" in stage.page.text("alarm"), "an alarm that names the plane")
    taken = claims.during(1.0)
    assert all(agrees(sample) and sample["state"] != "TRACKING" for sample in taken)
    assert all(sample["old"] == [False, True] for sample in taken)  # no green overlay stays in the plane that stands
    stage.stream.planes = "ab"
    tracks_again(stage, claims)


def test_the_tracker_hangs_in_a_pair(stage: Stage, claims: Claims) -> None:
    hang = Path(os.environ["HANG"])
    hang.touch()
    taken = nothing_is_claimed(stage, claims, "NO POSE", "TRACKER SILENT", "LOST")
    assert all(sample["old"] == [False, False] for sample in taken)  # the images are new, and are shown
    hang.unlink()
    tracks_again(stage, claims)


def test_the_trackers_process_is_stopped_and_goes_on(stage: Stage, claims: Claims) -> None:
    stage.graph.processes.send("tracker", signal.SIGSTOP)
    nothing_is_claimed(stage, claims, "NO POSE", "TRACKER SILENT")
    stage.page.wait_for_state("TRACKER SILENT")
    assert "silent" in stage.page.text("alarm")
    stage.graph.processes.send("tracker", signal.SIGCONT)
    tracks_again(stage, claims)


def test_the_server_hangs_and_goes_on(stage: Stage, claims: Claims) -> None:
    stage.graph.processes.send("web", signal.SIGSTOP)
    stage.page.wait_for_state("NO SERVER")
    taken = claims.during(1.0)
    assert all(sample["old"] == [True, True] and "lost" in sample["alarm"] for sample in taken)
    stage.graph.processes.send("web", signal.SIGCONT)
    tracks_again(stage, claims)


def test_the_tracker_is_killed_and_another_is_started_in_mid_stream(stage: Stage, claims: Claims) -> None:
    stage.graph.processes.send("tracker", signal.SIGKILL)
    nothing_is_claimed(stage, claims, "NO POSE", "TRACKER SILENT", "NO TRACKER")
    stage.page.wait_for_state("TRACKER SILENT", "NO TRACKER")
    claims.forget()
    stage.graph.processes.start_node("restarted", "lasso_tracker")
    stage.page.wait_for_state("WAITING FOR SEED")
    assert stage.page.text("pose-age") == "No pose yet"
    assert stage.page.text("alarm") == ""
    # It knows nothing of the clicks that the first one has taken.
    assert "Press S" in stage.page.text("detail")
    assert not any(word in stage.page.text("reason") for word in ("anew", "sent"))
    assert not [sample for sample in claims.taken() if sample["state"] in POSE or sample["loop"]]
