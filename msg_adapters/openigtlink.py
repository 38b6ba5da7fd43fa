"""Motion and state as OpenIGTLink messages, and the connection by which they go to a server (3D Slicer, Plus).

The messages are packed by pyigtl. Its client is not used: it gives up a connection that takes longer than 10 ms to
come about, does not notice that the server is gone, prints tracebacks, and sends after a reconnection what has become
old meanwhile.
"""

from __future__ import annotations

import select
import socket
import threading
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from lasso_motion_ros.core.errors import ConfigurationError, LassoMotionError
from lasso_motion_ros.geometry.patient_axes import SUPINE, patient_axes
from msg_adapters.messages import NANOSECONDS

Array = npt.NDArray[np.float64]

DEFAULT_PORT = 18944
"""The port registered for OpenIGTLink."""
LONGEST_NAME = 20 - len("State")
"""Letters of a device's name: the protocol's field has 20, and the state's device is named after the motion's."""


@dataclass(frozen=True)
class _Tuning:
    """How the connection is kept.

    Attributes:
        connect_s: the longest wait for a server to answer.
        send_s: the longest wait for a server to take a message; one that takes longer hangs.
        retry_s: between two attempts to connect.
        look_s: between two looks at whether the server has gone.
    """

    connect_s: float = 3.0
    send_s: float = 2.0
    retry_s: float = 0.5
    look_s: float = 0.1


_TUNING = _Tuning()


def motion_in_ras(motion: Array, axes: Array) -> Array:
    """(4, 4) T in RAS and millimetres, about the world's origin, of T in the world and metres.

    Args:
        motion: (4, 4) T with p_now = T · p_reference, world metres.
        axes: (3, 3) rotation from the world to RAS.
    """
    turned = np.eye(4)
    turned[:3, :3] = axes @ motion[:3, :3] @ axes.T
    turned[:3, 3] = 1e3 * axes @ motion[:3, 3]
    return turned


class IgtlMessages:
    """Packs motion and state.

    Args:
        device: name of the TRANSFORM's device; the STRING's is `<device>State`.
        axes: as in `patient_axes`.

    Attributes:
        state_device: name of the STRING's device.

    Raises:
        ConfigurationError: a name that the protocol cannot carry, or wrong axes.
        LassoMotionError: pyigtl is not installed.
    """

    def __init__(self, device: str = "LassoMotion", axes: str = SUPINE) -> None:
        if not (0 < len(device) <= LONGEST_NAME and device.isascii() and device.isprintable()):
            raise ConfigurationError(f"device: expected 1 to {LONGEST_NAME} ASCII letters, found {device!r}")
        self._library = _pyigtl()
        self._axes = patient_axes(axes)
        self.device, self.state_device = device, f"{device}State"

    def motion(self, motion: Array, stamp_ns: int) -> bytes:
        """A TRANSFORM in RAS and millimetres.

        Args:
            motion: (4, 4) T with p_now = T · p_reference, world metres.
            stamp_ns: plane A's exposure.
        """
        matrix = motion_in_ras(motion, self._axes)
        return self._packed(self._library.TransformMessage(matrix, stamp_ns / NANOSECONDS, self.device))

    def state(self, state: str, stamp_ns: int) -> bytes:
        """A STRING with the state; `stamp_ns` is when it was said."""
        return self._packed(self._library.StringMessage(state, stamp_ns / NANOSECONDS, self.state_device))

    @staticmethod
    def _packed(message: Any) -> bytes:
        return bytes(message.pack())


def _pyigtl() -> Any:
    try:
        import pyigtl
    except ImportError as error:
        raise LassoMotionError("pyigtl is not installed: pip install pyigtl (or the extra [igtl])") from error
    return pyigtl


def server_address(text: str) -> tuple[str, int]:
    """Host and port of `HOST:PORT` or `HOST`; an IPv6 address stands in brackets.

    Raises:
        ConfigurationError: no host, or no port from 1 to 65535.
    """
    host, separator, port = text.strip().rpartition(":")
    if not separator or text.endswith("]"):
        host, port = text.strip(), str(DEFAULT_PORT)
    host = host.removeprefix("[").removesuffix("]")
    try:
        host.encode("idna")  # as the connection does
        if host and port.isdecimal() and 1 <= int(port) <= 65535:
            return host, int(port)
    except UnicodeError:
        pass
    raise ConfigurationError(f"expected HOST:PORT of an OpenIGTLink server, found {text!r}")


class IgtlConnection:
    """Keeps a connection to a server, in a thread of its own, and sends the newest of each device; a context manager.

    Nothing that has become old is sent: while there is no server nothing waits for one, and a message that could not
    be sent gives way to the next of its device.

    Args:
        address: host and port.
        say: takes a line for the user: connected, lost, cannot be reached. Called in the connection's thread.
    """

    def __init__(self, address: tuple[str, int], say: Callable[[str], None]) -> None:
        self._address, self._say = address, say
        self._name = f"{address[0]}:{address[1]}"
        self._waiting: dict[str, bytes] = {}
        self._changed = threading.Condition()
        self._connected = self._stopping = False
        self._complaint = ""
        self._thread = threading.Thread(target=self._run, name="openigtlink", daemon=True)

    def __enter__(self) -> IgtlConnection:
        self.start()
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    @property
    def connected(self) -> bool:
        """Whether there is a server."""
        return self._connected

    def start(self) -> None:
        """Begin to look for the server."""
        self._thread.start()

    def close(self) -> None:
        """Send what waits, and end the connection."""
        with self._changed:
            self._stopping = True
            self._changed.notify()
        if self._thread.is_alive():
            self._thread.join()

    def send(self, device: str, message: bytes) -> None:
        """Have a message sent, instead of one of the same device that still waits; does not wait."""
        with self._changed:
            if self._connected:
                self._waiting.pop(device, None)  # what is sent comes in the order in which it came about
                self._waiting[device] = message
                self._changed.notify()

    def withdraw(self, device: str) -> None:
        """Do not send what waits of a device."""
        with self._changed:
            self._waiting.pop(device, None)

    def wait_connected(self, stop: threading.Event) -> bool:
        """Wait for the server, or until `stop` is set; whether it is there."""
        while not self._connected and not stop.wait(_TUNING.look_s):
            pass
        return self._connected

    def _run(self) -> None:
        while not self._stopping:
            try:
                with socket.create_connection(self._address, timeout=_TUNING.connect_s) as server:
                    self._serve(server)
            except OSError as error:
                self._complain(error)
            with self._changed:
                self._connected = False
                self._waiting.clear()
                if not self._stopping:
                    self._changed.wait(_TUNING.retry_s)

    def _serve(self, server: socket.socket) -> None:
        server.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        server.settimeout(_TUNING.send_s)
        self._complaint = ""
        self._say(f"connected to {self._name}")
        with self._changed:
            self._connected = True
        while True:
            with self._changed:
                if not self._waiting and not self._stopping:
                    self._changed.wait(_TUNING.look_s)
                messages = list(self._waiting.values())
                self._waiting.clear()
                stopping = self._stopping
            _read_away(server)
            for message in messages:
                server.sendall(message)
            if stopping:
                return

    def _complain(self, error: OSError) -> None:
        reason = error.strerror or str(error) or type(error).__name__
        if self._connected:
            words = f"the connection to {self._name} is lost ({reason}); trying again"
        else:
            words = f"cannot reach {self._name} ({reason}); trying again"
        if words != self._complaint:
            self._complaint = words
            self._say(words)


def _read_away(server: socket.socket) -> None:
    """Take what the server says, which is of no use here.

    Raises:
        ConnectionError: it has closed the connection.
    """
    heard = select.poll()
    heard.register(server, select.POLLIN)
    while heard.poll(0):
        if not server.recv(65536):
            raise ConnectionResetError("closed by the server")
