"""A live stream of a drawn ring whose motion is known, good or spoilt on purpose, for the tests of faults."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from lifecycle_msgs.srv import ChangeState, GetState
from std_srvs.srv import SetBool, Trigger
from support.node_harness import Graph

from lasso_motion_ros.core.share import share_file
from lasso_motion_ros.geometry.frames import PLANES, Plane
from lasso_motion_ros.stream.drawn_ring import breath_mm, ring_image, ring_projection, ring_seed
from msg_adapters import topics
from msg_adapters.calibrations import encode_camera_info
from msg_adapters.images import encode_image
from msg_adapters.messages import RosMessages, header_fields, stamp_to_ns
from msg_adapters.poses import decode_pose
from msg_adapters.seeds import encode_polygon

START_NS = 1_760_000_000_000_000_000
PERIOD_NS = 100_000_000
SIDE = 256
RIGHT_MM, WRONG_MM = 0.5, 2.0
HEARD = (topics.DIAGNOSTICS, *(topic for topic in topics.OUTPUTS if topic is not topics.STATE), topics.STATE)
SERVICES = {
    "reset": Trigger,
    "set_reference": Trigger,
    "initialize": Trigger,
    "freeze": SetBool,
    "change_state": ChangeState,
    "get_state": GetState,
}
Spoil = Callable[[dict[str, Any]], dict[str, Any] | None]
"""Fields of a message in, other fields out; None: it is not sent."""


def stamp(number: int) -> int:
    return START_NS + number * PERIOD_NS


def displacement_mm(stamp_ns: int) -> np.ndarray:
    return breath_mm(1e-9 * (stamp_ns - START_NS))


class RingStream:
    """Publishes pairs to a tracker and judges what it says."""

    def __init__(self, graph: Graph, *, reliable: bool = True, side: int = SIDE) -> None:
        self.graph, self._side = graph, side
        self._generator = np.random.default_rng(5)
        self.publishers = {
            topic.name: graph.publisher(topic, reliable=reliable or topic.type_name != topics.IMAGE_TYPE)
            for plane in PLANES
            for topic in (topics.image_topic(plane), topics.camera_info_topic(plane), topics.seed_topic(plane))
        }
        self.number = 0

    def connect(self) -> None:
        """Wait until the tracker listens to everything."""
        self.graph.wait_until(
            lambda: all(publisher.get_subscription_count() > 0 for publisher in self.publishers.values())
        )

    def listeners(self) -> dict[str, set[tuple[int, ...]]]:
        """By topic, who is known to listen: a tracker that was killed for up to 20 s longer."""
        known = self.graph.listener.node.get_subscriptions_info_by_topic
        return {name: {tuple(one.endpoint_gid) for one in known(f"/{name}")} for name in self.publishers}

    def send(self, topic: topics.Topic, fields: Mapping[str, Any]) -> None:
        self.publishers[topic.name].publish(RosMessages().make(topic.type_name, fields))

    def frame(self, plane: Plane, number: int, **keywords: Any) -> None:
        """Send one plane's calibration and image; keywords as in `drawn`."""
        for topic, fields in self.drawn(plane, number, **keywords):
            self.send(topic, fields)

    def drawn(
        self,
        plane: Plane,
        number: int,
        *,
        spoil_image: Spoil = dict,
        spoil_info: Spoil = dict,
        stamp_ns: int | None = None,
        shown_ns: int | None = None,
        projection: Any = None,
        said: Any = None,
        aside_mm: Any = (0.0, 0.0, 0.0),
    ) -> list[tuple[topics.Topic, dict[str, Any]]]:
        """One plane's calibration and image, to be sent: drawn by `projection`, as at `shown_ns`, said to be `said`.

        The ring lies `aside_mm` from its place.
        """
        projection = ring_projection(plane, self._side) if projection is None else projection
        said = projection if said is None else said
        shown = stamp(number) if shown_ns is None else shown_ns
        header = header_fields(stamp(number) if stamp_ns is None else stamp_ns, f"detector_{plane}")
        pixels = ring_image(plane, self._side, displacement_mm(shown) + aside_mm, self._generator, projection)
        both = (
            (topics.camera_info_topic(plane), spoil_info(encode_camera_info(said, header))),
            (topics.image_topic(plane), spoil_image(encode_image(pixels, header))),
        )
        return [(topic, fields) for topic, fields in both if fields is not None]

    def pairs(self, count: int, **spoils: Any) -> list[int]:
        """So many pairs more; keywords as in `drawn`, `a_…` or `b_…` for one plane only. Returns their stamps."""
        stamps = []
        for _ in range(count):
            messages = []
            for plane in PLANES:
                keywords = {name: value for name, value in spoils.items() if not name.startswith(("a_", "b_"))}
                keywords |= {name[2:]: value for name, value in spoils.items() if name.startswith(f"{plane}_")}
                messages += self.drawn(plane, self.number, **keywords)
            # Both are drawn before either is sent: what belongs together comes together, on a busy machine too.
            for topic, fields in messages:
                self.send(topic, fields)
            stamps.append(stamp(self.number))
            self.number += 1
        return stamps

    def clicks(self, at_ns: Mapping[Plane, int] | int, off_px: float = 0.0) -> None:
        """Clicks on the ring as it is at a stamp (0: as it is in the next pair), or beside it."""
        for plane in PLANES:
            stamp_ns = at_ns if isinstance(at_ns, int) else at_ns[plane]
            shown = displacement_mm(stamp_ns or stamp(self.number))
            points = ring_seed(self._side, shown).points(plane) + off_px
            self.send(topics.seed_topic(plane), encode_polygon(points, header_fields(stamp_ns)))

    def seeded(self) -> None:
        """A pair that is clicked, and two more, tracked."""
        first, *_, last = self.pairs(1) + self.pairs(2)
        self.clicks(first)
        # A topic of its own, which the first pose may overtake: it is judged by the reference that it is on.
        self.graph.heard.wait_for(lambda: self.references()[-1:] == [first])
        self.expect([first, last])

    def expect(self, stamps: list[int]) -> None:
        """Wait for the poses of these pairs, each right."""
        for at in stamps:
            self.graph.heard.wait_for(lambda at=at: at in self.errors_mm())
            error = self.errors_mm()[at]
            assert error <= RIGHT_MM, f"{error:.2f} mm off at pair {(at - START_NS) // PERIOD_NS}"

    def errors_mm(self) -> dict[int, float]:
        """How far each pose is off, by its stamp: against the truth since the reference that held when it came."""
        errors: dict[int, float] = {}
        reference_mm = np.zeros(3)
        for name, message in self.graph.heard.order:
            if name == topics.REFERENCE.name:
                reference_mm = displacement_mm(stamp_to_ns(message.stamp))
            elif name == topics.MOTION.name:
                at = stamp_to_ns(message.header.stamp)
                motion_mm = 1e3 * decode_pose(message)[:3, 3]
                errors[at] = float(np.linalg.norm(motion_mm - (displacement_mm(at) - reference_mm)))
        return errors

    def nothing_wrong(self) -> None:
        """No pose that ever came was wrong."""
        wrong = {at: error for at, error in self.errors_mm().items() if error > WRONG_MM}
        assert not wrong, wrong

    def references(self) -> list[int]:
        """Stamps of the references heard."""
        return [stamp_to_ns(message.stamp) for message in self.graph.heard.messages["reference"]]

    def states(self) -> list[str]:
        return [message.data for message in self.graph.heard.messages["state"]]

    def states_since(self, stamp_ns: int) -> list[str]:
        """States published after a pair's pose, whichever of them was heard first."""
        order = self.graph.heard.order
        (*_, posed) = (
            place
            for place, (name, message) in enumerate(order)
            if name == topics.MOTION.name and stamp_to_ns(message.header.stamp) == stamp_ns
        )
        return [message.data for name, message in order[posed + 1 :] if name == topics.STATE.name]

    def await_state(self, *states: str) -> None:
        """Wait until the tracker said one of these last: a topic of its own, which others may overtake."""
        self.graph.heard.wait_for(lambda: self.states()[-1:] in [[state] for state in states])

    def values(self, part: str) -> dict[str, str]:
        """What the diagnostics said last of `tracker`, `plane_a` or `plane_b`; its words under the key `message`."""
        return diagnosed(self.graph, part)

    def await_count(self, part: str, key: str, count: int) -> None:
        """Wait until the diagnostics have counted so far."""
        self.graph.heard.wait_for(lambda: int(self.values(part).get(key, 0)) >= count)

    def said(self, text: str) -> None:
        """Wait until the tracker's log has a text."""
        self.graph.wait_until(lambda: text in self.graph.processes.log("tracker", 500))

    def reset(self) -> None:
        assert self.graph.call(Trigger, "/lasso_tracker/reset", Trigger.Request()).success
        self.await_state("WAITING_FOR_SEED")


def diagnosed(graph: Graph, part: str) -> dict[str, str]:
    """What the diagnostics said last of a part of the tracker."""
    for message in reversed(graph.heard.messages["/diagnostics"]):
        for status in message.status:
            if status.name == f"/lasso_tracker: {part}":
                return {entry.key: entry.value for entry in status.values} | {"message": status.message}
    return {}


def start_tracker(graph: Graph, *parameters: str, name: str = "tracker", module: str = "support.brisk_tracker") -> None:
    """Start a module that is a tracker, and wait until it says a state.

    A stream that pauses is not lost here, unless the parameters say so: these streams wait for events.
    """
    for service, service_type in SERVICES.items():
        graph.client(service_type, f"/lasso_tracker/{service}")
    words = [word for parameter in ("stream_timeout_s:=600.0", *parameters) for word in ("-p", parameter)]
    arguments = ["--ros-args", "--params-file", str(share_file("config/tracker.yaml")), *words]
    before = len(graph.heard.messages["state"])
    graph.processes.start(name, module, ["lasso_tracker", *arguments])
    graph.heard.wait_for(lambda: len(graph.heard.messages["state"]) > before)
