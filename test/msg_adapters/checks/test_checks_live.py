"""What `check` says of a live graph: clocks, reliability, publishers, subscriptions, namespaces."""

from __future__ import annotations

import pytest
from support.drawn_recording import stamp

from lasso_motion_ros.geometry.frames import PLANES
from msg_adapters.checks.graph_checks import Endpoint, TopicFacts, check_graph
from msg_adapters.checks.issue import Issue
from msg_adapters.checks.stamp_checks import PlaneStamps, check_stamps
from msg_adapters.topics import INPUTS


def live_stamps(age_s: float) -> list[Issue]:
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


def live_graph(**changes: TopicFacts) -> list[Issue]:
    """Of a graph in which all inputs are reliable, but for the changes (by name, / as __)."""
    topics = {topic.recorded_name: TopicFacts(topic.type_name, (RELIABLE,), (), 10) for topic in INPUTS}
    topics.update({f"/{name.replace('__', '/')}": facts for name, facts in changes.items()})
    return list(check_graph(topics, live=True))


def test_a_reliable_graph_is_fine() -> None:
    assert live_graph() == []


@pytest.mark.parametrize(("lost", "severity"), [(1, "warning"), (50, "error")])
def test_lost_frames_of_a_best_effort_publisher_name_the_profile(lost: int, severity: str) -> None:
    facts = TopicFacts("sensor_msgs/msg/Image", (BEST_EFFORT,), (), 50, lost)
    (issue,) = live_graph(plane_a__image_raw=facts)
    assert issue.severity == severity
    assert issue.problem.startswith(f"{lost} of {50 + lost} messages were lost; /bridge publishes best effort")
    assert "FASTRTPS_DEFAULT_PROFILES_FILE=…/config/fastdds.xml" in issue.cure


def test_two_publishers_on_one_image_topic() -> None:
    facts = TopicFacts("sensor_msgs/msg/Image", (RELIABLE, Endpoint("/player", True, False)), (), 10)
    (issue,) = live_graph(plane_a__image_raw=facts)
    assert issue.problem == "2 publishers (/bridge, /player)"


def test_a_subscription_that_hears_nothing_is_named_unless_its_node_has_another() -> None:
    deaf, latched = Endpoint("/viewer", True, False), Endpoint("/lasso_tracker", True, True)
    subscriptions = (deaf, latched, Endpoint("/lasso_tracker", False, False))
    facts = TopicFacts("sensor_msgs/msg/CameraInfo", (BEST_EFFORT,), subscriptions, 10)
    (issue,) = live_graph(plane_a__camera_info=facts)
    assert issue.problem == "/viewer asks for reliable delivery, which no publisher offers: it hears nothing"


def test_a_graph_in_a_namespace_is_recognised() -> None:
    topics = {f"/lab{topic.recorded_name}": TopicFacts(topic.type_name, (RELIABLE,), (), 10) for topic in INPUTS}
    issues = list(check_graph(topics, live=True))
    assert {issue.problem for issue in issues} == {"it is in the namespace /lab"}
    assert all(issue.cure.endswith("this command with --namespace /lab") for issue in issues)


def test_two_trackers_on_one_motion() -> None:
    tracker = Endpoint("/lasso_tracker", True, False)
    (issue,) = live_graph(motion=TopicFacts("geometry_msgs/msg/PoseStamped", (tracker, tracker), (), 0))
    assert (issue.severity, issue.subject) == ("error", "/motion")
    assert issue.problem == "2 publishers (/lasso_tracker, /lasso_tracker)"
    assert live_graph(motion=TopicFacts("geometry_msgs/msg/PoseStamped", (tracker,), (), 0)) == []


COMPRESSED = TopicFacts("sensor_msgs/msg/CompressedImage", (RELIABLE,), (), 10)


@pytest.mark.parametrize("name", ["/plane_a/image_raw", "/plane_a/image_raw/compressed", "/cath/frontal/compressed"])
@pytest.mark.parametrize("live", [True, False])
def test_compressed_images_are_named_where_they_are(name: str, live: bool) -> None:
    topics = {topic.recorded_name: TopicFacts(topic.type_name, (RELIABLE,), (), 10) for topic in INPUTS}
    del topics["/plane_a/image_raw"]
    issues = list(check_graph({**topics, name: COMPRESSED}, live=live))
    if name == "/plane_a/image_raw/compressed":
        assert issues == []  # as it should be
        return
    (issue,) = issues
    assert (issue.severity, issue.subject) == ("error", "/plane_a/image_raw")
    assert "carries compressed images" in issue.problem
    assert name == "/plane_a/image_raw" or name in issue.problem
    assert (
        f"start the nodes with --ros-args -r plane_a/image_raw/compressed:={name}"
        if live
        else f"--remap {name}:=/plane_a/image_raw/compressed"
    ) == issue.cure


@pytest.mark.parametrize("live", [True, False])
def test_raw_images_go_before_compressed_ones(live: bool) -> None:
    topics = {topic.recorded_name: TopicFacts(topic.type_name, (RELIABLE,), (), 10) for topic in INPUTS}
    (issue,) = check_graph({**topics, "/plane_a/image_raw/compressed": COMPRESSED}, live=live)
    assert (issue.severity, issue.subject) == ("note", "/plane_a/image_raw")
    assert issue.problem == "/plane_a/image_raw/compressed is there too; these are taken"
