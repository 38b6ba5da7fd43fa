"""A real Chromium without a window, for the tests of the page."""

from __future__ import annotations

import os
import shutil
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pytest

PATIENCE_S = 60.0
LOOP_COLOUR = (255, 226, 64)
# A ROS installation's own libraries, and the mark that they have been set up, are not for a foreign program.
ROS_ONLY = ("LD_LIBRARY_PATH", "LD_PRELOAD", "_ROS_WHEELS_BOOTSTRAP_COMPLETE", "PYTHONPATH")
FLAGS = (
    "--headless",
    "--no-sandbox",
    "--disable-gpu",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
    "--force-device-scale-factor=1",
    "--window-size=1366,768",
)


def require_browser() -> tuple[str, str]:
    """Paths of Chromium and its driver; skips the test where there are none, unless REQUIRE_BROWSER is set."""
    found = shutil.which("chromium") or shutil.which("google-chrome") or shutil.which("chromium-browser")
    driver = shutil.which("chromedriver")
    if found is None or driver is None:
        reason = "no Chromium with driver here; on Debian: apt-get install chromium chromium-driver"
        if os.environ.get("REQUIRE_BROWSER"):
            pytest.fail(reason)
        pytest.skip(reason)
    return found, driver


class Page:
    """The page in a browser, and what can be seen on it."""

    def __init__(self, driver: Any) -> None:
        self.driver = driver

    def text(self, name: str) -> str:
        """What an element says; empty while it is hidden."""
        return str(self.driver.find_element("id", name).text)

    def press(self, *keys: str) -> None:
        from selenium.webdriver import ActionChains

        ActionChains(self.driver).send_keys(*keys).perform()

    def wait_for(self, what: Callable[[], Any], why: str = "", patience_s: float = PATIENCE_S) -> Any:
        deadline = time.monotonic() + patience_s
        while not (found := what()):
            if time.monotonic() > deadline:
                seen: dict[str, Any] = {
                    name: self.text(name) for name in ("state", "reason", "detail", "alarm", "hint", "message-text")
                }
                seen["planes"] = [one.text for one in self.driver.find_elements("css selector", ".plane .caption")]
                seen["drawing"] = self.driver.find_element("id", "drawing").get_attribute("value")
                raise AssertionError(f"not seen within {patience_s:g} s: {why}; the page says {seen}")
            time.sleep(0.05)
        return found

    def wait_for_state(self, *states: str, patience_s: float = PATIENCE_S) -> None:
        self.wait_for(lambda: self.text("state") in states, f"state {states}", patience_s)

    def pixels(self, plane: str, layer: str) -> np.ndarray:
        """(H, W, 4) uint8 of one canvas of a plane: `film` or `marks`."""
        script = (
            "const c = document.querySelector(`#plane-${arguments[0]} canvas.${arguments[1]}`);"
            "return [c.width, c.height, c.toDataURL('image/png').split(',')[1]];"
        )
        import base64

        import cv2

        _, _, data = self.driver.execute_script(script, plane, layer)
        decoded = cv2.imdecode(np.frombuffer(base64.b64decode(data), np.uint8), cv2.IMREAD_UNCHANGED)
        assert decoded is not None
        return cv2.cvtColor(decoded, cv2.COLOR_BGRA2RGBA)

    def loop_pixels(self, plane: str, side: int, colour: tuple[int, int, int] = LOOP_COLOUR) -> np.ndarray:
        """(N, 2) where the page has drawn the loop, in pixels of an image of `side`², fitted whole into the canvas."""
        marks = self.pixels(plane, "marks").astype(int)
        close = (np.abs(marks[..., :3] - colour).max(axis=2) < 60) & (marks[..., 3] > 200)
        height, width = close.shape
        rows, columns = np.nonzero(close)
        factor = min(height, width) / side
        # A canvas pixel's centre is half a pixel from its corner, an image pixel's centre has whole coordinates.
        return np.column_stack(
            [
                (columns + 0.5 - width / 2) / factor + (side - 1) / 2,
                (rows + 0.5 - height / 2) / factor + (side - 1) / 2,
            ]
        )

    def click(self, plane: str, point: np.ndarray, side: int) -> None:
        """Click at a pixel of the image, with the whole image on show."""
        from selenium.webdriver import ActionChains

        canvas = self.driver.find_element("css selector", f"#plane-{plane} canvas.marks")
        size = canvas.size
        x, y = (np.asarray(point) - (side - 1) / 2) * min(size["width"], size["height"]) / side
        ActionChains(self.driver, duration=0).move_to_element_with_offset(canvas, round(x), round(y)).click().perform()

    def drag_right(self, plane: str, x: int, y: int) -> None:
        """Drag with the right button from a plane's middle, by screen pixels."""
        from selenium.webdriver import ActionChains
        from selenium.webdriver.common.actions.mouse_button import MouseButton

        canvas = self.driver.find_element("css selector", f"#plane-{plane} canvas.marks")
        chain = ActionChains(self.driver, duration=50).move_to_element(canvas)
        chain.w3c_actions.pointer_action.pointer_down(MouseButton.RIGHT)
        chain.w3c_actions.pointer_action.move_by(x, y)
        chain.w3c_actions.pointer_action.pointer_up(MouseButton.RIGHT)
        chain.perform()

    def complaints(self) -> list[str]:
        """What the browser's console holds against the page."""
        return [entry["message"] for entry in self.driver.get_log("browser") if "WebSocket" not in entry["message"]]

    def screenshot(self, path: Path) -> None:
        self.driver.save_screenshot(str(path))


@contextmanager
def open_page(url: str, profile: Path) -> Iterator[Page]:
    """A browser of its own, with a fresh profile, that shows a page; what it downloads goes beside the profile."""
    chromium, chromedriver = require_browser()
    from selenium import webdriver
    from selenium.webdriver.chrome.service import Service

    options = webdriver.ChromeOptions()
    options.binary_location = chromium
    for flag in (*FLAGS, f"--user-data-dir={profile}"):
        options.add_argument(flag)
    options.set_capability("goog:loggingPrefs", {"browser": "ALL"})
    environment = {name: value for name, value in os.environ.items() if name not in ROS_ONLY}
    driver = webdriver.Chrome(options=options, service=Service(chromedriver, env=environment))
    try:
        driver.execute_cdp_cmd("Page.setDownloadBehavior", {"behavior": "allow", "downloadPath": str(profile.parent)})
        driver.get(url)
        yield Page(driver)
    finally:
        driver.quit()
