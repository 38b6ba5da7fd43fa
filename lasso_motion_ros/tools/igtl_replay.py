"""Sends what a tracker has published to an OpenIGTLink server, in real time."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from lasso_motion_ros.evaluation.recorded_input import read_estimates
from lasso_motion_ros.tracking.tracker import TrackerState
from msg_adapters.openigtlink import IgtlConnection, IgtlMessages

_NS = 1e-9


@dataclass(frozen=True)
class Sent:
    """What was sent.

    Attributes:
        pairs: pairs that the tracker had answered.
        states: states sent.
        transforms: motions sent.
    """

    pairs: int
    states: int
    transforms: int


def replay(
    result: Path,
    messages: IgtlMessages,
    address: tuple[str, int],
    say: Callable[[str], None],
    interrupted: threading.Event,
    *,
    rate: float = 1.0,
) -> Sent:
    """Send states and motions at the times between their stamps, once the server is there.

    Args:
        result: MCAP file or bag directory with the tracker's outputs.
        messages: packs them.
        address: of the server.
        say: takes a line for the user.
        interrupted: set it to end early.
        rate: times the recorded speed.

    Raises:
        RecordingError: the result cannot be read, or is none.
        MessageError: a pose that is not one.
    """
    estimates = read_estimates(result)
    states = transforms = 0
    with IgtlConnection(address, say) as connection:
        if not connection.wait_connected(interrupted):
            return Sent(len(estimates), 0, 0)
        begun_s, first_ns = time.monotonic(), estimates[0].stamp_ns if estimates else 0
        for estimate in estimates:
            due_s = begun_s + _NS * (estimate.stamp_ns - first_ns) / rate
            if interrupted.wait(max(0.0, due_s - time.monotonic())):
                break
            if not connection.connected:
                continue
            connection.send(messages.state_device, messages.state(estimate.state, estimate.stamp_ns))
            states += 1
            if estimate.motion is not None and TrackerState.tells_of_pose(estimate.state):
                connection.send(messages.device, messages.motion(estimate.motion, estimate.stamp_ns))
                transforms += 1
    return Sent(len(estimates), states, transforms)
