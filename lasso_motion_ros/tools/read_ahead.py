"""Reads a recording a few messages ahead of those who use them."""

from __future__ import annotations

import queue
import threading
from collections.abc import Iterable, Iterator

from msg_adapters.recordings.reader import RawMessage


class ReadAhead:
    """Reads messages in a thread of its own, a few ahead, so that unpacking a chunk delays no message.

    Args:
        messages: what to read.
        depth: how many to keep ready.
    """

    def __init__(self, messages: Iterable[RawMessage], depth: int) -> None:
        self._messages = messages
        self._ready: queue.Queue[RawMessage | Exception | None] = queue.Queue(depth)
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._read, name="read-ahead", daemon=True)

    def __enter__(self) -> ReadAhead:
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._stop.set()
        while self._thread.is_alive():
            while not self._ready.empty():
                self._ready.get_nowait()
            self._thread.join(0.01)

    def __iter__(self) -> Iterator[RawMessage]:
        while (item := self._ready.get()) is not None:
            if isinstance(item, Exception):
                raise item
            yield item

    def _read(self) -> None:
        try:
            for message in self._messages:
                self._ready.put(message)
                if self._stop.is_set():
                    return
        except Exception as error:
            self._ready.put(error)
        self._ready.put(None)
