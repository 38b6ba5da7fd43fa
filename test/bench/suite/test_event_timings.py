"""How fast events are noticed, by hand."""

from support.suite_inputs import result, score

from lasso_motion_ros.bench.suite.event_timings import EventTiming, event_timings, timing_distribution
from lasso_motion_ros.bench.suite.suite_tables import format_suite
from lasso_motion_ros.phantom.settings import Event


def test_events_are_timed() -> None:
    hidden = {"hidden": True, "expected": False}
    one = result(
        score(0),
        score(1, **hidden),
        score(2, has_pose=False, **hidden),
        score(3, has_pose=False),
        score(4),
        event=Event("hide", 1, 2),
    )
    (timing,) = event_timings([one])
    assert (timing.pairs_to_silence, timing.pairs_to_recovery, timing.returned) == (1, 1, True)
    text = format_suite([one])
    assert "poses before silence" in text
    assert text.splitlines()[-3:] == [
        "pairs waited                       1",
        "to no pose, hidden or taken out    1",
        "from the return to a pose, hidden  1",
    ]


def test_pairs_waited_are_counted() -> None:
    moved = [EventTiming("s", "move", silence, None, displaced, False) for silence, displaced in ((0, 0), (2, None))]
    hidden = [EventTiming("s", "hide", 0, recovery, None, back) for recovery, back in ((3, True), (None, False))]
    taken = [EventTiming("s", "remove", None, None, None, False)]
    assert timing_distribution([*moved, *hidden, *taken]) == {
        "to no pose, hidden or taken out": {"0": 2, "never": 1},
        "to no pose, moved": {"0": 1, "2": 1},
        "to DISPLACED, moved": {"0": 1, "never": 1},
        "from the return to a pose, hidden": {"3": 1},
    }
