"""Motion and state to an OpenIGTLink server, with pyigtl's server as the peer."""

from __future__ import annotations

import socket
import threading
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("pyigtl", reason="needs the igtl extra")

from support.drawn_recording import stamp, write_result
from support.igtl_peer import IgtlPeer

from lasso_motion_ros.cli.main import main
from lasso_motion_ros.config.igtl import IgtlConfig
from lasso_motion_ros.core.errors import ConfigurationError
from lasso_motion_ros.geometry.transforms import apply, rigid
from msg_adapters.openigtlink import IgtlConnection, IgtlMessages, server_address
from msg_adapters.topics import STATE_VALID_S

MOTION = rigid((0.1, -0.2, 0.3), (0.004, -0.005, 0.012))


@pytest.mark.parametrize(
    ("text", "address"),
    [("slicer:18945", ("slicer", 18945)), ("127.0.0.1", ("127.0.0.1", 18944)), ("[::1]:7", ("::1", 7)),
     ("[::1]", ("::1", 18944))],
)  # fmt: skip
def test_an_address_is_host_and_port(text: str, address: tuple[str, int]) -> None:
    assert server_address(text) == address


@pytest.mark.parametrize(
    "text", ["", ":18944", "slicer:", "slicer:0", "slicer:70000", "slicer:x", "a:²", "slicer..local:7"]
)
def test_an_address_that_is_none_is_refused(text: str) -> None:
    with pytest.raises(ConfigurationError, match="expected HOST:PORT"):
        server_address(text)


def test_a_state_holds_as_long_as_for_every_consumer() -> None:
    assert IgtlConfig().state_timeout_s == STATE_VALID_S


def test_the_peer_reads_millimetres_in_ras_with_the_exposures_time() -> None:
    packed = IgtlMessages()
    with IgtlPeer() as peer, IgtlConnection(("127.0.0.1", peer.port), lambda line: None) as connection:
        assert connection.wait_connected(threading.Event())
        connection.send(packed.state_device, packed.state("TRACKING", stamp(3)))
        connection.send(packed.device, packed.motion(MOTION, stamp(3)))
        peer.wait_for(lambda: len(peer.got) == 2)
    state, transform = peer.got
    assert (state.device_name, state.string) == ("LassoMotionState", "TRACKING")
    assert transform.device_name == "LassoMotion"
    assert transform.timestamp == pytest.approx(1e-9 * stamp(3), abs=1e-6)
    # A point of the atrium: moved in the world, then written in RAS millimetres, is where the peer's matrix puts it.
    point = np.array([0.02, -0.03, 0.05])
    to_ras = 1e3 * np.array([-1.0, -1.0, 1.0])
    np.testing.assert_allclose(apply(transform.matrix, point * to_ras), apply(MOTION, point) * to_ras, atol=1e-4)


def test_a_server_that_goes_and_comes_back_is_found_again_and_nothing_old_is_sent() -> None:
    lines: list[str] = []
    packed = IgtlMessages()
    first = IgtlPeer()
    with IgtlConnection(("127.0.0.1", first.port), lines.append) as connection:
        assert connection.wait_connected(threading.Event())
        first.__exit__()
        first.wait_for(lambda: len(lines) == 2 or len(lines) == 3)
        first.wait_for(lambda: not connection.connected)
        connection.send(packed.state_device, packed.state("old", 0))
        with IgtlPeer(first.port) as second:
            assert connection.wait_connected(threading.Event())
            connection.send(packed.state_device, packed.state("new", 0))
            second.wait_for(lambda: bool(second.got))
            assert second.words() == ["new"]
            said = list(lines)
    where = f"127.0.0.1:{first.port}"
    assert said[0] == said[-1] == f"connected to {where}"
    assert said[1].startswith(f"the connection to {where} is lost (")
    assert len(said) <= 4  # a server that is away is complained of once


def test_a_result_is_sent_in_its_order_and_without_a_transform_where_there_is_none(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    states = ["TRACKING", "TRACKING", "LOST", "DEGRADED", "DISPLACED"]
    result = write_result(tmp_path / "result.mcap", [0.0, 3.0, None, 5.0, 9.0], states)
    with IgtlPeer() as peer:
        status = main(["igtl", str(result), "--to", f"127.0.0.1:{peer.port}", "--rate", "5"])
        peer.wait_for(lambda: len(peer.got) == 8)
        assert peer.words() == states
        # World z is cranial; what a tracker published while DISPLACED is no motion of the atrium.
        assert [round(float(one.matrix[2, 3]), 3) for one in peer.transforms()] == [0.0, 3.0, 5.0]
    assert status == 0
    assert "sent 3 transforms and 5 states of 5 pairs" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("words", "complaint"),
    [
        (["--to", "slicer:0"], "expected HOST:PORT of an OpenIGTLink server, found 'slicer:0'"),
        (["--to", "slicer", "--axes", "LAS"], "axes: LAS is left-handed"),
        (["--to", "slicer", "--device", "a name that is far too long"], "device: expected 1 to 15 ASCII letters"),
        (["--to", "slicer", "--rate", "2"], "--rate goes with RESULT.mcap"),
    ],
)
def test_bad_words_are_one_line(words: list[str], complaint: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["igtl", *words]) == 2
    assert complaint in capsys.readouterr().err


def test_a_server_that_is_not_there_is_said_once() -> None:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
    lines: list[str] = []
    told = threading.Event()
    with IgtlConnection(("127.0.0.1", port), lambda line: (lines.append(line), told.set())):  # type: ignore[func-returns-value]
        assert told.wait(30.0)
    assert lines == [f"cannot reach 127.0.0.1:{port} (Connection refused); trying again"]
