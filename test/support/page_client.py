"""A page without a browser, and a source that is as easily read: for the tests of the page's server."""

from __future__ import annotations

import asyncio
import json
import struct
import threading
from collections.abc import Callable, Mapping
from typing import Any

import aiohttp
import numpy as np

from lasso_motion_ros.core.errors import TrackingError
from lasso_motion_ros.web.server import WebServer
from lasso_motion_ros.web.source import PageView, Picture, PlanePicture, TracePoint

PATIENCE_S = 10.0


class Drawn:
    """A source whose picture is one grey value, its number."""

    def __init__(self) -> None:
        self.number = 0
        self.held = False
        self.commands: list[tuple[str, Any]] = []
        self.views: frozenset[PageView] = frozenset()
        self.no_audience = threading.Event()
        self._changed: Callable[[], None] = lambda: None

    def show(self, number: int) -> None:
        self.number = number
        self._changed()

    def status(self, page: int) -> dict[str, Any]:
        return {"state": f"number {self.number}"}

    def picture(self, view: PageView, page: int) -> Picture | None:
        if self.number == 0:
            return None
        pixels = np.full((4, 6), self.number, np.uint8)
        pixels[0] = [0, 255, 0, 255, 0, 255]
        rgb = np.repeat(pixels[..., None], 3, axis=2)
        loop = np.array([[1.0, 2.0], [3.25, 0.5]])
        plane = PlanePicture(1_760_000_000_123_456_789, pixels if view == "film" else rgb, loop)
        return Picture(self.number, self.held, {"b": plane})

    def trace(self, after: int) -> list[TracePoint]:
        points = [TracePoint(1, 0.5, (1.0, -2.0, 3.0)), TracePoint(2, 0.75, None)]
        return [point for point in points if point.number > after]

    def command(self, name: str, body: Mapping[str, Any], page: int) -> str:
        self.commands.append((name, dict(body)))
        if name == "reset":
            raise TrackingError("nobody is there")
        return f"{name} done"

    def watch(self, on_change: Callable[[], None]) -> None:
        self._changed = on_change

    def millimetres_per_pixel(self, page: int) -> Mapping[str, float]:
        return {"a": 0.25}

    def audience(self, views: Mapping[int, PageView]) -> None:
        self.views = frozenset(views.values())
        if not views:
            self.no_audience.set()


class Client:
    """A page without a browser."""

    def __init__(self, socket: Any) -> None:
        self.socket = socket
        self.heard: list[dict[str, Any]] = []
        self.pictures: list[tuple[dict[str, Any], bytes]] = []

    async def send(self, **message: Any) -> None:
        await self.socket.send_str(json.dumps(message))

    async def hear(self, until: Callable[[], Any]) -> Any:
        async with asyncio.timeout(PATIENCE_S):
            while not (found := until()):
                message = await self.socket.receive()
                if message.type is aiohttp.WSMsgType.BINARY:
                    length = struct.unpack("<I", message.data[:4])[0]
                    self.pictures.append((json.loads(message.data[4 : 4 + length]), message.data[4 + length :]))
                elif message.type is aiohttp.WSMsgType.TEXT:
                    self.heard.append(json.loads(message.data))
                else:
                    raise ConnectionError(message)
        return found

    def of(self, kind: str) -> list[dict[str, Any]]:
        return [message for message in self.heard if message["type"] == kind]


def talk(server: WebServer, conversation: Callable[[Client], Any]) -> None:
    """Hold a conversation over the WebSocket, as the page would."""

    async def run() -> None:
        async with (
            aiohttp.ClientSession() as session,
            session.ws_connect(f"{server.url}live", origin=server.url.rstrip("/")) as socket,
        ):
            await conversation(Client(socket))

    asyncio.run(run())


def get(server: WebServer, path: str = "", **headers: str) -> tuple[int, Mapping[str, str], bytes]:
    async def run() -> tuple[int, Mapping[str, str], bytes]:
        async with aiohttp.ClientSession() as session, session.get(server.url + path, headers=headers) as answer:
            return answer.status, dict(answer.headers), await answer.read()

    return asyncio.run(run())
