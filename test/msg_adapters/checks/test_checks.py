"""What `check` says of recordings that are wrong in one known way; of a sound one nothing is said."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from support.checked_stream import (
    PAIRS,
    SIDE,
    Change,
    byte_swapped,
    coloured,
    cropped,
    fields,
    images,
    in_millimetres,
    infos,
    mirror_free,
    moved_world,
    over_exposed,
    restamp,
    seeds,
    shifted,
    shrunk,
    slowed,
    sound_stream,
    turned,
    upside_down,
    write,
)
from support.drawn_recording import PERIOD_NS, projections, stamp

from lasso_motion_ros.cli.main import main
from msg_adapters.calibrations import encode_camera_info
from msg_adapters.checks.issue import Issue
from msg_adapters.seeds import encode_polygon


def check(path: Path, capsys: pytest.CaptureFixture[str], *arguments: str) -> tuple[int, list[Issue]]:
    figures = path.with_suffix(".json")
    status = main(["check", str(path), "--json", str(figures), "--overwrite", "--quiet", *arguments])
    answer = json.loads(figures.read_text(encoding="utf-8"))
    assert answer["works"] == (status != 2)
    shown = [one for one in answer["findings"] if one["severity"] != "note"]
    assert len(capsys.readouterr().out.splitlines()) == len(shown)
    return status, [Issue(**one) for one in answer["findings"]]


def test_of_a_sound_stream_nothing_is_said(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = write(tmp_path / "r.mcap", sound_stream())
    assert check(path, capsys) == (0, [])
    assert main(["check", str(path)]) == 0
    assert capsys.readouterr().out.splitlines() == [
        f"plane a: {PAIRS} images at 4/s (512x512, mono16), {PAIRS} calibrations, 1 sets of clicks",
        f"plane b: {PAIRS} images at 4/s (512x512, mono16), {PAIRS} calibrations, 1 sets of clicks",
        f"pairs: {PAIRS}, b 0.0 ms behind a",
        "nothing keeps the tracker from working",
    ]


A_IMAGE, B_IMAGE = "/plane_a/image_raw", "/plane_b/image_raw"
A_INFO, B_INFO = "/plane_a/camera_info", "/plane_b/camera_info"
WRONG: dict[str, tuple[Change, str, str, str]] = {
    "zero stamps": (images("a", lambda one: restamp(one, 0)), "error", A_IMAGE, "8 of 8 stamps are zero"),
    "repeated stamps": (
        images("b", lambda one: restamp(one, stamp(one["pair"] // 2 * 2))),
        "error",
        B_IMAGE,
        "4 stamps repeat the one before",
    ),
    "back in time": (
        images("b", lambda one: restamp(one, stamp(7 - one["pair"]))),
        "error",
        B_IMAGE,
        "7 stamps go back in time",
    ),
    "looped": (
        lambda one: restamp(one, stamp(one["pair"] % 6)),
        "note",
        A_IMAGE,
        "the stamps start again 1 times, by more than 1 s: as many new runs",
    ),
    "jitter": (
        images("b", lambda one: restamp(one, stamp(one["pair"]) + one["pair"] % 2 * 80_000_000)),
        "warning",
        B_IMAGE,
        "the stamps jitter by",
    ),
    "clocks": (
        images("b", lambda one: restamp(one, stamp(one["pair"]) + 3_000_000_000)),
        "error",
        "planes",
        "images that come together are stamped 3.000 s apart (plane b ahead)",
    ),
    "beyond half a period": (
        images("b", lambda one: restamp(one, stamp(one["pair"]) + one["pair"] % 2 * 140_000_000)),
        "warning",
        "planes",
        "pair by their stamps",
    ),
    "millimetres": (infos(in_millimetres), "error", A_INFO, "looks like millimetres, metres are expected"),
    "upside down": (
        infos(upside_down, "b"),
        "error",
        "seeds",
        "60 mm apart; with plane a upside down or plane b upside down they would meet",
    ),
    "one matrix for both": (
        infos(lambda one: one["fields"].update(encode_camera_info(projections()["a"], one["fields"]["header"]))),
        "error",
        "planes",
        "the planes look along nearly one line (0.0° apart)",
    ),
    "singular": (infos(fields(p=np.ones(12)), "a"), "error", A_INFO, "p: the projection matrix is singular"),
    "stereo": (
        infos(fields(p=np.array([900.0, 0, 256, -90, 0, 900, 256, 0, 0, 0, 1, 0])), "a"),
        "error",
        A_INFO,
        "p: a stereo-style matrix",
    ),
    "distortion": (infos(fields(d=np.array([0.1, 0, 0, 0, 0])), "b"), "error", B_INFO, "d: expected all zero"),
    "k and r disagree": (infos(mirror_free, "a"), "warning", A_INFO, "k·r is not the left 3×3 of p (8 of 8)"),
    "no k": (infos(fields(k=np.zeros(9)), "a"), "note", A_INFO, "k is all zero"),
    "another size": (
        infos(fields(width=1024, height=1024), "a"),
        "error",
        A_INFO,
        "it is for an image of 1024×1024, the images have 512×512",
    ),
    "stamps of no image": (
        infos(lambda one: restamp(one, stamp(one["pair"]) + 1_000_000), "a"),
        "warning",
        A_INFO,
        "its stamps are no image's stamps",
    ),
    "one, not latched": (
        infos(lambda one: one["pair"] > 0, "b"),
        "warning",
        B_INFO,
        "1 for 8 images, and not latched: a node that starts later has none",
    ),
    "colour": (images("a", coloured), "note", A_IMAGE, "rgb8 pictures are taken as luminance (ITU-R BT.601)"),
    "floats": (images("a", fields(encoding="32FC1")), "error", A_IMAGE, "encoding: expected mono8"),
    "step": (
        images("b", fields(step=512)),
        "error",
        B_IMAGE,
        "step: a row of 512 mono16 pixels has 1024 bytes, found 512",
    ),
    "cut data": (images("b", fields(data=b"\1" * 1000)), "error", B_IMAGE, "data: expected 524288 bytes"),
    "black": (images("a", fields(data=bytes(SIDE * SIDE * 2))), "warning", A_IMAGE, "all of one value"),
    "byte-swapped": (images("a", byte_swapped), "error", A_IMAGE, "look byte-swapped"),
    "saturated": (images("a", over_exposed), "warning", A_IMAGE, "2 of 2 images looked at are half saturated"),
    "small": (images("a", lambda one: cropped(one, 128)), "warning", A_IMAGE, "128×128 pixels are few"),
    "two sizes": (
        images("a", lambda one: cropped(one, 300) if one["pair"] == 4 else None),
        "note",
        A_IMAGE,
        "the size changes: 512×512, 300×300",
    ),
    "not CDR": (infos(lambda one: one.update(raw=b"\0\1"), "a"), "error", A_INFO, "8 messages cannot be decoded"),
    "too slow": (slowed, "warning", A_IMAGE, "0.5 images/s are too few to follow breathing"),
    "gaps": (
        lambda one: True if one["pair"] == 4 else None,
        "warning",
        A_IMAGE,
        "1 gaps of more than 1.5 periods (0.25 s)",
    ),
    "two rates": (
        images("b", lambda one: True if one["pair"] % 2 else None),
        "warning",
        "planes",
        "plane a has 4 images/s, plane b 2",
    ),
    "changes between latched ones": (
        infos(lambda one: turned(one) if one["pair"] in (0, 4) else True, "b"),
        "warning",
        B_INFO,
        "it changes, and does not come with the images",
    ),
    "iso-centre out of sight": (infos(shifted, "a"), "warning", A_INFO, "the world origin (the iso-centre) is seen at"),
    "far away": (moved_world, "warning", "seeds", "the loop lies 0.50 m from the world origin"),
    "tiny loop": (
        seeds(lambda one: one["fields"].update(shrunk(one)), "ab"),
        "warning",
        "/plane_a/seed",
        "a lasso has 10 to 30",
    ),
    "no clicks": (seeds(lambda one: True), "warning", "seeds", "it has no clicks, and track begins with those"),
    "one plane's clicks": (seeds(lambda one: True, "b"), "error", "/plane_b/seed", "clicks in the other plane only"),
    "few clicks": (seeds(fields(polygon={"points": []}), "a"), "error", "/plane_a/seed", "expected 6 clicks or more"),
    "clicks on no image": (
        seeds(lambda one: restamp(one, stamp(0) + 5), "a"),
        "error",
        "/plane_a/seed",
        "its stamp is no image's",
    ),
    "clicks on two pairs": (
        seeds(lambda one: restamp(one, stamp(1)), "b"),
        "error",
        "seeds",
        "the planes' clicks belong to two pairs",
    ),
    "clicks outside": (
        seeds(lambda one: one["fields"].update(encode_polygon(np.full((8, 2), 600.0), one["fields"]["header"])), "a"),
        "error",
        "/plane_a/seed",
        "clicks outside the image of 512×512",
    ),
    "no calibration": (infos(lambda one: True, "b"), "error", B_INFO, "it is missing"),
    "misnamed": (
        images("a", lambda one: one.update(topic="/cath/frontal")),
        "error",
        A_IMAGE,
        "it is missing; /cath/frontal may be it",
    ),
    "another type": (
        infos(lambda one: one.update(type="std_msgs/msg/String", fields={"data": ""}), "a"),
        "error",
        A_INFO,
        "its type is std_msgs/msg/String, expected sensor_msgs/msg/CameraInfo",
    ),
}


@pytest.mark.parametrize("case", WRONG)
def test_what_is_wrong_is_named_with_its_cure(case: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A change returns True for a message to be left out."""
    change, severity, subject, text = WRONG[case]
    entries = [one for one in sound_stream() if change(one) is not True]
    status, issues = check(write(tmp_path / "r.mcap", entries), capsys)
    (found,) = [one for one in issues if one.subject == subject and text in one.problem]
    assert found.severity == severity
    assert found.cure or severity == "note"
    assert status == (2 if any(one.severity == "error" for one in issues) else 0)
    assert [one.severity for one in issues] == sorted(
        (one.severity for one in issues), key=["error", "warning", "note"].index
    )


def test_a_latched_calibration_needs_no_frame_of_its_own(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    entries = [one for one in sound_stream() if one["kind"] != "camera_info" or one["pair"] == 0]
    for one in entries:
        one["latched"] = one["kind"] == "camera_info"
    assert check(write(tmp_path / "r.mcap", entries), capsys) == (0, [])


def test_the_cure_for_a_misnamed_topic_works(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    entries = sound_stream()
    for one in entries:
        one["topic"] = {A_IMAGE: "/cath/frontal", B_IMAGE: "/cath/lateral"}.get(one["topic"], one["topic"])
    path = write(tmp_path / "r.mcap", entries)
    status, issues = check(path, capsys)
    assert status == 2
    rules = [one.cure.removeprefix("--remap ") for one in issues if one.cure.startswith("--remap")]
    assert rules == ["/cath/frontal:=/plane_a/image_raw", "/cath/lateral:=/plane_b/image_raw"]
    assert check(path, capsys, "--remap", *rules) == (0, [])


def test_a_cut_recording_is_said_to_be_cut(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = write(tmp_path / "r.mcap", sound_stream())
    path.write_bytes(path.read_bytes()[:-5000])
    status, issues = check(path, capsys)
    assert (status, issues[0].severity, issues[0].cure) == (3, "warning", "lasso-motion record --repair FILE")


def test_the_period_is_as_the_tests_say() -> None:
    assert PERIOD_NS == 250_000_000
