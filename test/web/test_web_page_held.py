"""The page beside a source that is slow to show what it holds: no ROS, and a browser."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest

pytest.importorskip("aiohttp", reason="needs the web extra")
pytest.importorskip("selenium", reason="needs the dev extra")

from support.browser import Page, open_page, require_browser

from lasso_motion_ros.web.server import WebServer
from lasso_motion_ros.web.source import PageView, Picture, PlanePicture, TracePoint

pytestmark = pytest.mark.timeout(600)

SIDE = 256
TURN = np.linspace(0.0, 2.0 * np.pi, 60)
RING = 128.0 + 60.0 * np.column_stack([np.cos(TURN), np.sin(TURN)])
PROPOSAL_COLOUR = (51, 230, 255)


class Laggard:
    """A source that says at once that it holds; its held picture comes when it is let. It may propose a ring."""

    def __init__(self) -> None:
        self.held = self.let = False
        self.proposes, self.state = 0, "WAITING_FOR_SEED"  # rings
        self.commands: list[str] = []
        self._changed: Callable[[], None] = lambda: None

    def status(self, page: int) -> dict[str, Any]:
        both = dict.fromkeys("ab")
        said = {"mode": "live", "state": self.state, "reason": "", "has_pose": False, "stopped_s": both}
        seen = {"seen": dict.fromkeys("ab", True), "calibrated": dict.fromkeys("ab", True), "alarm": ""}
        said |= {"proposed": self.proposes if not self.held else 0}
        return {**said, **seen, "held": self.held, "overlay": False, "drawing": None, "clicks": 6, "colour": "#aaaaaa"}

    def picture(self, view: PageView, page: int) -> Picture:
        pixels = np.full((SIDE, SIDE), 90, np.uint8)
        ring = RING if self.proposes else None
        planes = {plane: PlanePicture(1, pixels, ring) for plane in "ab"}
        return Picture(2 if self.let else 1, self.let, planes)

    def trace(self, after: int) -> list[TracePoint]:
        return []

    def command(self, name: str, body: Mapping[str, Any], page: int) -> str:
        self.commands.append(name)
        self.held = name == "hold"
        return {"hold": "It is held.", "next": "This one?"}.get(name, "It is taken.")

    def watch(self, on_change: Callable[[], None]) -> None:
        self._changed = on_change

    def millimetres_per_pixel(self, page: int) -> Mapping[str, float]:
        return {"a": 0.25}

    def audience(self, views: Mapping[int, PageView]) -> None:
        pass

    def let_it_come(self) -> None:
        self.let = True
        self._changed()


def test_the_picture_is_clicked_once_the_held_one_is_on_the_screen(tmp_path: Path) -> None:
    """The word that it is held comes before it: a click before that would be on another pair's picture."""
    require_browser()
    source = Laggard()
    server = WebServer(source, port=0)
    server.start()
    try:
        with open_page(server.url, tmp_path / "profile") as page:
            page.wait_for(lambda: np.any(page.pixels("a", "film")), "the film")
            page.wait_for(lambda: page.driver.find_element("id", "hold").is_enabled(), "images of both planes")
            page.press("s")
            page.wait_for(lambda: "the held picture" in page.text("detail"), "the word that it is held")
            assert page.text("hint") == ""
            source.let_it_come()
            page.wait_for(lambda: page.text("hint").startswith("Picture held"), "the held picture")
            page.click("a", np.array([100.0, 100.0]), SIDE)
            assert page.text("hint").endswith("5 more in plane A, 6 more in plane B.")
            assert asks_before_reload(page)
            server.stop()
            page.wait_for(
                lambda: "Press S and click again" in page.text("message-text"), "the word that the clicks are lost"
            )
            assert not asks_before_reload(page)  # there is nothing left that could be lost
    finally:
        server.stop()


def test_a_proposed_ring_is_drawn_n_asks_for_the_next_enter_takes_it_and_s_sets_clicks(tmp_path: Path) -> None:
    require_browser()
    source = Laggard()
    source.proposes = 2
    server = WebServer(source, port=0)
    server.start()
    try:
        with open_page(server.url, tmp_path / "profile") as page:
            page.wait_for(lambda: all(is_ring_drawn(page, plane) for plane in "ab"), "the ring")
            assert page.text("reason") == "2 rings are found: is this one the lasso?"
            assert page.text("detail") == "Press Enter to take it, N for the next, or S to set clicks."
            page.press("n")
            page.wait_for(lambda: page.text("message-text") == "This one?", "the next ring's answer")
            source.proposes = 1
            page.wait_for(lambda: page.text("reason") == "A ring is found: is it the lasso?", "the only ring")
            assert "N for" not in page.text("detail")
            assert not page.driver.find_element("id", "another").is_displayed()
            source.state = "DISPLACED"  # there is a model, which nobody leaves unawares
            page.wait_for(lambda: "its picture is the new reference" in page.text("detail"), "what Enter means")
            assert page.text("reason") == "A ring is found: is it the lasso?"
            assert is_ring_drawn(page, "a")
            page.press("\ue007")  # Enter
            page.wait_for(lambda: page.text("message-text") == "It is taken.", "the answer")
            page.press("s")
            page.wait_for(lambda: not is_ring_drawn(page, "a"), "the held picture without a ring")
            assert source.commands == ["next", "accept", "hold"]
    finally:
        server.stop()


def is_ring_drawn(page: Page, plane: str) -> bool:
    """Whether a plane's canvas has the proposal's colour."""
    marks = page.pixels(plane, "marks").astype(int)
    return bool((np.abs(marks[..., :3] - PROPOSAL_COLOUR).max(axis=2) + 255 - marks[..., 3] < 30).sum() > 50)


def asks_before_reload(page: Page) -> bool:
    leave = "return window.dispatchEvent(new Event('beforeunload', { cancelable: true }))"
    return not page.driver.execute_script(leave)
