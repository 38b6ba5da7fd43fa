"""What `check` says of streams that are wrong in one known way; a sound one has nothing said of it."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from drawn_recording import PERIOD_NS, loop, projections, stamp

from lasso_motion_ros.cli.main import main
from lasso_motion_ros.frames import PLANES
from lasso_motion_ros.geometry import carm_projection
from msg_adapters.calibrations import encode_camera_info
from msg_adapters.checks.finding import Finding
from msg_adapters.checks.graph import Endpoint, TopicFacts, check_graph
from msg_adapters.checks.stamps import PlaneStamps, check_stamps
from msg_adapters.images import encode_image
from msg_adapters.messages import header_fields
from msg_adapters.recording_writer import RecordingWriter
from msg_adapters.seeds import encode_polygon
from msg_adapters.topics import INPUTS, camera_info_topic, image_topic, seed_topic

PAIRS = 8
SIDE = 512
OFF_CENTRE = np.array([0.0, 0.0, 0.03])
Entry = dict[str, Any]
Change = Callable[[Entry], Any]


def sound_stream() -> list[Entry]:
    """Images, calibrations with each, and clicks on the first pair, as `drawn_recording` has them."""
    entries = []
    ramp = np.add.outer(np.arange(SIDE), np.arange(SIDE)).astype(np.uint16) * 3
    for pair in range(PAIRS):
        for plane, projection in projections().items():
            header = header_fields(stamp(pair), "xray")
            for topic, fields in (
                (camera_info_topic(plane), encode_camera_info(projection, header)),
                (image_topic(plane), encode_image(ramp, header)),
            ):
                entries.append(entry(topic, plane, pair, fields))
            if pair == 0:
                fields = encode_polygon(projection.project(loop() + OFF_CENTRE)[:-1:18], header)
                entries.append(entry(seed_topic(plane), plane, pair, fields))
    return entries


def entry(topic: Any, plane: str, pair: int, fields: Any) -> Entry:
    kind = topic.name.split("/")[1]
    return {
        "topic": topic.recorded_name,
        "type": topic.type_name,
        "plane": plane,
        "pair": pair,
        "kind": kind,
        "fields": dict(fields),
        "log": stamp(pair),
        "latched": False,
    }


def write(path: Path, entries: list[Entry]) -> Path:
    with RecordingWriter(path, "none") as writer:
        for one in entries:
            if "raw" in one:
                writer.write_raw(one["topic"], one["type"], one["raw"], one["log"])
                continue
            writer.write(one["topic"], one["type"], one["fields"], one["log"], latched=one["latched"])
    return path


def check(path: Path, capsys: pytest.CaptureFixture[str], *arguments: str) -> tuple[int, list[Finding]]:
    figures = path.with_suffix(".json")
    status = main(["check", str(path), "--json", str(figures), "--quiet", *arguments])
    answer = json.loads(figures.read_text(encoding="utf-8"))
    assert answer["works"] == (status != 2)
    shown = [one for one in answer["findings"] if one["severity"] != "note"]
    assert len(capsys.readouterr().out.splitlines()) == len(shown)
    return status, [Finding(**one) for one in answer["findings"]]


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


def restamp(one: Entry, stamp_ns: int) -> None:
    one["fields"]["header"] = header_fields(stamp_ns, "xray")


def images(plane: str, change: Change) -> Change:
    return lambda one: change(one) if one["kind"] == "image_raw" and one["plane"] == plane else None


def infos(change: Change, planes: str = "ab") -> Change:
    return lambda one: change(one) if one["kind"] == "camera_info" and one["plane"] in planes else None


def seeds(change: Change, planes: str = "ab") -> Change:
    return lambda one: change(one) if one["kind"] == "seed" and one["plane"] in planes else None


def fields(**values: Any) -> Change:
    return lambda one: one["fields"].update(values)


def in_millimetres(one: Entry) -> None:
    """What a bridge does that takes the C-arm's millimetres as they are."""
    p = one["fields"]["p"].reshape(3, 4).copy()
    p[:, 3] *= 1e3
    one["fields"]["p"] = p.reshape(-1)


def upside_down(one: Entry) -> None:
    """The sign of the image's y axis is wrong in p, k too, so that they agree."""
    flip = np.array([[1.0, 0.0, 0.0], [0.0, -1.0, SIDE - 1.0], [0.0, 0.0, 1.0]])
    one["fields"]["p"] = (flip @ one["fields"]["p"].reshape(3, 4)).reshape(-1)
    one["fields"]["k"] = (flip @ one["fields"]["k"].reshape(3, 3)).reshape(-1)


def byte_swapped(one: Entry) -> None:
    one["fields"]["data"] = np.frombuffer(one["fields"]["data"], np.uint16).byteswap().tobytes()


def mirror_free(one: Entry) -> None:
    one["fields"]["r"] = np.eye(3).reshape(-1)


def over_exposed(one: Entry) -> None:
    picture = np.full((SIDE, SIDE), 4095, np.uint16)
    picture[: SIDE // 4] = np.arange(SIDE)
    one["fields"]["data"] = picture.tobytes()


def cropped(one: Entry, side: int) -> None:
    picture = np.frombuffer(one["fields"]["data"], np.uint16).reshape(SIDE, SIDE)[:side, :side]
    one["fields"].update(encode_image(picture, one["fields"]["header"]))


def slowed(one: Entry) -> None:
    """One pair in two seconds; the clicks are on the first, whose stamp stays."""
    at = stamp(0) + one["pair"] * 2_000_000_000
    restamp(one, at)
    one["log"] = at


def turned(one: Entry) -> None:
    """By 3 degrees, with the pair."""
    width, height = one["fields"]["width"], one["fields"]["height"]
    projection = carm_projection(
        np.radians(60.0 + 3.0 * (one["pair"] > 0)),
        0.0,
        source_detector_m=1.2,
        source_object_m=0.785,
        pixel_size_m=0.4e-3,
        width=width,
        height=height,
    )
    one["fields"].update(encode_camera_info(projection, one["fields"]["header"]))


def shifted(one: Entry) -> None:
    """A principal point that is 2000 pixels off."""
    move = np.array([[1.0, 0.0, 2000.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]])
    one["fields"]["p"] = (move @ one["fields"]["p"].reshape(3, 4)).reshape(-1)
    one["fields"]["k"] = (move @ one["fields"]["k"].reshape(3, 3)).reshape(-1)


def moved_world(one: Entry) -> None:
    """The world's origin lies half a metre to one side (along z) of what both planes look at."""
    if one["kind"] == "camera_info":
        p = one["fields"]["p"].reshape(3, 4).copy()
        p[:, 3] -= p[:, :3] @ np.array([0.0, 0.0, 0.47])
        one["fields"]["p"] = p.reshape(-1)


def shrunk(one: Entry) -> Any:
    points = np.array([[point["x"], point["y"]] for point in one["fields"]["polygon"]["points"]])
    middle = points.mean(axis=0)
    return encode_polygon(middle + 0.1 * (points - middle), one["fields"]["header"])


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
    "colour": (images("a", fields(encoding="rgb8")), "error", A_IMAGE, "encoding: expected mono8"),
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
    "no clicks": (seeds(lambda one: True), "warning", "seeds", "it has no clicks"),
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
    status, findings = check(write(tmp_path / "r.mcap", entries), capsys)
    (found,) = [one for one in findings if one.subject == subject and text in one.problem]
    assert found.severity == severity
    assert found.cure or severity == "note"
    assert status == (2 if any(one.severity == "error" for one in findings) else 0)
    assert [one.severity for one in findings] == sorted(
        (one.severity for one in findings), key=["error", "warning", "note"].index
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
    status, findings = check(path, capsys)
    assert status == 2
    rules = [one.cure.removeprefix("--remap ") for one in findings if one.cure.startswith("--remap")]
    assert rules == ["/cath/frontal:=/plane_a/image_raw", "/cath/lateral:=/plane_b/image_raw"]
    assert check(path, capsys, "--remap", *rules) == (0, [])


def test_a_cut_recording_is_said_to_be_cut(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = write(tmp_path / "r.mcap", sound_stream())
    path.write_bytes(path.read_bytes()[:-5000])
    status, findings = check(path, capsys)
    assert (status, findings[0].severity, findings[0].cure) == (3, "warning", "lasso-motion record --repair FILE")


def live_stamps(age_s: float) -> list[Finding]:
    """Of both planes at 10 pairs/s that come so long after their stamps."""
    stamps = [stamp(0) + k * 100_000_000 for k in range(20)]
    arrivals = [at + round(age_s * 1e9) for at in stamps]
    return list(check_stamps({plane: PlaneStamps(stamps, arrivals) for plane in PLANES}, live=True))


def test_stamps_of_the_future_and_of_long_ago() -> None:
    assert live_stamps(0.03) == []
    ahead = live_stamps(-0.25)
    assert [one.problem for one in ahead] == ["the stamps are 0.250 s in the future of this machine's clock"] * 2
    assert {one.severity for one in ahead} == {"warning"}
    old = live_stamps(86400.0 * 3)
    assert [one.problem for one in old] == ["the stamps are 3.0 days old: a recording, or another clock"] * 2
    assert {one.severity for one in old} == {"note"}


RELIABLE, BEST_EFFORT = Endpoint("/bridge", True, False), Endpoint("/bridge", False, False)


def live_graph(**changes: TopicFacts) -> list[Finding]:
    """Of a graph in which all inputs are reliable, but for the changes (by name, / as __)."""
    topics = {topic.recorded_name: TopicFacts(topic.type_name, (RELIABLE,), (), 10) for topic in INPUTS}
    topics.update({f"/{name.replace('__', '/')}": facts for name, facts in changes.items()})
    return list(check_graph(topics, live=True))


def test_a_reliable_graph_is_fine() -> None:
    assert live_graph() == []


@pytest.mark.parametrize(("lost", "severity"), [(1, "warning"), (50, "error")])
def test_lost_frames_of_a_best_effort_publisher_name_the_profile(lost: int, severity: str) -> None:
    facts = TopicFacts("sensor_msgs/msg/Image", (BEST_EFFORT,), (), 50, lost)
    (finding,) = live_graph(plane_a__image_raw=facts)
    assert finding.severity == severity
    assert finding.problem.startswith(f"{lost} of {50 + lost} messages were lost; /bridge publishes best effort")
    assert "FASTRTPS_DEFAULT_PROFILES_FILE=…/config/fastdds.xml" in finding.cure


def test_two_publishers_on_one_image_topic() -> None:
    facts = TopicFacts("sensor_msgs/msg/Image", (RELIABLE, Endpoint("/player", True, False)), (), 10)
    (finding,) = live_graph(plane_a__image_raw=facts)
    assert finding.problem == "2 publishers (/bridge, /player)"


def test_a_subscription_that_hears_nothing_is_named_unless_its_node_has_another() -> None:
    deaf, latched = Endpoint("/viewer", True, False), Endpoint("/lasso_tracker", True, True)
    subscriptions = (deaf, latched, Endpoint("/lasso_tracker", False, False))
    facts = TopicFacts("sensor_msgs/msg/CameraInfo", (BEST_EFFORT,), subscriptions, 10)
    (finding,) = live_graph(plane_a__camera_info=facts)
    assert finding.problem == "/viewer asks for reliable delivery, which no publisher offers: it hears nothing"


def test_a_graph_in_a_namespace_is_recognised() -> None:
    topics = {f"/lab{topic.recorded_name}": TopicFacts(topic.type_name, (RELIABLE,), (), 10) for topic in INPUTS}
    findings = list(check_graph(topics, live=True))
    assert {finding.problem for finding in findings} == {"it is in the namespace /lab"}
    assert all(finding.cure.endswith("this command with --namespace /lab") for finding in findings)


def test_the_period_is_as_the_tests_say() -> None:
    assert PERIOD_NS == 250_000_000
