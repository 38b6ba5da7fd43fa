"""The web server: who may ask, and for what."""

from __future__ import annotations

import pytest

pytest.importorskip("aiohttp", reason="needs the web extra")

from support.page_client import Drawn, get

from lasso_motion_ros.core.errors import LassoMotionError
from lasso_motion_ros.web.server import FILES, STATIC, WebServer


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


def test_a_host_that_is_none_leaves_no_traceback(server: WebServer, caplog: pytest.LogCaptureFixture) -> None:
    assert get(server, Host="[")[0] == 403
    assert caplog.records == []


def test_a_port_that_is_taken_is_named(server: WebServer, source: Drawn) -> None:
    port = int(server.url.rstrip("/").rpartition(":")[2])
    with pytest.raises(LassoMotionError, match=f"cannot listen on 127.0.0.1:{port}: .*choose another port with --port"):
        WebServer(source, port=port).start()
