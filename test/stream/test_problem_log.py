"""Problems are noted from any thread, taken once, and counted for good."""

from __future__ import annotations

import threading

from lasso_motion_ros.stream.problem_log import Problem, ProblemLog, problem_lines


def test_problems_are_taken_once_and_counted_for_good() -> None:
    log = ProblemLog()
    log.report("plane_a/seed", "too few")
    log.report("", "a new run")
    assert log.take() == [Problem("plane_a/seed", "too few"), Problem("", "a new run")]
    assert log.take() == []
    log.report("", "a new run")
    assert log.counts == {"plane_a/seed": 1, "": 2}


def test_only_the_last_are_kept_where_nobody_takes_them() -> None:
    log = ProblemLog()
    for number in range(1000):
        log.report("topic", str(number))
    assert [problem.text for problem in log.take()] == [str(number) for number in range(936, 1000)]
    assert log.counts == {"topic": 1000}


def test_no_problem_is_lost_between_threads() -> None:
    log = ProblemLog()
    threads = [threading.Thread(target=lambda: [log.report("topic", "bad") for _ in range(500)]) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert log.counts == {"topic": 2000}


def test_what_is_wrong_on_several_topics_alike_is_said_once() -> None:
    found = {Problem("plane_a/x", "bad"): 3, Problem("plane_b/x", "bad"): 1, Problem("", "a new run"): 1}
    assert problem_lines(found) == ["plane_a/x, plane_b/x: bad (4 times)", "a new run"]
