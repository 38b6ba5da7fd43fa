"""The connection to one page: its commands come in, status, trace and pictures go out, as fast as it can draw them."""

from __future__ import annotations

import asyncio
import contextlib
import logging
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor

from aiohttp import WSCloseCode, WSMsgType, web

from lasso_motion_ros.core.errors import LassoMotionError, MessageError
from lasso_motion_ros.web.click_fit import fit_clicks
from lasso_motion_ros.web.picture_encoder import PictureEncoder
from lasso_motion_ros.web.protocol import (
    CLICKS_FILE,
    MAX_MESSAGE_BYTES,
    ClickedOutline,
    DisplaySettings,
    Request,
    Shown,
    encode,
    parse,
)
from lasso_motion_ros.web.source import Source

LOG = logging.getLogger(__name__)
SHORTEST_PAUSE_S = 0.02
HEARTBEAT_S = 10.0
SEEDS_NAME = "seeds.yaml"
SAVED = f"The clicks are in your downloads, as {SEEDS_NAME}, for lasso-motion track --seeds."
ALIVE_S = 1.0
"""A status is sent this often even if nothing has changed, so that a page knows that its server lives."""


class PageConnection:
    """One page's WebSocket; lives in the server's event loop.

    Args:
        number: of the page.
        source: what is shown.
        encoder: encodes its pictures, once for all pages.
        command_pool: threads on which commands wait for the tracker's answers.
        on_settings: called when the page wants to see something else.
        on_answer: called when a command has been carried out, for the other pages.

    Attributes:
        socket: the WebSocket.
        settings: what the page wants to see.
        heard_s: when the page last said something (`time.monotonic`).
    """

    def __init__(
        self,
        number: int,
        source: Source,
        encoder: PictureEncoder,
        command_pool: ThreadPoolExecutor,
        on_settings: Callable[[], None],
        on_answer: Callable[[], None],
    ) -> None:
        self._number, self._source, self._encoder = number, source, encoder
        self._command_pool = command_pool
        self._on_settings, self._on_answer = on_settings, on_answer
        self.socket = web.WebSocketResponse(max_msg_size=MAX_MESSAGE_BYTES, heartbeat=HEARTBEAT_S, compress=False)
        self.settings = DisplaySettings("film")
        self.heard_s = time.monotonic()
        self._news = asyncio.Event()
        self._can_take_picture = True
        self._sent_picture: tuple[int, DisplaySettings] | None = None
        self._sent_status, self._sent_status_s = "", 0.0
        self._sent_point = 0
        self._commands: set[asyncio.Task[None]] = set()
        self._farewell: tuple[int, bytes] | None = None

    def wake(self) -> None:
        """Note that there may be something new to send."""
        self._news.set()

    async def serve(self) -> None:
        """Read and write until the page disconnects."""
        self.wake()
        writer = asyncio.create_task(self._write())
        try:
            async for message in self.socket:
                if message.type is not WSMsgType.TEXT:
                    await self.socket.close(code=WSCloseCode.UNSUPPORTED_DATA, message=b"expected text")
                    break
                await self._take(message.data)
        except ConnectionError:
            pass  # it went before it had its answer
        finally:
            for task in (writer, *self._commands):
                task.cancel()
            # Also here, which `end` wakes: aiohttp itself would close what it serves, with a code that tells nothing.
            if self._farewell is not None:
                code, reason = self._farewell
                await self.socket.close(code=code, message=reason)

    async def end(self, code: int, reason: str) -> None:
        """Disconnect the page, and tell it why."""
        self._farewell = code, reason.encode()
        await self.socket.close(code=code, message=reason.encode())

    async def _take(self, text: str) -> None:
        self.heard_s = time.monotonic()
        try:
            message = parse(text)
        except MessageError as error:
            await self.socket.send_str(encode("refused", text=str(error)))
            return
        if isinstance(message, Shown):
            self._can_take_picture = True
        elif isinstance(message, DisplaySettings):
            self.settings = message
            self._on_settings()
        elif isinstance(message, ClickedOutline):
            scale = self._source.millimetres_per_pixel(self._number).get(message.plane)
            await self.socket.send_str(encode("fit", plane=message.plane, **fit_clicks(message.points, scale)))
        else:
            # As a task of its own: a service may take its time, and `shown` must get through meanwhile.
            task = asyncio.create_task(self._answer(message))
            self._commands.add(task)
            task.add_done_callback(self._commands.discard)
        self.wake()

    async def _answer(self, request: Request) -> None:
        done, text, more = True, "", {}
        try:
            text = await asyncio.get_running_loop().run_in_executor(self._command_pool, self._carry_out, request)
            if request.name == CLICKS_FILE:
                text, more = SAVED, {"file": text, "name": SEEDS_NAME}
        except LassoMotionError as error:
            done, text = False, str(error)
        except Exception as error:
            LOG.exception("command %s", request.name)
            done, text = False, f"This went wrong in the page's server; its log says more. ({type(error).__name__})"
        with contextlib.suppress(ConnectionError):
            await self.socket.send_str(encode("answer", id=request.id, done=done, text=text, **more))
        self._on_answer()

    def _carry_out(self, request: Request) -> str:
        if request.name == CLICKS_FILE:
            return self._source.clicks_file(request.body, self._number)
        return self._source.command(request.name, request.body, self._number)

    async def _write(self) -> None:
        """Send what is new: status and trace always, a picture only once the page has drawn the last one."""
        try:
            while not self.socket.closed:
                await self._news.wait()
                self._news.clear()
                await self._send_status()
                await self._send_trace()
                if self._can_take_picture:
                    await self._send_picture()
                await asyncio.sleep(SHORTEST_PAUSE_S)
        except ConnectionError:
            return
        except Exception:
            LOG.exception("a page could not be served")
            await self.socket.close(code=WSCloseCode.INTERNAL_ERROR)

    async def _send_status(self) -> None:
        status, now_s = encode("status", **self._source.status(self._number)), time.monotonic()
        if status != self._sent_status or now_s - self._sent_status_s >= ALIVE_S:
            self._sent_status, self._sent_status_s = status, now_s
            await self.socket.send_str(status)

    async def _send_trace(self) -> None:
        points = self._source.trace(self._sent_point)
        if points:
            self._sent_point = points[-1].number
            rows = [[round(one.time_s, 3), *(one.shift_mm or (None,) * 3)] for one in points]
            await self.socket.send_str(encode("trace", points=rows))

    async def _send_picture(self) -> None:
        settings = self.settings
        picture = self._source.picture(settings.view, self._number)
        if picture is None or self._sent_picture == (picture.number, settings):
            return
        self._sent_picture, self._can_take_picture = (picture.number, settings), False
        await self.socket.send_bytes(await asyncio.to_thread(self._encoder.encode, picture, settings))
