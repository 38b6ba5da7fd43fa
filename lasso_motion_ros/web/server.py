"""The web server: one page, its files, and a WebSocket for each page that is open."""

from __future__ import annotations

import asyncio
import contextlib
import ipaddress
import itertools
import logging
import socket
import threading
import time
from collections.abc import Awaitable, Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from urllib.parse import urlsplit

from lasso_motion_ros.core.errors import LassoMotionError
from lasso_motion_ros.web.idle_connections import IdleConnections
from lasso_motion_ros.web.picture_encoder import PictureEncoder
from lasso_motion_ros.web.source import Source

try:
    from aiohttp import WSCloseCode, web
    from aiohttp.http_exceptions import HttpProcessingError

    from lasso_motion_ros.web.page_connection import PageConnection
except ImportError as error:
    raise LassoMotionError(
        f"the page needs aiohttp ({error}): pip install aiohttp, or the [web] extra; apt has python3-aiohttp"
    ) from error

LOG = logging.getLogger(__name__)
REQUESTS_LOG = LOG.getChild("requests")
STATIC = Path(__file__).parent / "static"
FILES = {
    "index.html": "text/html",
    "style.css": "text/css",
    "app.js": "text/javascript",
    "link.js": "text/javascript",
    "plane.js": "text/javascript",
    "clicks.js": "text/javascript",
    "trace.js": "text/javascript",
    "vendor/uPlot.iife.min.js": "text/javascript",
    "vendor/uPlot.min.css": "text/css",
    "vendor/uPlot.LICENSE": "text/plain",
}
# Close codes of our own (RFC 6455 leaves 4000 to 4999 to applications); the page's link knows them.
MADE_ROOM, FULL = 4001, 4002
LOOPBACK_NAMES = frozenset({"localhost", "127.0.0.1", "::1"})


@dataclass(frozen=True)
class _Tuning:
    """The server's bounds.

    Attributes:
        most_pages: pages connected at once; each keeps one encoded picture in memory.
        idle_page_s: a page from which nothing has come for this long makes room for another where there is none,
            seconds. Each picture that is shown is a sign of life.
        tick_s: how often pages are updated even if nothing arrives: ages go on growing.
        start_wait_s: starting takes milliseconds; after this long it has failed.
        shutdown_wait_s: how long open connections get to end.
    """

    most_pages: int = 32
    idle_page_s: float = 60.0
    tick_s: float = 0.1
    start_wait_s: float = 10.0
    shutdown_wait_s: float = 1.0


TUNING = _Tuning()


def _is_our_fault(record: logging.LogRecord) -> bool:
    """Whether a record tells of more than a request that is none: whoever sent that was answered, and all may send it.

    `https://` in place of `http://` and a port scan are such; aiohttp would show each with a traceback.
    """
    return record.exc_info is None or not isinstance(record.exc_info[1], HttpProcessingError)


REQUESTS_LOG.addFilter(_is_our_fault)


class WebServer:
    """Serves a source, in a thread of its own.

    Security: the Host header must be an address or a name of this machine (another site's page whose name was
    made to point here is refused), the WebSocket's Origin must be this server, messages are bounded and checked,
    the content security policy allows no script but the page's own files. There is no login: whoever reaches the
    port can use the page, so it listens on this machine only unless told otherwise.

    Args:
        source: what is shown.
        host: address to listen on.
        port: TCP port; 0 takes a free one.
        names: further host names by which browsers may ask for it.
    """

    def __init__(self, source: Source, host: str = "127.0.0.1", port: int = 8080, names: tuple[str, ...] = ()) -> None:
        self._source = source
        self._host, self._port = host, port
        self._names = LOOPBACK_NAMES | {host.lower(), socket.gethostname().lower(), *(name.lower() for name in names)}
        self._encoder = PictureEncoder()
        # Commands wait for the tracker's answers: on threads of their own, or nobody would encode pictures meanwhile.
        self._command_pool = ThreadPoolExecutor(max_workers=16, thread_name_prefix="command")
        self._pages: dict[int, PageConnection] = {}
        self._numbers = itertools.count(1)
        self._connections = IdleConnections(time.monotonic)
        self._loop = asyncio.new_event_loop()
        self._stopping = asyncio.Event()
        self._ready = threading.Event()
        self._failure: Exception | None = None
        self._thread = threading.Thread(target=self._run, name="web", daemon=True)

    @property
    def url(self) -> str:
        """Where the page is."""
        host = "127.0.0.1" if self._host in ("", "0.0.0.0", "::") else self._host  # noqa: S104 - compared, not bound
        return f"http://{f'[{host}]' if ':' in host else host}:{self._port}/"

    @property
    def is_local(self) -> bool:
        """Whether only this machine can reach it."""
        with contextlib.suppress(ValueError):
            return ipaddress.ip_address(self._host).is_loopback
        return self._host == "localhost"

    def start(self) -> None:
        """Listen.

        Raises:
            LassoMotionError: the address or port cannot be had.
        """
        self._thread.start()
        if not self._ready.wait(TUNING.start_wait_s):
            raise LassoMotionError(f"the web server has not started within {TUNING.start_wait_s:g} s")
        if self._failure is not None:
            self._thread.join()
            reason = self._failure.strerror if isinstance(self._failure, OSError) else str(self._failure)
            raise LassoMotionError(
                f"cannot listen on {self._host}:{self._port}: {reason}; choose another port with --port"
            ) from self._failure

    def stop(self) -> None:
        """Close the connections and end the thread."""
        if self._thread.is_alive():
            with contextlib.suppress(RuntimeError):  # the loop has ended meanwhile
                self._loop.call_soon_threadsafe(self._stopping.set)
            self._thread.join()

    def _run(self) -> None:
        asyncio.set_event_loop(self._loop)
        try:
            self._loop.run_until_complete(self._serve())
        except Exception as error:
            if self._ready.is_set():
                LOG.exception("the web server has ended")
            self._failure = error
        finally:
            self._ready.set()
            self._command_pool.shutdown(wait=False, cancel_futures=True)
            with contextlib.suppress(Exception):
                self._loop.run_until_complete(self._end_tasks())
                self._loop.run_until_complete(self._loop.shutdown_default_executor())
            self._loop.close()

    async def _end_tasks(self) -> None:
        """End what connections that were cut have left; asyncio would complain of it line by line."""
        left = asyncio.all_tasks() - {asyncio.current_task()}
        for task in left:
            task.cancel()
        await asyncio.gather(*left, return_exceptions=True)

    async def _serve(self) -> None:
        application = web.Application(middlewares=[self._guard], client_max_size=1024)
        application.on_response_prepare.append(self._add_headers)
        application.router.add_get("/", self._index)
        application.router.add_get("/live", self._live)
        application.router.add_get("/{name:.+}", self._file)
        runner = web.AppRunner(
            application,
            access_log=None,
            logger=REQUESTS_LOG,
            handle_signals=False,
            shutdown_timeout=TUNING.shutdown_wait_s,
        )
        await runner.setup()
        try:
            site = web.TCPSite(runner, self._host, self._port)
            await site.start()
            if self._port == 0:
                self._port = runner.addresses[0][1]
            self._source.watch(self._wake_from_thread)
            self._ready.set()
            while not self._stopping.is_set():
                with contextlib.suppress(asyncio.TimeoutError):
                    await asyncio.wait_for(self._stopping.wait(), TUNING.tick_s)
                self._wake()
                if runner.server is not None:
                    self._connections.sweep(runner.server.connections)
            for page in list(self._pages.values()):
                await page.end(WSCloseCode.GOING_AWAY, "the server stops")
        finally:
            await runner.cleanup()

    def _wake_from_thread(self) -> None:
        with contextlib.suppress(RuntimeError):  # the loop has ended meanwhile
            self._loop.call_soon_threadsafe(self._wake)

    def _wake(self) -> None:
        for page in self._pages.values():
            page.wake()

    # Requests.

    @web.middleware
    async def _guard(
        self, request: web.Request, handler: Callable[[web.Request], Awaitable[web.StreamResponse]]
    ) -> web.StreamResponse:
        self._connections.begin(request.protocol)
        try:
            if not self._is_ours(request.headers.get("Host", "")):
                raise web.HTTPForbidden(text="this server does not answer to that host name; see --allow-host\n")
            return await handler(request)
        finally:
            self._connections.end(request.protocol)

    def _is_ours(self, host: str) -> bool:
        """Whether a Host header names this server: by an address or by an allowed name.

        A page of another site may have its own name resolved to this address (DNS rebinding), but the browser then
        still says that name.
        """
        try:
            name = (urlsplit(f"//{host}").hostname or "").lower()
        except ValueError:  # "[" is no host
            return False
        if name in self._names:
            return True
        with contextlib.suppress(ValueError):
            return not self.is_local and bool(ipaddress.ip_address(name))
        return False

    async def _add_headers(self, request: web.Request, response: web.StreamResponse) -> None:
        # 'self' alone does not cover WebSockets in every browser. A name that is not ours is not repeated.
        host = request.headers.get("Host", "")
        sockets = f" ws://{host} wss://{host}" if self._is_ours(host) else ""
        response.headers.update(
            {
                "Content-Security-Policy": "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self'"
                f" blob: data:; connect-src 'self'{sockets}; base-uri 'none';"
                " form-action 'none'; frame-ancestors 'none'",
                "X-Content-Type-Options": "nosniff",
                "X-Frame-Options": "DENY",
                "Referrer-Policy": "no-referrer",
                "Cache-Control": "no-cache",
            }
        )

    async def _index(self, request: web.Request) -> web.StreamResponse:
        return self._response("index.html")

    async def _file(self, request: web.Request) -> web.StreamResponse:
        return self._response(request.match_info["name"])

    @staticmethod
    def _response(name: str) -> web.Response:
        if name not in FILES:
            raise web.HTTPNotFound(text="no such page\n")
        return web.Response(body=(STATIC / name).read_bytes(), content_type=FILES[name], charset="utf-8")

    # The WebSocket.

    async def _live(self, request: web.Request) -> web.StreamResponse:
        if not _same_origin(request.headers.get("Origin", ""), request.headers.get("Host", "")):
            raise web.HTTPForbidden(text="only the page itself may connect\n")
        number = next(self._numbers)
        page = PageConnection(number, self._source, self._encoder, self._command_pool, self._tell_audience, self._wake)
        try:
            await page.socket.prepare(request)
        except ConnectionError:
            return page.socket  # it has gone again already
        if len(self._pages) >= TUNING.most_pages and not await self._make_room():
            text = f"{len(self._pages)} pages are open already, and all are in use: close one."
            LOG.warning("another page was refused: %s", text)
            await page.end(FULL, text)
            return page.socket
        self._pages[number] = page
        self._tell_audience()
        try:
            await page.serve()
        finally:
            self._pages.pop(number, None)
            self._tell_audience()
        return page.socket

    async def _make_room(self) -> bool:
        """End the page that has been idle for longest; whether one was idle."""
        number, page = min(self._pages.items(), key=lambda one: one[1].heard_s)
        if time.monotonic() - page.heard_s < TUNING.idle_page_s:
            return False
        del self._pages[number]
        LOG.warning("the page that was idle for longest has made room for another")
        await page.end(MADE_ROOM, "This window was idle, and has made room for another.")
        return True

    def _tell_audience(self) -> None:
        self._source.audience({number: page.settings.view for number, page in self._pages.items()})


def _same_origin(origin: str, host: str) -> bool:
    try:
        parts = urlsplit(origin)
    except ValueError:  # "http://[" is no address
        return False
    return parts.scheme in ("http", "https") and parts.netloc == host
