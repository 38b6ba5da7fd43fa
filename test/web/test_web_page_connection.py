"""What goes between a page and its server: the newest picture, not all of them; commands and their answers."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

pytest.importorskip("aiohttp", reason="needs the web extra")

from support.page_client import PATIENCE_S, Client, Drawn, talk

from lasso_motion_ros.web.page_connection import PageConnection
from lasso_motion_ros.web.server import WebServer

NEUTRAL = {"brightness": 0.0, "contrast": 1.0}


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


def test_a_page_that_goes_before_it_has_its_answer_leaves_no_traceback(
    server: WebServer, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    async def gone(self: PageConnection, text: str) -> None:
        raise ConnectionResetError("Cannot write to closing transport")

    monkeypatch.setattr(PageConnection, "_take", gone)

    async def conversation(client: Client) -> None:
        await client.send(type="shown")
        with pytest.raises(ConnectionError):
            await client.hear(lambda: client.socket.closed)

    talk(server, conversation)
    assert not caplog.records


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
