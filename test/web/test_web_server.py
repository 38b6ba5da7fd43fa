"""The web server: who may ask, what it accepts, and that a slow page gets the newest picture, not all of them."""

from __future__ import annotations

import asyncio
import contextlib
import dataclasses
import json
import socket
import struct
import threading
from collections.abc import Callable, Iterator, Mapping
from typing import Any

import cv2
import numpy as np
import pytest

pytest.importorskip("aiohttp", reason="needs the web extra")

import aiohttp

from lasso_motion_ros.core.errors import LassoMotionError, TrackingError
from lasso_motion_ros.web import idle_connections
from lasso_motion_ros.web import server as web_server
from lasso_motion_ros.web.protocol import MAX_MESSAGE_BYTES
from lasso_motion_ros.web.server import FILES, FULL, MADE_ROOM, STATIC, WebServer
from lasso_motion_ros.web.source import PageView, Picture, PlanePicture, TracePoint

PATIENCE_S = 10.0
NEUTRAL = {"brightness": 0.0, "contrast": 1.0}


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


@pytest.fixture
def source() -> Drawn:
    return Drawn()


@pytest.fixture
def server(source: Drawn) -> Iterator[WebServer]:
    started = WebServer(source, port=0)
    started.start()
    yield started
    started.stop()


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


def test_every_file_of_the_page_is_served_and_nothing_else(server: WebServer) -> None:
    assert {str(path.relative_to(STATIC)) for path in STATIC.rglob("*") if path.is_file()} == set(FILES)
    for name, kind in FILES.items():
        status, headers, body = get(server, name)
        assert (status, headers["Content-Type"].partition(";")[0], body) == (200, kind, (STATIC / name).read_bytes())
    assert get(server)[2] == (STATIC / "index.html").read_bytes()
    for path in ("server.py", "../server.py", "%2e%2e/server.py", "vendor/", "static/index.html"):
        assert get(server, path)[0] == 404


def test_no_script_but_the_pages_own_files_may_run(server: WebServer) -> None:
    _, headers, body = get(server)
    policy = dict(part.strip().split(" ", 1) for part in headers["Content-Security-Policy"].split(";"))
    assert policy["default-src"] == "'none'"
    assert (policy["script-src"], policy["style-src"], policy["frame-ancestors"]) == ("'self'", "'self'", "'none'")
    assert headers["X-Content-Type-Options"] == "nosniff"
    assert b"http://" not in body
    assert b"https://" not in body
    scripts = b"".join((STATIC / name).read_bytes() for name in FILES if name.endswith(".js"))
    assert b"eval(" not in scripts
    assert b"new Function" not in scripts


@pytest.mark.parametrize(
    "host", ["evil.example", "evil.example:8080", "127.0.0.1.evil.example", "192.168.1.5", "", "[", "[::1", "a]:"]
)
def test_another_host_name_is_refused(server: WebServer, host: str) -> None:
    assert get(server, Host=host)[0] == 403


@pytest.mark.parametrize("host", ["localhost:1", "127.0.0.1", "[::1]:80"])
def test_names_of_this_machine_are_answered(server: WebServer, host: str) -> None:
    assert get(server, Host=host)[0] == 200


def test_a_name_that_was_foreseen_is_answered_and_an_open_server_answers_to_addresses(source: Drawn) -> None:
    server = WebServer(source, host="0.0.0.0", port=0, names=("console.lab",))  # noqa: S104
    server.start()
    try:
        assert not server.is_local
        assert get(server, Host="Console.lab:8080")[0] == 200
        assert get(server, Host="192.168.1.5")[0] == 200
        assert get(server, Host="evil.example")[0] == 403
    finally:
        server.stop()


@pytest.mark.parametrize("origin", ["http://evil.example", "null", "", "http://127.0.0.1:1", "file://", "http://["])
def test_a_page_of_another_origin_cannot_connect(server: WebServer, origin: str) -> None:
    upgrade = {"Connection": "Upgrade", "Upgrade": "websocket", "Sec-WebSocket-Version": "13"}
    status, _, _ = get(server, "live", Origin=origin, **upgrade, **{"Sec-WebSocket-Key": "AAAAAAAAAAAAAAAAAAAAAA=="})
    assert status == 403


def test_status_trace_and_picture_come_by_themselves(server: WebServer, source: Drawn) -> None:
    source.show(7)

    async def conversation(client: Client) -> None:
        await client.hear(lambda: client.pictures and client.of("trace") and client.of("status"))
        assert client.of("status")[0]["state"] == "number 7"
        assert client.of("trace")[0]["points"] == [[0.5, 1.0, -2.0, 3.0], [0.75, None, None, None]]
        header, files = client.pictures[0]
        described = header["planes"]["b"]
        assert (header["number"], header["held"], header["view"], set(header["planes"])) == (7, False, "film", {"b"})
        assert described["stamp"] == "1760000000123456789"
        assert described["loop"] == [[1.0, 2.0], [3.25, 0.5]]
        decoded = cv2.imdecode(np.frombuffer(files, np.uint8), cv2.IMREAD_UNCHANGED)
        assert decoded.shape == (described["height"], described["width"]) == (4, 6)

    talk(server, conversation)


def test_a_slow_page_gets_the_newest_picture_not_those_between(server: WebServer, source: Drawn) -> None:
    async def conversation(client: Client) -> None:
        source.show(1)
        await client.hear(lambda: client.pictures)
        for number in range(2, 40):
            source.show(number)
            await client.hear(lambda n=number: client.of("status")[-1]["state"] == f"number {n}")
        assert len(client.pictures) == 1
        await client.send(type="shown")
        await client.hear(lambda: len(client.pictures) == 2)
        assert client.pictures[-1][0]["number"] == 39

    talk(server, conversation)


def test_a_held_picture_comes_without_loss_and_as_it_is_windowed(server: WebServer, source: Drawn) -> None:
    source.held = True
    source.show(128)

    async def conversation(client: Client) -> None:
        await client.send(type="look", view="film", a=NEUTRAL, b={"brightness": 0.5, "contrast": 1.0})
        await client.hear(lambda: client.pictures)
        if len(client.pictures) == 1:
            await client.send(type="shown")
            await client.hear(lambda: len(client.pictures) == 2)
        header, files = client.pictures[-1]
        assert header["planes"]["b"]["kind"] == "png"
        # From 0 to 255 about 127.5; half of the half range brighter: 64 is black... so 128 shows as 128 + 64.
        assert cv2.imdecode(np.frombuffer(files, np.uint8), cv2.IMREAD_UNCHANGED)[2, 0] == pytest.approx(192, abs=1)

    talk(server, conversation)


def test_the_source_learns_who_looks_at_what(server: WebServer, source: Drawn) -> None:
    async def conversation(client: Client) -> None:
        await client.send(type="look", view="overlay", a=NEUTRAL, b=NEUTRAL)
        await client.send(type="save", id=1)
        await client.hear(lambda: client.of("answer"))
        assert source.views == {"overlay"}
        source.no_audience.clear()

    talk(server, conversation)
    assert source.no_audience.wait(PATIENCE_S)


def test_a_command_is_answered_with_its_words(server: WebServer, source: Drawn) -> None:
    async def conversation(client: Client) -> None:
        await client.send(type="seed", id=3, a=[[1, 2]], b=[])
        await client.hear(lambda: client.of("answer"))
        await client.send(type="reset", id=4)
        await client.hear(lambda: len(client.of("answer")) == 2)

        assert client.of("answer") == [
            {"type": "answer", "id": 3, "done": True, "text": "seed done"},
            {"type": "answer", "id": 4, "done": False, "text": "nobody is there"},
        ]

    talk(server, conversation)
    assert source.commands[0] == ("seed", {"type": "seed", "id": 3, "a": [[1, 2]], "b": []})


def test_what_is_no_message_is_refused_and_the_next_one_is_heard(server: WebServer, source: Drawn) -> None:
    async def conversation(client: Client) -> None:
        await client.socket.send_str("{")
        await client.send(type="exec", id=1)
        await client.send(type="save", id=2)
        await client.hear(lambda: client.of("answer"))
        assert len(client.of("refused")) == 2

    talk(server, conversation)
    assert [name for name, _ in source.commands] == ["save"]


def test_a_message_that_is_too_long_ends_the_connection(server: WebServer, source: Drawn) -> None:
    async def conversation(client: Client) -> None:
        await client.socket.send_str(" " * (MAX_MESSAGE_BYTES + 1))
        with pytest.raises(ConnectionError):
            await client.hear(lambda: client.socket.closed)
        assert client.socket.close_code == aiohttp.WSCloseCode.MESSAGE_TOO_BIG

    talk(server, conversation)
    assert source.commands == []


def test_a_host_that_is_none_leaves_no_traceback(server: WebServer, caplog: pytest.LogCaptureFixture) -> None:
    assert get(server, Host="[")[0] == 403
    assert caplog.records == []


def tuned(monkeypatch: pytest.MonkeyPatch, module: Any, **changes: Any) -> None:
    monkeypatch.setattr(module, "TUNING", dataclasses.replace(module.TUNING, **changes))


async def farewell(socket: Any) -> aiohttp.WSMessage:
    """How the server ends a connection."""
    async with asyncio.timeout(PATIENCE_S):
        while (message := await socket.receive()).type is not aiohttp.WSMsgType.CLOSE:
            pass
    return message


def test_one_page_too_many_is_told_so(server: WebServer, monkeypatch: pytest.MonkeyPatch) -> None:
    tuned(monkeypatch, web_server, most_pages=3)

    async def run() -> None:
        async with aiohttp.ClientSession() as session:
            origin = server.url.rstrip("/")
            sockets = [await session.ws_connect(f"{server.url}live", origin=origin) for _ in range(4)]
            end = await farewell(sockets[-1])
            assert (end.data, end.extra) == (FULL, "3 pages are open already, and all are in use: close one.")
            for socket in sockets:
                await socket.close()

    asyncio.run(run())


def test_an_idle_page_makes_room_for_another(server: WebServer, monkeypatch: pytest.MonkeyPatch) -> None:
    assert web_server.TUNING.most_pages >= 32
    tuned(monkeypatch, web_server, most_pages=2, idle_page_s=0.0)

    async def run() -> None:
        async with aiohttp.ClientSession() as session:
            origin = server.url.rstrip("/")
            idle, used, newcomer = [await session.ws_connect(f"{server.url}live", origin=origin) for _ in range(3)]
            assert (await farewell(idle)).data == MADE_ROOM
            client = Client(newcomer)
            await client.hear(lambda: client.of("status"))
            await used.close()
            await newcomer.close()

    asyncio.run(run())


def test_connections_that_ask_for_nothing_are_ended_and_a_page_is_served(
    server: WebServer, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Silent ones, ones that never end their request, and ones that are kept alive: 150 of them."""
    tuned(monkeypatch, idle_connections, request_s=1.0)
    host, port = server.url.split("/")[2].split(":")
    beginnings = (b"", b"GET / HTTP/1.1\r\nHost: loc", f"GET / HTTP/1.1\r\nHost: {host}\r\n\r\n".encode())
    with contextlib.ExitStack() as open_ones:
        silent = []
        for number in range(150):
            one = open_ones.enter_context(socket.create_connection((host, int(port)), timeout=PATIENCE_S))
            one.sendall(beginnings[number % 3])
            silent.append(one)
        assert get(server)[0] == 200
        for one in silent:
            with contextlib.suppress(ConnectionResetError):
                while one.recv(1 << 20):
                    pass


def test_a_page_that_is_served_is_no_idle_connection(
    server: WebServer, source: Drawn, monkeypatch: pytest.MonkeyPatch
) -> None:
    tuned(monkeypatch, idle_connections, request_s=0.2)

    async def conversation(client: Client) -> None:
        source.show(1)
        await client.hear(lambda: client.of("status"))
        await asyncio.sleep(0.8)
        source.show(2)
        await client.hear(lambda: client.of("status")[-1]["state"] == "number 2")

    talk(server, conversation)


def test_the_server_speaks_at_least_once_a_second(server: WebServer) -> None:
    async def conversation(client: Client) -> None:
        await client.hear(lambda: len(client.of("status")) >= 3)

    talk(server, conversation)


def test_the_ellipse_through_clicks_is_drawn_before_they_are_sent(server: WebServer) -> None:
    angles = np.linspace(0.0, 2 * np.pi, 8, endpoint=False)
    ring = np.column_stack([300 + 80 * np.cos(angles), 200 + 40 * np.sin(angles)])
    off = ring.copy()
    off[0] += [60.0, 0.0]

    async def conversation(client: Client) -> None:
        await client.send(type="fit", plane="a", points=ring.tolist())
        await client.send(type="fit", plane="b", points=off.tolist())
        await client.send(type="fit", plane="a", points=ring[:5].tolist())
        await client.hear(lambda: len(client.of("fit")) == 3)
        good, bad, few = client.of("fit")
        drawn = np.array(good["ellipse"]) - [300, 200]
        np.testing.assert_allclose((drawn[:, 0] / 80) ** 2 + (drawn[:, 1] / 40) ** 2, 1.0, atol=0.01)
        assert (good["plane"], good["clicks"], good["off"], good["doubtful"]) == ("a", 8, "0.0 mm", False)
        assert bad["off"].endswith(" px")  # plane B has no scale here
        assert bad["doubtful"]
        assert (few["ellipse"], few["off"]) == (None, "")

    talk(server, conversation)


def test_a_port_that_is_taken_is_named(server: WebServer, source: Drawn) -> None:
    port = int(server.url.rstrip("/").rpartition(":")[2])
    with pytest.raises(LassoMotionError, match=f"cannot listen on 127.0.0.1:{port}: .*choose another port with --port"):
        WebServer(source, port=port).start()


def test_it_stops_while_a_page_is_open(source: Drawn) -> None:
    server = WebServer(source, port=0)
    server.start()

    async def conversation(client: Client) -> None:
        await client.hear(lambda: client.of("status"))
        stopped = asyncio.create_task(asyncio.to_thread(server.stop))
        with pytest.raises(ConnectionError):
            await client.hear(lambda: False)
        async with asyncio.timeout(PATIENCE_S):
            await stopped

    talk(server, conversation)
