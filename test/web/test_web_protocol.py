"""What the page may say, checked value by value."""

from __future__ import annotations

import json
import struct

import numpy as np
import pytest

from lasso_motion_ros.core.errors import MessageError
from lasso_motion_ros.web.protocol import (
    MAX_POINTS,
    ClickedOutline,
    DisplaySettings,
    EncodedPlane,
    Request,
    Shown,
    Window,
    encode,
    encode_picture,
    parse,
    points,
    text,
)


def test_the_four_kinds() -> None:
    assert parse('{"type":"shown"}') == Shown()
    look = '{"type":"look","view":"film","a":{"brightness":-1,"contrast":5},"b":{"brightness":0,"contrast":1}}'
    assert parse(look) == DisplaySettings("film", (("a", Window(-1.0, 5.0)), ("b", Window())))
    outline = parse('{"type":"fit","plane":"b","points":[[1,2]]}')
    assert isinstance(outline, ClickedOutline)
    assert (outline.plane, outline.points.tolist()) == ("b", [[1.0, 2.0]])
    request = parse('{"type":"go","id":7,"index":2}')
    assert isinstance(request, Request)
    assert (request.id, request.name, request.body["index"]) == (7, "go", 2)


@pytest.mark.parametrize(
    ("message", "complaint"),
    [
        ("", "not JSON"),
        ("[" * 100_000, "not JSON"),
        ("[]", "expected an object, found list"),
        ('{"type":"eval"}', "type: unknown: 'eval'"),
        ('{"type":["go"],"id":1}', "type: unknown"),
        ('{"type":"go"}', "id: expected a whole number, found None"),
        ('{"type":"go","id":true}', "id: expected a whole number, found True"),
        ('{"type":"look","view":"raw","a":{"brightness":0,"contrast":1}}', "view: expected one of film, overlay"),
        ('{"type":"look","view":"film","a":{"brightness":2,"contrast":1}}', "brightness: expected -1 to 1, found 2"),
        ('{"type":"look","view":"film","a":{"brightness":0,"contrast":0}}', "contrast: expected 0.2 to 5, found 0"),
        ('{"type":"look","view":"film","a":{"brightness":NaN,"contrast":1}}', "NaN is not a number"),
        ('{"type":"look","view":"film","a":{"brightness":"0","contrast":1}}', "brightness: expected"),
        ('{"type":"look","view":"film","a":[]}', "a: expected an object, found list"),
        ('{"type":"fit","plane":"c","points":[]}', "plane: expected one of a, b, found 'c'"),
        ('{"type":"fit","plane":["a"],"points":[]}', "plane: expected one of a, b"),
        ('{"type":"fit","plane":"a","points":[[0]]}', r"expected points \[x, y\]"),
        ('{"type":"look","view":"film","a":{"brightness":false,"contrast":1}}', "brightness: expected"),
    ],
)
def test_anything_else_is_refused_by_name(message: str, complaint: str) -> None:
    with pytest.raises(MessageError, match=complaint):
        parse(message)


def test_points_are_pairs_of_numbers() -> None:
    np.testing.assert_array_equal(points({"a": [[1, 2.5], [3, -4]]}, "a", fewest=2), [[1.0, 2.5], [3.0, -4.0]])
    assert points({"curve": []}, "b", key="curve").shape == (0, 2)


@pytest.mark.parametrize(
    ("found", "complaint"),
    [
        (None, "plane A: expected a list"),
        ("[[1,2]]", "plane A: expected a list"),
        ([[0, 0]] * (MAX_POINTS + 1), f"at most {MAX_POINTS} points"),
        ([[0, 0]] * 5, "expected 6 points or more, found 5"),
        ([[0, 0]] * 5 + [[0]], r"expected points \[x, y\], found \[0\]"),
        ([[0, 0]] * 5 + [[0, None]], "expected points"),
        ([[0, 0]] * 5 + [[0, True]], "expected points"),
        ([[0, 0]] * 5 + [[0, 1e9]], "expected points"),
        ([[0, 0]] * 5 + [[0, 10**400]], "expected points"),
        ([[0, 0]] * 5 + [[0, float("inf")]], "expected points"),
    ],
)
def test_points_of_another_kind_are_refused(found: object, complaint: str) -> None:
    with pytest.raises(MessageError, match=complaint):
        points({"a": found}, "a", fewest=6)


def test_one_word_of_a_few() -> None:
    assert text("drawing", {"drawing": "fill"}, ("fill", "both")) == "fill"
    for wrong in ("FILL", None, ["fill"]):
        with pytest.raises(MessageError, match="drawing: expected one of fill, both"):
            text("drawing", {"drawing": wrong}, ("fill", "both"))


def test_a_picture_is_its_header_and_its_files_in_order() -> None:
    planes = {
        "b": EncodedPlane(5, 3, 2, "png", b"BBB", None),
        "a": EncodedPlane(1_760_000_000_000_000_001, 3, 2, "jpeg", b"AA", np.array([[0.123456, 2.0]])),
    }
    message = encode_picture(9, True, "film", planes)
    length = struct.unpack("<I", message[:4])[0]
    header = json.loads(message[4 : 4 + length])
    assert message[4 + length :] == b"AABBB"
    assert header["planes"]["a"] == {
        "stamp": "1760000000000000001",
        "width": 3,
        "height": 2,
        "kind": "jpeg",
        "bytes": 2,
        "drawn": False,
        "loop": [[0.12, 2.0]],
    }
    assert (header["planes"]["b"]["bytes"], header["number"], header["held"]) == (3, 9, True)


def test_what_is_not_json_is_never_sent() -> None:
    with pytest.raises(ValueError, match="not JSON compliant"):
        encode("status", latency=float("nan"))
