"""pyigtl's own server, as an independent peer on loopback that keeps everything it was sent."""

from __future__ import annotations

import signal
import time
from collections.abc import Callable
from typing import Any, Self

import pyigtl

PATIENCE_S = 60.0


class IgtlPeer:
    """A server whose received messages are kept in their order; a context manager. Made in the main thread.

    Args:
        port: 0 for any free one.
    """

    def __init__(self, port: int = 0) -> None:
        handlers = {number: signal.getsignal(number) for number in (signal.SIGTERM, signal.SIGINT)}
        self._server = pyigtl.OpenIGTLinkServer(port=port, start_now=False)
        for number, handler in handlers.items():  # the library takes them for itself
            signal.signal(number, handler)
        self.port = self._server.server_address[1]
        self.got: list[Any] = []
        self._server.incoming_messages = _Kept(self.got)
        self._server.start()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._server.stop()

    def words(self) -> list[str]:
        """The states received."""
        return [one.string for one in self.got if one.message_type == "STRING"]

    def transforms(self) -> list[Any]:
        """The TRANSFORM messages received."""
        return [one for one in self.got if one.message_type == "TRANSFORM"]

    def wait_for(self, what: Callable[[], bool]) -> None:
        deadline = time.monotonic() + PATIENCE_S
        while not what():
            assert time.monotonic() < deadline, f"did not happen; received {self.words()} and {len(self.transforms())}"
            time.sleep(0.01)


class _Kept(dict):  # type: ignore[type-arg]
    """The library keeps one message a device; this keeps all, beside it."""

    def __init__(self, kept: list[Any]) -> None:
        super().__init__()
        self._kept = kept

    def __setitem__(self, device: str, message: Any) -> None:
        self._kept.append(message)
        super().__setitem__(device, message)
