"""The page's looks in a real browser, at a laptop's size and a phone's: read, touched, pinched; no ROS."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from typing import Any

import numpy as np
import pytest

pytest.importorskip("aiohttp", reason="needs the web extra")
pytest.importorskip("selenium", reason="needs the dev extra")

from selenium.webdriver.common.keys import Keys
from support.browser import Page, open_page, require_browser
from support.page_checks import (
    BROKEN_LINES,
    FAINT_TEXTS,
    LISTEN_LIKE_A_SCREEN_READER,
    SMALL_TARGETS,
    cut_texts,
    pinch,
    scale,
)

from lasso_motion_ros.web.plain_words import in_plain_words
from lasso_motion_ros.web.server import WebServer
from lasso_motion_ros.web.source import PageView, Picture, PlanePicture, TracePoint
from msg_adapters.seeds import encode_seeds_file

pytestmark = pytest.mark.timeout(600)

SIDE = 256
LONG = (
    "no catheter is seen along the clicks: the logarithm of the odds for one is 2.1, expected at least 6",
    "the planes disagree by 12.3 mm at the seed, and by 1.2 mm only with the calibrations of A and B exchanged: …",
    "the planes disagree by 12.3 mm at the seed: wrong calibration, or clicks on different things? (at most 3 mm …)",
    "the clicks make a loop of 41.2 mm radius, expected 4 to 25 mm: were they set along the lasso in both planes?",
    "plane B: the clicks span 1.2 mm, expected at least 8 mm: were they set along the whole lasso?",
    "no 3-D ellipse explains the two outlines: the best lies 12.3 px from them, expected under 2.0 px; do both …",
    "the clicks of both planes must be on one pair: plane A's are on the image at 1760000000.000000000 s, …",
    "the clicked image (1760000000.000000000 s) is not among the last 32 pairs",
    "plane A does not show the lasso where plane B has it",
    "LinAlgError: Singular matrix",
)


class Scene:
    """A source that says what it is told to say."""

    def __init__(self) -> None:
        self.said: dict[str, Any] = {}
        self.held = False
        self._changed: Callable[[], None] = lambda: None

    def say(self, state: str, reason: str = "", alarm: str = "", colour: str = "#4be08a") -> None:
        self.said = {"state": state, "reason": in_plain_words(reason), "alarm": alarm, "colour": colour}
        self._changed()

    def status(self, page: int) -> dict[str, Any]:
        both = dict.fromkeys("ab", True)
        known = {"seen": both, "calibrated": both, "stopped_s": dict.fromkeys("ab"), "drawing": "both", "overlay": True}
        known |= {"axes": ("right", "anterior", "feet"), "angles": dict.fromkeys("ab", "RAO 120° CAUD 25°")}
        numbers = {"sigma_mm": 0.04, "pose_age_s": 0.1, "latency_ms": 12.0, "tracker_latency_ms": 5.0, "clicks": 6}
        return {"mode": "live", **known, **numbers, **self.said, "held": self.held, "has_pose": False}

    def picture(self, view: PageView, page: int) -> Picture:
        planes = {plane: PlanePicture(1, np.full((SIDE, SIDE), 90, np.uint8), None) for plane in "ab"}
        return Picture(2 if self.held else 1, self.held, planes)

    def trace(self, after: int) -> list[TracePoint]:
        return [TracePoint(1, 0.5, (11.0, -22.0, -33.0))] if after < 1 else []

    def command(self, name: str, body: Mapping[str, Any], page: int) -> str:
        self.held = name == "hold"
        return ""

    def clicks_file(self, body: Mapping[str, Any], page: int) -> str:
        return encode_seeds_file({plane: (1, np.array(body[plane])) for plane in "ab"})

    def millimetres_per_pixel(self, page: int) -> Mapping[str, float]:
        return {"a": 0.25, "b": 0.25}

    def watch(self, on_change: Callable[[], None]) -> None:
        self._changed = on_change

    def audience(self, views: Mapping[int, PageView]) -> None:
        pass


@pytest.fixture(scope="module")
def scene() -> Scene:
    scene = Scene()
    scene.say("TRACKING")
    return scene


@pytest.fixture(scope="module")
def page(scene: Scene, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Page]:
    require_browser()
    server = WebServer(scene, port=0)
    server.start()
    try:
        with open_page(server.url, tmp_path_factory.mktemp("layout") / "profile") as opened:
            opened.wait_for_state("TRACKING")
            yield opened
    finally:
        server.stop()


@pytest.mark.parametrize("size", [(1366, 768), (400, 800)], ids=["laptop", "phone"])
def test_it_can_be_read_and_touched(page: Page, scene: Scene, size: tuple[int, int]) -> None:
    before = page.driver.get_window_size()
    page.driver.set_window_size(*size)
    try:
        scene.say("LOST", alarm="No images of plane B. The picture is old.", colour="#ff5c50")
        page.wait_for_state("LOST")
        assert page.driver.execute_script(FAINT_TEXTS) == []
        scene.say("TRACKING")
        page.wait_for_state("TRACKING")
        for key in ("s", Keys.ESCAPE):  # with a held picture, and with the stream
            page.press(key)
            page.wait_for(lambda key=key: bool(page.text("hint")) == (key == "s"), "the picture")
            assert page.driver.execute_script(SMALL_TARGETS) == []
            assert page.driver.execute_script(FAINT_TEXTS) == []
            assert cut_texts(page) == []
        assert page.driver.execute_script("return document.documentElement.scrollWidth <= innerWidth")
        if size[0] > 1000:  # on a laptop all is in sight at once
            assert (
                page.driver.execute_script(
                    "const a = document.querySelector('aside'); return a.scrollHeight - a.clientHeight"
                )
                <= 0
            )
        pinch(page, "b", 2.0)
        page.wait_for(lambda: scale(page, "b") == pytest.approx(2.0, abs=0.4), "a picture twice as large")
        pinch(page, "b", 0.2)
        page.wait_for(lambda: scale(page, "b") == 1.0, "the whole picture, and no less")
        out, _, into = page.driver.find_elements("css selector", "#plane-a .zoom button")
        page.driver.execute_script("arguments[0].scrollIntoView({ block: 'center' })", out)
        assert not out.is_enabled()
        into.click()
        assert scale(page, "a") == 1.5
        out.click()
        assert scale(page, "a") == 1.0
    finally:
        page.driver.set_window_size(before["width"], before["height"])


def test_directions_and_uncertainty_are_in_the_words_of_the_lab(page: Page) -> None:
    page.wait_for(lambda: page.text("shift-z") == "−33.0", "a pose")
    assert [page.text(f"axis-{axis}") for axis in "xyz"] == ["right", "anterior", "feet"]
    assert page.text("sigma") == "σ < 0.1"  # the longest there is
    assert page.driver.find_element("css selector", "#plane-a .angle").text == "RAO 120° CAUD 25°"
    assert page.driver.execute_script(BROKEN_LINES) == []


def test_no_reason_is_cut(page: Page, scene: Scene) -> None:
    for reason in LONG:
        scene.say("WAITING_FOR_SEED", reason, colour="#78beff")
        words = in_plain_words(reason)
        page.wait_for(lambda words=words: page.text("reason") == words, words)
        assert cut_texts(page) == []
        assert "noise" not in words
    scene.say("TRACKING")


def test_unsent_clicks_are_not_reloaded_away(page: Page) -> None:
    def leaving_is_asked() -> bool:
        script = "const e = new Event('beforeunload', { cancelable: true }); return !window.dispatchEvent(e)"
        return bool(page.driver.execute_script(script))

    page.press("s")
    page.wait_for(lambda: page.text("hint") != "", "the held picture")
    assert not leaving_is_asked()
    page.click("a", np.array([100.0, 100.0]), SIDE)
    assert leaving_is_asked()
    page.press(Keys.ESCAPE)
    page.wait_for(lambda: page.text("hint") == "", "the stream")
    assert not leaving_is_asked()


def test_a_screen_reader_hears_one_alarm_for_one_loss(page: Page, scene: Scene) -> None:
    scene.say("TRACKING")
    page.wait_for_state("TRACKING")
    page.driver.execute_script(LISTEN_LIKE_A_SCREEN_READER)
    told = [("LOST", f"no images for {age} s", "") for age in (1, 2)]
    told += [("LOST", "no images for 3 s", f"No images{which}. The picture is old.") for which in ("", " of plane B")]
    for state, reason, alarm in [*told, ("LOST", "the lasso is not seen", ""), ("TRACKING", "", "")]:
        scene.say(state, reason, alarm)
        page.wait_for(
            lambda reason=reason, alarm=alarm: (
                page.text("reason") == (in_plain_words(reason) or "The loop is followed.")
                and page.text("alarm") == alarm
            ),
            reason,
        )
    assert page.driver.execute_script("return window.heard") == [[True, "LOST"], [False, "TRACKING"]]
