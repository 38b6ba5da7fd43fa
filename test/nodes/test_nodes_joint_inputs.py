"""Inputs that belong together: calibrations are taken with images, one each; one timer looks for publishers."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest

pytest.importorskip("rclpy", reason="needs ROS 2")

from lasso_motion_ros.nodes import joint_inputs
from lasso_motion_ros.nodes.joint_inputs import JointInputs


class Waiting:
    """A subscription in which messages wait."""

    msg_type, raw = bytes, True

    def __init__(self, *messages: bytes) -> None:
        self._messages = list(messages)

    @property
    def handle(self) -> Any:
        return self

    def __enter__(self) -> None:
        return None

    def __exit__(self, *_: object) -> None:
        return None

    def take_message(self, message_type: type, raw: bool) -> tuple[bytes, dict[str, Any]] | None:
        return (self._messages.pop(0), {}) if self._messages else None


@pytest.fixture
def inputs(monkeypatch: pytest.MonkeyPatch) -> JointInputs:
    monkeypatch.setattr(joint_inputs, "steady_timer", lambda node, period_s, callback: SimpleNamespace(fire=callback))
    return JointInputs(SimpleNamespace(destroy_timer=lambda timer: None))  # type: ignore[arg-type]


def test_one_message_of_each_calibration_is_taken(inputs: JointInputs) -> None:
    taken: list[bytes] = []
    first, second, third = Waiting(b"a"), Waiting(b"b", b"c"), Waiting()
    for one in (first, second, third):
        inputs.add_calibration(one, taken.append)  # type: ignore[arg-type]
    inputs.take_calibrations()
    assert taken == [b"a", b"b"]
    inputs.remove(third)  # type: ignore[arg-type]
    inputs.take_calibrations()
    assert taken == [b"a", b"b", b"c"]
    inputs.remove(second)  # type: ignore[arg-type]
    inputs.take_calibrations()
    assert taken == [b"a", b"b", b"c"]


def test_all_are_looked_for_by_one_timer(inputs: JointInputs) -> None:
    looked: list[str] = []
    inputs.look_for(lambda: looked.append("a"))
    inputs.look_for(lambda: looked.append("b"))
    inputs._timer.fire()  # type: ignore[attr-defined]
    assert looked == ["a", "b"]
