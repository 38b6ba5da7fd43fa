"""A stage for the tests of the page: a tracker, an overlay, a page in a real browser, and a ring that breathes."""

from __future__ import annotations

import itertools
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
from support.browser import PATIENCE_S, Page, open_page
from support.drawn_recording import SIDE, loop, projections, shift
from support.method_inputs import draw_curve
from support.node_harness import Graph

from lasso_motion_ros.geometry.transforms import apply
from lasso_motion_ros.overlay.surface_files import write_stl
from lasso_motion_ros.overlay.triangle_mesh import TriangleMesh
from msg_adapters import topics
from msg_adapters.calibrations import encode_camera_info
from msg_adapters.images import encode_image
from msg_adapters.messages import RosMessages, header_fields, stamp_to_ns

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
        self._pictures: dict[tuple[str, int, int], np.ndarray] = {}
        self.visible = True
        self.planes = "ab"  # whose images are sent
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
            number = next(self._pairs)
            self.last_ns = START_NS + number * round(PERIOD_S * 1e9)
            for plane in self.planes:
                header = header_fields(self.last_ns, f"detector_{plane}")
                self._send(topics.camera_info_topic(plane), encode_camera_info(projections()[plane], header))
                self._send(topics.image_topic(plane), encode_image(self._picture(plane, phase, number % 2), header))
            self.resting_ns = self.last_ns if phase == self.held_phase else None

    def _picture(self, plane: str, phase: int, number: int) -> np.ndarray:
        """Of a phase, in one of two noises: equal pictures would be one that is held."""
        if (plane, phase, number) not in self._pictures:
            curve = projections()[plane].project(apply(shift(z_of(phase)), loop()))
            empty = np.full((SIDE, SIDE), 180.0)
            clean = draw_curve(curve, (SIDE, SIDE), background=180.0) if phase >= 0 else empty
            noisy = clean + np.roll(self._noise, number)
            self._pictures[plane, phase, number] = np.clip(noisy, 0, 255).astype(np.uint8)
        return self._pictures[plane, phase, number]

    def _send(self, topic: topics.Topic, fields: dict) -> None:
        self._publishers[topic.name].publish(RosMessages().make(topic.type_name, fields))


def z_of(phase: int) -> float:
    return BREATH_MM * np.sin(2 * np.pi * phase / 24) if phase >= 0 else 0.0


class Stage:
    """Tracker, page and stream."""

    def __init__(self, graph: Graph, page: Page, stream: Stream, directory: Path) -> None:
        self.graph, self.page, self.stream = graph, page, stream
        self.directory = directory  # where the browser's downloads go, too

    def click_along_the_loop(self) -> None:
        """Hold a pair and click the ring as it lies in the pictures.

        The pair is one of a phase that is given: it is the reference, and where the overlay's outline comes to lie,
        beside its static one or on it, depends on that.
        """
        with self.held_breath(MIDDLE):
            self.page.press("s")
            self.page.wait_for(lambda: "Picture held" in self.page.text("hint"), "a held picture")
        self.page.wait_for(lambda: self.ring("a") is not None, "the held picture's ring")
        for plane in "ab":
            for point in self.ring(plane)[::20]:
                self.page.click(plane, point, SIDE)

    def start_tracking(self) -> None:
        """Click along the loop, and wait until it is followed."""
        self.page.wait_for_state("WAITING FOR SEED")
        self.page.wait_for(lambda: self.page.driver.find_element("id", "hold").is_enabled(), "images of both planes")
        self.click_along_the_loop()
        self.page.press("\ue007")  # Enter
        self.page.wait_for_state("TRACKING")

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


@contextmanager
def open_stage(directory: Path, tracker_module: str = "support.brisk_tracker") -> Iterator[Stage]:
    """Start all of it; `tracker_module` is run with the argument `lasso_tracker`."""
    write_stl(directory / "tetrahedron.stl", TriangleMesh(CORNERS, FACES), "mm")
    # Rather late than with the motion of another pair: a machine that tests is busy.
    given = (f"volume_file:={directory / 'tetrahedron.stl'}", "units:=mm", "style.outline_width_px:=6.0")
    surface = [word for value in (*given, "motion_wait_s:=1.0") for word in ("-p", value)]
    with Graph((topics.CATHETER, topics.MOTION, topics.STATE), directory) as graph:
        graph.processes.start("tracker", tracker_module, ["lasso_tracker"])
        graph.processes.start_node("overlay", "lasso_overlay", ["--ros-args", *surface])
        graph.processes.start("web", "lasso_motion_ros.cli.main", ["web", "--port", "0"])
        graph.wait_until(lambda: "the page is at" in graph.processes.log("web"))
        url = graph.processes.log("web").partition("the page is at ")[2].split()[0]
        stream = Stream(graph)
        with open_page(url, directory / "profile") as page:
            stream.start()
            try:
                yield Stage(graph, page, stream, directory)
            finally:
                stream.stop()
