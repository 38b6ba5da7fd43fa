"""The services that the page's buttons call: the tracker's, and the overlay's parameters."""

from __future__ import annotations

import threading
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from rcl_interfaces.msg import Parameter, ParameterType, ParameterValue
from rcl_interfaces.srv import GetParameters, SetParameters
from rclpy.node import Node
from std_srvs.srv import SetBool, Trigger

from lasso_motion_ros.core.errors import TrackingError
from lasso_motion_ros.web.plain_words import in_plain_words

DRAWINGS = ("outline", "fill", "both")
DRAWING = "style.drawing"
TRIGGERS = {
    "accept": "The ring that was found is taken.",
    "next": "This ring, then?",
    "reset": "The tracker has forgotten the catheter.",
    "set_reference": "The present phase is the reference now.",
}


@dataclass(frozen=True)
class _Tuning:
    """How long is waited.

    Attributes:
        answer_wait_s: for a service's answer.
    """

    answer_wait_s: float = 3.0


TUNING = _Tuning()


class PageServices:
    """Clients of the services; a call waits for its answer in a thread of the server's, never in the executor's.

    Args:
        node: the page's node.
        tracker: the tracker's name.
        overlay: the overlay's name.
    """

    def __init__(self, node: Node, tracker: str, overlay: str) -> None:
        self._triggers = {name: node.create_client(Trigger, f"{tracker}/{name}") for name in TRIGGERS}
        self._freeze = node.create_client(SetBool, f"{tracker}/freeze")
        self._set_style = node.create_client(SetParameters, f"{overlay}/set_parameters")
        self._get_style = node.create_client(GetParameters, f"{overlay}/get_parameters")

    @property
    def can_freeze(self) -> bool:
        """Whether the tracker can hold a pair."""
        return bool(self._freeze.service_is_ready())

    def freeze(self) -> bool:
        """Let the tracker hold a pair; whether it does.

        Raises:
            TrackingError: it does not answer.
        """
        return bool(self._call(self._freeze, SetBool.Request(data=True), "the tracker").success)

    def unfreeze(self) -> None:
        """Let the tracker go on, without waiting for it."""
        if self.can_freeze:
            self._freeze.call_async(SetBool.Request(data=False))

    def trigger(self, name: str) -> str:
        """Call one of the tracker's other services; what has happened, in words.

        Raises:
            TrackingError: it refuses, or does not answer.
        """
        answer = self._call(self._triggers[name], Trigger.Request(), "the tracker")
        if not answer.success:
            raise TrackingError(in_plain_words(answer.message) or f"The tracker has refused: {name}.")
        return TRIGGERS[name]

    def set_drawing(self, drawing: str) -> None:
        """Change how the overlay draws.

        Raises:
            TrackingError: it refuses, or does not answer.
        """
        value = ParameterValue(type=ParameterType.PARAMETER_STRING, string_value=drawing)
        request = SetParameters.Request(parameters=[Parameter(name=DRAWING, value=value)])
        (result,) = self._call(self._set_style, request, "the overlay").results
        if not result.successful:
            raise TrackingError(result.reason)

    def ask_drawing(self, told: Callable[[str], None]) -> None:
        """Ask how the overlay draws; `told` is called with the answer, if there is one."""

        def pass_on(future: Any) -> None:
            answer = future.result()
            if answer is not None and answer.values and answer.values[0].string_value in DRAWINGS:
                told(answer.values[0].string_value)

        if self._get_style.service_is_ready():
            self._get_style.call_async(GetParameters.Request(names=[DRAWING])).add_done_callback(pass_on)

    def _call(self, client: Any, request: Any, what: str) -> Any:
        if not client.service_is_ready():
            raise TrackingError(f"Not done: {what} does not answer ({client.srv_name}). Is it running?")
        answered = threading.Event()
        future = client.call_async(request)
        future.add_done_callback(lambda _: answered.set())
        if not answered.wait(TUNING.answer_wait_s):
            client.remove_pending_request(future)
            raise TrackingError(f"Not done, perhaps: {what} has not answered within {TUNING.answer_wait_s:g} s.")
        return future.result()
