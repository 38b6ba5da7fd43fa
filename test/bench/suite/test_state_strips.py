"""An event's course as a line of letters."""

from lasso_motion_ros.bench.suite.state_strips import LEGEND, format_strips, state_strip
from lasso_motion_ros.evaluation.measures import PairScore


def score(index, state, **changes):
    values = {"is_reference": index == 0, "expected": index > 0, "hidden": False, "displaced": False}
    values |= {"has_pose": state in ("TRACKING", "DEGRADED")} | changes
    return PairScore(index=index, stamp_ns=index, state=state, **values)


COURSE = [
    score(0, "TRACKING"),
    score(1, "DEGRADED"),
    score(2, "LOST"),
    score(3, "TRACKING", hidden=True, expected=False),
    score(4, "DISPLACED", displaced=True, expected=False),
    score(5, "LOST", expected=False),
]


def test_a_letter_for_each_pair_what_was_due_and_what_was_said():
    strip = state_strip(COURSE)
    assert strip.due == "ooox" + "x."
    assert strip.states == "Td-!x-"


def test_a_refused_seed_leaves_no_states():
    assert state_strip(COURSE, refused=True).states == "r" * 6


def test_the_lines_stand_under_each_other():
    text = format_strips([("slide 0 tracker", state_strip(COURSE)), ("cough", state_strip(COURSE[:2]))])
    first, second, third, fourth, legend = text.splitlines()
    assert first == "slide 0 tracker  due    oooxx."
    assert second == "                 state  Td-!x-"
    assert third == "cough            due    oo"
    assert fourth == "                 state  Td"
    assert legend == LEGEND
