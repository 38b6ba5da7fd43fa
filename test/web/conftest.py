"""A served source for the tests of the page's server; aiohttp may be missing: it is imported only where it is used."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

import pytest

if TYPE_CHECKING:
    from support.page_client import Drawn

    from lasso_motion_ros.web.server import WebServer


@pytest.fixture
def source() -> Drawn:
    from support.page_client import Drawn

    return Drawn()


@pytest.fixture
def server(source: Drawn) -> Iterator[WebServer]:
    from lasso_motion_ros.web.server import WebServer

    started = WebServer(source, port=0)
    started.start()
    yield started
    started.stop()
