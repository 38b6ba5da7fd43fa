"""The web server's connections: how many there may be, how long they may be idle, and how they end."""

from __future__ import annotations

import asyncio
import contextlib
import dataclasses
import socket
import zlib
from typing import Any

import pytest

pytest.importorskip("aiohttp", reason="needs the web extra")

import aiohttp
from support.page_client import PATIENCE_S, Client, Drawn, get, talk

from lasso_motion_ros.web import idle_connections
from lasso_motion_ros.web import server as web_server
from lasso_motion_ros.web.protocol import MAX_MESSAGE_BYTES
from lasso_motion_ros.web.server import FULL, MADE_ROOM, WebServer


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


@pytest.mark.parametrize(
    "request_line",
    [
        b"GET / HTTP/9.9\r\n\r\n",
        b"GET / HTTP/1.1\r\nContent-Length: -1\r\n\r\n",
        b"GET / HTTP/1.1\r\nHost: [\r\nX: " + 9000 * b"x" + b"\r\n\r\n",
        b"POST / HTTP/1.1\r\nTransfer-Encoding: chunked\r\n\r\nFFFFFFFFFFFFFFFFF\r\n",
        b"\x16\x03\x01\x02\x00\x01",  # https
    ],
)
def test_what_is_no_request_is_answered_and_leaves_no_traceback(
    server: WebServer, caplog: pytest.LogCaptureFixture, request_line: bytes
) -> None:
    host, port = server.url.split("/")[2].split(":")
    with socket.create_connection((host, int(port)), timeout=PATIENCE_S) as one:
        one.sendall(request_line)
        answer = b""
        with contextlib.suppress(ConnectionResetError):
            while part := one.recv(1 << 16):
                answer += part
    assert answer.split(b" ")[1] in (b"400", b"403")
    assert not caplog.records
    assert get(server)[0] == 200


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


def test_a_message_that_is_too_long_ends_the_connection(server: WebServer, source: Drawn) -> None:
    async def conversation(client: Client) -> None:
        await client.socket.send_str(" " * (MAX_MESSAGE_BYTES + 1))
        with pytest.raises(ConnectionError):
            await client.hear(lambda: client.socket.closed)
        assert client.socket.close_code == aiohttp.WSCloseCode.MESSAGE_TOO_BIG

    talk(server, conversation)
    assert source.commands == []


def frame(first: int, length: bytes, payload: bytes = b"") -> bytes:
    """A client's WebSocket frame (RFC 6455, section 5.2): its first byte, its length as it claims, masked by zeros."""
    return bytes([first]) + length + bytes(4) + payload


FRAMES = {
    "claims 2^62 bytes": frame(0x81, b"\xff" + (1 << 62).to_bytes(8, "big")),
    "packed, though nobody offered that": frame(0xC1, b"\xfe\xff\xff", zlib.compress(bytes(60_000_000), 9)[2:]),
    "a reserved bit": frame(0xF1, b"\x82", b"{}"),
    "an opcode that is none": frame(0x85, b"\x80"),
    "a ping that is too long": frame(0x89, b"\xfe\x00\xc8", bytes(200)),
    "no text": frame(0x81, b"\x82", b"\xff\xfe"),
}


@pytest.mark.parametrize("sent", FRAMES.values(), ids=FRAMES)
def test_what_is_no_frame_ends_its_connection_alone(
    server: WebServer, caplog: pytest.LogCaptureFixture, sent: bytes
) -> None:
    host, port = server.url.split("/")[2].split(":")
    asked = {
        "Host": f"{host}:{port}", "Origin": server.url.rstrip("/"), "Upgrade": "websocket", "Connection": "Upgrade",
        "Sec-WebSocket-Version": "13", "Sec-WebSocket-Key": "AAAAAAAAAAAAAAAAAAAAAA==",
    }  # fmt: skip
    with socket.create_connection((host, int(port)), timeout=PATIENCE_S) as one:
        lines = "".join(f"{name}: {value}\r\n" for name, value in asked.items())
        one.sendall(f"GET /live HTTP/1.1\r\n{lines}\r\n".encode())
        assert one.recv(1 << 16).startswith(b"HTTP/1.1 101 ")
        with contextlib.suppress(ConnectionError):
            one.sendall(sent)
            while one.recv(1 << 16):
                pass
    assert not caplog.records
    assert get(server)[0] == 200


def test_the_server_speaks_at_least_once_a_second(server: WebServer) -> None:
    async def conversation(client: Client) -> None:
        await client.hear(lambda: len(client.of("status")) >= 3)

    talk(server, conversation)


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
