"""The page in a real browser, with the real tracker behind it: clicks, loop, loss, silence."""

from __future__ import annotations

import itertools
import threading
from collections.abc import Iterator
from contextlib import contextmanager
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
from support.browser import PATIENCE_S, Page, open_page, require_browser
from support.drawn_recording import SIDE, loop, projections, shift
from support.method_inputs import draw_curve
from support.node_harness import Graph

from lasso_motion_ros.geometry.transforms import apply
from lasso_motion_ros.overlay.surface_files import write_stl
from lasso_motion_ros.overlay.triangle_mesh import TriangleMesh
from msg_adapters import topics
from msg_adapters.calibrations import encode_camera_info
from msg_adapters.images import encode_image
from msg_adapters.markers import ADD
from msg_adapters.messages import RosMessages, header_fields, stamp_to_ns
from msg_adapters.poses import decode_pose

pytestmark = [pytest.mark.ros, pytest.mark.timeout(600)]

PERIOD_S = 0.125
# While it rests. The stamps go on as before, but whatever draws and shows the pictures may catch up with the stream:
# the page shows the film alone as long as the overlay is behind it.
RESTING_PERIOD_S = 0.5
START_NS = 1_760_000_000_000_000_000
BREATH_MM = 7.0
MIDDLE, UP, DOWN = 12, 6, 18  # phases of the breath
LEGEND = np.array([0.3, 0.8]) * SIDE  # it lies left of here and below
CORNERS = 0.028 * np.array([[1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]], np.float64)
FACES = np.array([[0, 1, 2], [0, 3, 1], [0, 2, 3], [1, 3, 2]], np.int32)


class Stream:
    """Both planes' images of a ring that breathes, published until told otherwise."""

    def __init__(self, graph: Graph) -> None:
        self._publishers = {
            topic.name: graph.publisher(topic)
            for plane in "ab"
            for topic in (topics.image_topic(plane), topics.camera_info_topic(plane))
        }
        self._stop = threading.Event()
        self._thread: threading.Thread | None = None
        self._pairs = itertools.count()
        self._noise = np.random.default_rng(5).normal(0.0, 2.0, (SIDE, SIDE))
        self._phases = itertools.cycle(range(24))
        self._pictures: dict[tuple[str, int], np.ndarray] = {}
        self.visible = True
        self.held_phase: int | None = None  # where the breath is held, once it comes there
        self.resting_ns: int | None = None  # stamp of a pair since which it has rested there
        self.last_ns = 0

    def start(self) -> None:
        self._stop.clear()
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def stop(self) -> None:
        self._stop.set()
        if self._thread is not None:
            self._thread.join()

    def _run(self) -> None:
        phase = -1
        while not self._stop.wait(PERIOD_S if self.resting_ns is None else RESTING_PERIOD_S):
            if not self.visible:
                phase = -1
            elif self.held_phase is None or phase != self.held_phase:
                phase = next(self._phases)
            self.last_ns = START_NS + next(self._pairs) * round(PERIOD_S * 1e9)
            for plane in "ab":
                header = header_fields(self.last_ns, f"detector_{plane}")
                self._send(topics.camera_info_topic(plane), encode_camera_info(projections()[plane], header))
                self._send(topics.image_topic(plane), encode_image(self._picture(plane, phase), header))
            self.resting_ns = self.last_ns if phase == self.held_phase else None

    def _picture(self, plane: str, phase: int) -> np.ndarray:
        if (plane, phase) not in self._pictures:
            curve = projections()[plane].project(apply(shift(z_of(phase)), loop()))
            empty = np.full((SIDE, SIDE), 180.0)
            clean = draw_curve(curve, (SIDE, SIDE), background=180.0) if phase >= 0 else empty
            self._pictures[plane, phase] = np.clip(clean + self._noise, 0, 255).astype(np.uint8)
        return self._pictures[plane, phase]

    def _send(self, topic: topics.Topic, fields: dict) -> None:
        self._publishers[topic.name].publish(RosMessages().make(topic.type_name, fields))


def z_of(phase: int) -> float:
    return BREATH_MM * np.sin(2 * np.pi * phase / 24) if phase >= 0 else 0.0


class Stage:
    """Tracker, page and stream."""

    def __init__(self, graph: Graph, page: Page, stream: Stream) -> None:
        self.graph, self.page, self.stream = graph, page, stream

    def click_along_the_loop(self) -> None:
        """Hold a pair and click the ring as it lies in the pictures.

        The pair is one of a phase that is given: it is the reference, and where the overlay's outline comes to lie,
        beside its static one or on it, depends on that.
        """
        with self.held_breath(MIDDLE):
            self.page.press("s")
            self.page.wait_for(lambda: "Picture held" in self.page.text("alarm"), "a held picture")
        self.page.wait_for(lambda: self.ring("a") is not None, "the held picture's ring")
        for plane in "ab":
            for point in self.ring(plane)[::20]:
                self.page.click(plane, point, SIDE)

    def ring(self, plane: str) -> np.ndarray | None:
        """The ring's points at the phase whose ring is darkest in the page's own film."""
        film = self.page.pixels(plane, "film")[..., 0].astype(float)
        factor = min(film.shape) / SIDE
        curves = [projections()[plane].project(apply(shift(z_of(phase)), loop()))[:-1] for phase in range(24)]
        means = []
        for curve in curves:
            x, y = ((curve - (SIDE - 1) / 2) * factor + np.array(film.shape[::-1]) / 2).T.astype(int)
            means.append(film[y, x].mean())
        return curves[int(np.argmin(means))] if min(means) < np.median(film) - 20 else None

    @contextmanager
    def held_breath(self, phase: int) -> Iterator[int]:
        """Let the ring rest at a phase while its images go on; gives a stamp from which on it rests, ns.

        A still picture is waited for, not a certain pair: a busy machine may show any pair late, or not at all.
        """
        self.stream.resting_ns, self.stream.held_phase = None, phase
        try:
            yield self.page.wait_for(
                lambda: self.stream.held_phase == phase and self.stream.resting_ns, "a held breath"
            )
        finally:
            self.stream.held_phase = None

    def published_since(self, topic: str, stamp_ns: int, of_action: int | None = None) -> Any:
        """The last message of a topic, once one is as late as a stamp (and, of markers, of an action)."""

        def late_enough() -> list[Any]:
            return [
                message
                for message in self.graph.heard.messages[topic]
                if stamp_to_ns(message.header.stamp) >= stamp_ns and (of_action is None or message.action == of_action)
            ]

        self.graph.heard.wait_for(lambda: bool(late_enough()), PATIENCE_S)
        return late_enough()[-1]

    def outline(self, plane: str) -> np.ndarray:
        """(N, 2) image pixels where the overlay's compensated outline is green on the page's film."""
        film = self.page.pixels(plane, "film").astype(int)
        factor = min(film.shape[:2]) / SIDE
        rows, columns = np.nonzero(film[..., 1] - np.maximum(film[..., 0], film[..., 2]) > 40)
        middle = np.array(film.shape[1::-1]) / 2
        points = (np.column_stack([columns, rows]) + 0.5 - middle) / factor + (SIDE - 1) / 2
        # All else counts: how far down the outline comes depends on the phase that was clicked.
        return points[(points[:, 0] > LEGEND[0]) | (points[:, 1] < LEGEND[1])]


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
    directory = tmp_path_factory.mktemp("page")
    write_stl(directory / "tetrahedron.stl", TriangleMesh(CORNERS, FACES), "mm")
    # Rather late than with the motion of another pair: a machine that tests is busy.
    given = (f"volume_file:={directory / 'tetrahedron.stl'}", "units:=mm", "style.outline_width_px:=6.0")
    surface = [word for value in (*given, "motion_wait_s:=1.0") for word in ("-p", value)]
    with Graph((topics.CATHETER, topics.MOTION, topics.STATE), directory) as graph:
        graph.processes.start_node("tracker", "lasso_tracker")
        graph.processes.start_node("overlay", "lasso_overlay", ["--ros-args", *surface])
        graph.processes.start("web", "lasso_motion_ros.cli.main", ["web", "--port", "0"])
        graph.wait_until(lambda: "the page is at" in graph.processes.log("web"))
        url = graph.processes.log("web").partition("the page is at ")[2].split()[0]
        stream = Stream(graph)
        with open_page(url, directory / "profile") as page:
            stream.start()
            try:
                yield Stage(graph, page, stream)
            finally:
                stream.stop()


def test_clicks_start_the_tracker_and_the_loop_is_drawn_where_it_is(stage: Stage) -> None:
    page = stage.page
    page.wait_for_state("WAITING FOR SEED")
    page.wait_for(lambda: page.driver.find_element("id", "hold").is_enabled(), "images of both planes")
    stage.click_along_the_loop()
    assert page.text("alarm") == "Picture held. Enter starts the tracking."
    page.press(Keys.ENTER)
    page.wait_for_state("TRACKING")
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
    assert float(page.text("shift-z").replace("−", "-").replace("+", "")) == pytest.approx(0.0, abs=2 * BREATH_MM + 1)
    assert page.complaints() == []


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

    def grey() -> float:
        return float(np.median(page.pixels("a", "film")[..., :3].mean(axis=2)))

    stage.stream.stop()
    before = grey()
    page.press("[", "[", "[")  # the film's ground is nearly white by itself
    page.wait_for(lambda: grey() < before - 15.0, "a darker picture by keys")
    assert len(stage.outline("a")) > 200  # what is drawn keeps its colour
    page.press("w")
    page.wait_for(lambda: abs(grey() - before) < 2.0, "the first grey again")
    page.drag_right("b", 0, 120)
    page.wait_for(lambda: grey() < before - 15.0, "a darker picture by the pointer, in both planes")
    assert page.driver.find_element("id", "window-reset").is_enabled()
    page.press("w")
    page.wait_for(lambda: abs(grey() - before) < 2.0, "the first grey again")
    stage.stream.start()


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
    stage.stream.stop()
    stage.page.wait_for(lambda: stage.page.text("alarm").startswith("No images for"), "the silence")
    assert "old" in stage.page.driver.find_element("id", "plane-a").get_attribute("class")
    stage.stream.start()
    stage.page.wait_for(lambda: stage.page.text("alarm") == "", "the end of the silence")


def test_keys_alone_set_and_undo_clicks(stage: Stage) -> None:
    page = stage.page
    page.press("s")
    page.wait_for(lambda: "Picture held" in page.text("alarm"), "a held picture")
    page.press("b", Keys.ARROW_RIGHT, " ", Keys.ARROW_DOWN, " ", "a", Keys.ARROW_UP, " ")
    counts = [element.text for element in page.driver.find_elements("css selector", ".plane .count")]
    assert counts == ["1 of 6", "2 of 6"]
    page.press("z", "z")
    counts = [element.text for element in page.driver.find_elements("css selector", ".plane .count")]
    assert counts == ["0 of 6", "1 of 6"]
    assert not page.driver.find_element("id", "send").is_enabled()
    page.press("+", "+")
    assert page.driver.find_element("css selector", "#plane-a .scale").text == "1.6×"
    page.press("0", Keys.ESCAPE)
    page.wait_for(lambda: page.text("alarm") == "", "the live picture")


def test_reset_asks_twice(stage: Stage) -> None:
    page = stage.page
    page.wait_for_state("TRACKING", "DEGRADED")
    page.press("r")
    assert page.text("reset") == "R Press again"
    page.press("r")
    page.wait_for_state("WAITING FOR SEED")


def test_the_server_gone_is_said(stage: Stage, tmp_path: Path) -> None:
    import signal

    stage.graph.processes.send("web", signal.SIGINT)
    assert stage.graph.wait_for_end("web") == 0
    stage.page.wait_for_state("NO SERVER")
    assert "Connection to the server lost" in stage.page.text("alarm")
