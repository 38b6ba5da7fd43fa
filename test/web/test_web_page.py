"""The page in a real browser, with the real tracker behind it: clicks, loop, loss, silence."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

pytest.importorskip("rclpy", reason="needs ROS 2")
pytest.importorskip("aiohttp", reason="needs the web extra")
pytest.importorskip("selenium", reason="needs the dev extra")

from scipy.spatial import cKDTree
from selenium.webdriver.common.keys import Keys
from support.browser import Page, require_browser
from support.drawn_recording import SIDE, loop, projections, shift
from support.message_inputs import MESSAGES
from support.page_checks import LISTEN_LIKE_A_SCREEN_READER, cut_texts
from support.page_stage import BREATH_MM, CORNERS, DOWN, UP, Stage, open_stage, z_of

from lasso_motion_ros.geometry.transforms import apply
from msg_adapters.calibrations import encode_camera_info
from msg_adapters.markers import ADD
from msg_adapters.poses import decode_pose
from msg_adapters.seeds import decode_seed, read_seeds_file

ELLIPSE_COLOUR = (255, 157, 245)

pytestmark = [pytest.mark.ros, pytest.mark.timeout(600)]


def homogeneous(matrix: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Projection by the matrix as it stands in the message, without the package's own geometry."""
    pixels = np.column_stack([points, np.ones(len(points))]) @ np.asarray(matrix).reshape(3, 4).T
    return pixels[:, :2] / pixels[:, 2:]


def distances(points: np.ndarray, curve: np.ndarray) -> np.ndarray:
    """Of each point to the nearest of a curve's, which is made dense first."""
    steps = np.linspace(0.0, 1.0, 16, endpoint=False)[:, None, None]
    dense = (curve[:-1] + steps * (curve[1:] - curve[:-1])).reshape(-1, 2)
    return np.linalg.norm(points[:, None] - dense[None], axis=2).min(axis=1)


@pytest.fixture(scope="module")
def stage(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Stage]:
    require_browser()
    with open_stage(tmp_path_factory.mktemp("page")) as started:
        yield started


def test_clicks_start_the_tracker_and_the_loop_is_drawn_where_it_is(stage: Stage) -> None:
    page = stage.page
    page.wait_for_state("WAITING FOR SEED")
    page.wait_for(lambda: page.driver.find_element("id", "hold").is_enabled(), "images of both planes")
    stage.click_along_the_loop()
    counts = page.driver.find_elements("css selector", ".plane .count.enough")
    page.wait_for(lambda: all("mm off the ellipse" in count.text for count in counts), "the clicks' residual")
    for plane in "ab":  # the ellipse lies along the ring before anything is sent
        ellipse = page.loop_pixels(plane, SIDE, ELLIPSE_COLOUR)
        assert len(ellipse) > 50
        assert distances(ellipse, np.vstack([stage.ring(plane), stage.ring(plane)[:1]])).max() < 3.0
    ring = {plane: stage.ring(plane) for plane in "ab"}
    assert page.text("hint") == "Picture held. Enter starts the tracking."
    seeds = stage.directory / "seeds.yaml"
    clicked = saved_clicks(page, seeds)
    page.press(Keys.ENTER)
    page.wait_for(lambda: "The tracker has taken the clicks." in page.text("message-text"), "the answer to the clicks")
    assert saved_clicks(page, seeds) == clicked  # once more, of what the tracker has taken, and at once
    page.wait_for_state("TRACKING")
    for plane in "ab":
        assert (
            distances(
                decode_seed(MESSAGES.make("geometry_msgs/msg/PolygonStamped", clicked[plane])),
                np.vstack([ring[plane], ring[plane][:1]]),
            ).max()
            < 2.0
        )
    places = []
    for phase in (UP, DOWN):
        with stage.held_breath(phase) as resting_ns:
            for plane in "ab":
                true = projections()[plane].project(apply(shift(z_of(phase)), loop()))
                (drawn,) = page.wait_for(
                    lambda p=plane, since=resting_ns: loop_in_place(stage, p, since),
                    f"the loop of plane {plane} in its place",
                )
                assert distances(drawn, true).mean() < 1.5  # and that is where the ring is
                if plane == "a":
                    places.append((z_of(phase), drawn.mean(axis=0)))
    (first_mm, first), (second_mm, second) = places
    moved = second - first
    centre = np.array([[0.0, 0.0, 1e-3 * mm] for mm in (first_mm, second_mm)])
    np.testing.assert_allclose(moved, np.diff(projections()["a"].project(centre), axis=0)[0], atol=1.5)
    # In the words of the lab, of the tracker's own word: that of a supine patient, and how sure it is.
    assert [page.text(f"axis-{axis}") for axis in "xyz"] == ["left", "posterior", "head"]
    angles = [one.text for one in page.driver.find_elements("css selector", ".plane .angle")]
    assert angles == ["RAO 30°", "LAO 60°"]
    page.wait_for(lambda: page.text("sigma").strip("σ< ") not in ("", "–"), "how sure the pose is")
    assert 0.0 < float(page.text("sigma").strip("σ< ")) < 2.0
    assert float(page.text("shift-z").replace("−", "-").replace("+", "")) == pytest.approx(0.0, abs=2 * BREATH_MM + 1)
    assert page.complaints() == []


def saved_clicks(page: Page, seeds: Path) -> dict[str, dict[str, Any]]:
    """Save the clicks as a user does, and read the file that comes of it."""
    seeds.unlink(missing_ok=True)
    page.press("f")
    page.wait_for(seeds.exists, "the seeds file")
    assert "The clicks are in your downloads, as seeds.yaml" in page.text("message-text")
    return read_seeds_file(seeds)


def loop_in_place(stage: Stage, plane: str, since_ns: int) -> list[np.ndarray]:
    """What the page has drawn, if it lies along the whole loop that was published last."""
    marker = stage.published_since("catheter", since_ns, ADD)
    points = np.array([[point.x, point.y, point.z] for point in marker.points])
    expected = homogeneous(encode_camera_info(projections()[plane], {})["p"], points)
    drawn = stage.page.loop_pixels(plane, SIDE)
    if len(drawn) <= 100 or distances(drawn, expected).max() >= 1.5 or distances(expected, drawn).max() >= 2.0:
        return []
    return [drawn]


def test_the_overlay_is_drawn_where_the_motion_puts_it_and_moves(stage: Stage) -> None:
    page = stage.page
    page.wait_for_state("TRACKING")
    page.wait_for(lambda: page.driver.find_element("id", "drawing").is_enabled(), "the overlay's style")
    page.press("o")
    page.wait_for(lambda: page.driver.find_element("id", "drawing").get_attribute("value") == "outline", "its change")
    places = {phase: outline_in_place(stage, phase) for phase in (UP, DOWN)}
    centre = np.array([[0.0, 0.0, 1e-3 * z_of(phase)] for phase in (UP, DOWN)])
    expected = np.diff(projections()["b"].project(centre), axis=0)[0]
    np.testing.assert_allclose(places[DOWN] - places[UP], expected, atol=3.0)
    assert page.complaints() == []


def outline_in_place(stage: Stage, phase: int) -> np.ndarray:
    """The middle of plane B's outline, (2,), at a held breath, once both planes show it where the motion puts it."""
    with stage.held_breath(phase) as resting_ns:
        for plane in "ab":
            (drawn,) = stage.page.wait_for(
                lambda p=plane: outlined(stage.outline(p), hull_of(stage, p, resting_ns)),
                f"the outline of plane {plane} in its place",
            )
    return np.asarray(drawn.min(axis=0) + drawn.max(axis=0)) / 2


def hull_of(stage: Stage, plane: str, since_ns: int) -> np.ndarray:
    """(N, 2) the object's closed outline by the motion that was published last.

    Not by the first of a held breath: where the other plane's image was lost, its depth is a guess.
    """
    corners = apply(decode_pose(stage.published_since("motion", since_ns)), CORNERS)
    pixels = homogeneous(encode_camera_info(projections()[plane], {})["p"], corners)
    hull = cv2.convexHull(pixels.astype(np.float32))[:, 0]
    return np.concatenate([hull, hull[:1]])


def outlined(drawn: np.ndarray, hull: np.ndarray) -> list[np.ndarray]:
    """The outline, drawn three pixels wide, if it lies on a polygon and all along it, but for the ring."""
    if len(drawn) < 200:
        return []
    steps = np.linspace(0.0, 1.0, 200)[:, None, None]
    sides = (hull[:-1] + steps * (hull[1:] - hull[:-1])).reshape(-1, 2)
    gaps = cKDTree(drawn).query(sides)[0]
    lies_on_it = cKDTree(sides).query(drawn)[0].max() < 4.0
    return [drawn] if lies_on_it and np.quantile(gaps, 0.95) < 2.0 and gaps.max() < 12.0 else []


def test_brightness_and_contrast_of_what_is_looked_at(stage: Stage) -> None:
    page = stage.page
    page.wait_for_state("TRACKING")
    page.wait_for(lambda: len(stage.outline("a")) > 200, "the overlay")

    def grey(plane: str = "a") -> float:
        return float(np.median(page.pixels(plane, "film")[..., :3].mean(axis=2)))

    with stage.held_breath(UP):
        page.wait_for(lambda: len(stage.outline("a")) > 200, "the overlay at rest")
        before, before_b = grey(), grey("b")
        page.press("a", "[", "[", "[")  # the film's ground is nearly white by itself
        page.wait_for(lambda: grey() < before - 15.0, "a darker picture by keys")
        page.wait_for(lambda: len(stage.outline("a")) > 200, "the overlay")  # what is drawn keeps its colour
        page.press("w")
        page.wait_for(lambda: abs(grey() - before) < 2.0, "the first grey again")
        page.drag_right("b", 0, 120)
        page.wait_for(lambda: grey("b") < before_b - 15.0, "a darker plane B, by the pointer")
        assert grey() == pytest.approx(before, abs=2.0)  # each plane has its own window
        assert page.driver.find_element("id", "window-reset").is_enabled()
        page.press("w")
        page.wait_for(lambda: abs(grey("b") - before_b) < 2.0, "the first grey again")


def test_a_loss_takes_the_loop_away_and_says_so(stage: Stage) -> None:
    page, stream = stage.page, stage.stream
    page.wait_for_state("TRACKING")
    stream.visible = False
    page.wait_for_state("LOST")
    page.wait_for(lambda: len(page.loop_pixels("a", SIDE)) == 0, "no loop")
    assert "Nothing is compensated" in page.text("detail")
    stream.visible = True
    page.wait_for_state("TRACKING")
    page.wait_for(lambda: len(page.loop_pixels("b", SIDE)) > 100, "the loop again")


def test_silence_is_said_and_ends(stage: Stage) -> None:
    stage.page.driver.execute_script(LISTEN_LIKE_A_SCREEN_READER)
    stage.stream.stop()
    try:
        stage.page.wait_for(lambda: stage.page.text("alarm").startswith("No images"), "the silence")
        assert "old" in stage.page.driver.find_element("id", "plane-a").get_attribute("class")
        note = stage.page.driver.find_element("css selector", "#plane-a .note")
        stage.page.wait_for(lambda: re.fullmatch(r"no images for ([3-9]|\d\d+) s", note.text), "a longer silence")
        in_silence = stage.page.driver.execute_script("return window.heard")
    finally:
        stage.stream.start()
    stage.page.wait_for(lambda: stage.page.text("alarm") == "", "the end of the silence")
    stage.page.wait_for_state("TRACKING")
    heard = stage.page.driver.execute_script("return window.heard")
    alarms = [text for urgent, text in in_silence if urgent]
    # One alarm for one silence, though its seconds go on counting; LOST may come before the page knows more.
    assert 1 <= len(alarms) <= 2
    assert len(set(alarms)) == len(alarms)
    assert heard[-1] == [False, "TRACKING"]


def test_keys_alone_set_and_undo_clicks(stage: Stage) -> None:
    page = stage.page
    page.press("s")
    page.wait_for(lambda: "Picture held" in page.text("hint"), "a held picture")
    page.press("b", Keys.ARROW_RIGHT, " ", Keys.ARROW_DOWN, " ", "a", Keys.ARROW_UP, " ")
    counts = [element.text for element in page.driver.find_elements("css selector", ".plane .count")]
    assert counts == ["1 of 6", "2 of 6"]
    page.press("z", "z")
    counts = [element.text for element in page.driver.find_elements("css selector", ".plane .count")]
    assert counts == ["0 of 6", "1 of 6"]
    assert not page.driver.find_element("id", "send").is_enabled()
    page.press("+", "+")
    assert page.driver.find_element("css selector", "#plane-a .scale").text == "1.6×"
    page.press(Keys.ENTER)  # every command is answered, also one that cannot be done
    assert page.text("message-text").startswith("Not done: Click along the loop, in order: 6 more in plane A")
    page.press("0", Keys.ESCAPE)
    page.wait_for(lambda: page.text("hint") == "", "the live picture")


def test_what_does_nothing_says_why(stage: Stage) -> None:
    page = stage.page
    page.click("a", np.array([40.0, 60.0]), SIDE)
    assert page.text("message-text").startswith("No point set: the picture moves.")
    page.press("t", "t")
    page.wait_for(lambda: page.text("message-text") == "The present phase is the reference now.", "an answer")


def test_clicks_that_are_refused_while_tracking_are_answered_in_plain_words_and_kept(stage: Stage) -> None:
    page = stage.page
    page.wait_for_state("TRACKING")
    hold(page)
    for plane in "ab":
        click_on_nothing(page, plane, 7)
    assert leaving_is_asked(page)
    page.press(Keys.ENTER)
    page.wait_for(lambda: "bad" in page.driver.find_element("id", "message").get_attribute("class"), "the refusal")
    text = page.text("message-text")
    assert text.startswith("No lasso is visible along the clicks. Click anew along the dark wire")
    assert "noise" not in text
    assert cut_texts(page) == []
    assert page.text("state") == "TRACKING"
    counts = [element.text for element in page.driver.find_elements("css selector", ".plane .count")]
    assert all(count.startswith("7 points") for count in counts)  # to be mended, not to be set again
    page.press(Keys.ESCAPE)
    page.wait_for(lambda: page.text("hint") == "", "the live picture")
    assert not leaving_is_asked(page)


def test_two_tabs_do_not_eat_each_others_clicks(stage: Stage) -> None:
    page, driver = stage.page, stage.page.driver
    first, url = driver.current_window_handle, driver.current_url
    hold(page)
    click_on_nothing(page, "a", 2)
    driver.switch_to.new_window("tab")
    try:
        driver.get(url)
        page.wait_for_state("TRACKING")
        page.wait_for(lambda: "another window" in page.text("detail"), "word of the other window")
        page.wait_for(lambda: page.driver.find_element("id", "hold").is_enabled(), "images")
        page.press("s")
        page.wait_for(lambda: "another window" in page.text("message-text"), "a refusal")
        assert page.text("hint") == ""
        page.press(Keys.ESCAPE)
    finally:
        driver.close()
        driver.switch_to.window(first)
    assert driver.find_element("css selector", "#plane-a .count").text == "2 of 6"
    page.press(Keys.ESCAPE)
    page.wait_for(lambda: page.text("hint") == "", "the live picture")


def hold(page: Page) -> None:
    page.press("s")
    page.wait_for(lambda: "Picture held" in page.text("hint"), "a held picture")


def click_on_nothing(page: Page, plane: str, count: int) -> None:
    for angle in 0.85 * np.arange(count):
        page.click(plane, np.array([40 + 16 * np.cos(angle), 200 + 10 * np.sin(angle)]), SIDE)


def leaving_is_asked(page: Page) -> bool:
    """Whether the browser would ask before it reloads the page."""
    script = "const e = new Event('beforeunload', { cancelable: true }); return !window.dispatchEvent(e)"
    return bool(page.driver.execute_script(script))


def test_reset_asks_twice(stage: Stage) -> None:
    page = stage.page
    page.wait_for_state("TRACKING", "DEGRADED")
    page.press("r")
    assert page.text("reset") == "R Press again"
    page.press("r")
    page.wait_for_state("WAITING FOR SEED")


def test_the_server_gone_is_said(stage: Stage, tmp_path: Path) -> None:
    import signal

    # Of all that went before nothing was said that nobody can understand: the executor and a hold once got in each
    # other's way.
    assert "InvalidHandle" not in stage.graph.processes.log("web", 1000)
    stage.graph.processes.send("web", signal.SIGINT)
    assert stage.graph.wait_for_end("web") == 0
    stage.page.wait_for_state("NO SERVER")
    assert "Connection to the server lost" in stage.page.text("alarm")
